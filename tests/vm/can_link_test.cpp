#include <cstring>
#include <gtest/gtest.h>
#include <iterator>
#include <linux/can.h>
#include <linux/can/raw.h>
#include <net/if.h>
#include <spawn.h>
#include <sstream>
#include <string>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>
#include <vector>

#include "drivers/link/can_socket.hpp"
#include "drivers/pivot/session.hpp"
#include "tests/emulators/pivot/pivot.hpp"

/// The SocketCAN link on a real kernel: can0 and can1 are two controllers on one bus, vcan0 is virtual. Run by
/// tests/vm/can inside its virtual machine.
namespace binpick::drivers::link {
namespace {
using namespace std::chrono_literals;

TimePoint clock_now() { return std::chrono::steady_clock::now(); }

struct End {
  explicit End(Loop& loop, const char* interface, std::vector<CanFilter> filters = {})
      : link{loop, interface, std::move(filters),
             CanPeer{[this](TimePoint) { ++ups; },
                     [this](const CanFrame& frame, TimePoint at) {
                       received.push_back(frame);
                       times.push_back(at);
                     },
                     [this](const std::string& why, TimePoint) { downs.push_back(why); },
                     [this] { return std::exchange(to_send, {}); }}} {}
  std::vector<CanFrame> received, to_send;
  std::vector<TimePoint> times;
  std::vector<std::string> downs;
  int ups = 0;
  CanSocket link;
};

CanFrame frame(std::uint32_t id, std::uint32_t number) {
  CanFrame f;
  f.id = id;
  f.length = 4;
  std::memcpy(f.payload.data(), &number, 4);
  return f;
}

/// Runs loop and links until `done`; the machine is emulated and slow, so the limit is generous.
template <class Done>
bool run(Loop& loop, const std::vector<CanSocket*>& links, Done done, Duration limit = 5s) {
  const TimePoint end = clock_now() + limit;
  for (TimePoint now = clock_now(); now < end;) {
    for (CanSocket* link : links)
      if (link->deadline() && *link->deadline() <= now) link->on_deadline(now);
    if (done()) return true;
    for (CanSocket* link : links) link->flush(now);
    std::optional<TimePoint> deadline = end;
    for (CanSocket* link : links) deadline = earlier(deadline, link->deadline());
    now = loop.wait(deadline);
  }
  return done();
}

/// Runs a program of the virtual machine: "real-ip link set can0 down".
void shell(const std::string& command) {
  std::istringstream in{command};
  std::vector<std::string> words{std::istream_iterator<std::string>{in}, {}};
  std::vector<char*> arguments;
  for (std::string& word : words) arguments.push_back(word.data());
  arguments.push_back(nullptr);
  pid_t pid = 0;
  ASSERT_EQ(::posix_spawnp(&pid, arguments[0], nullptr, nullptr, arguments.data(), environ), 0) << command;
  int status = -1;
  ASSERT_EQ(::waitpid(pid, &status, 0), pid);
  ASSERT_EQ(status, 0) << command;
}

TEST(CanSocketOnAKernel, FramesBothWaysThroughExactFilters) {
  Loop loop;
  End host{loop, "can0", {CanFilter{0x0AC, 0x7FF}, CanFilter{0x06C, 0x7FF}}};
  End module{loop, "can1"};
  ASSERT_TRUE(run(loop, {&host.link, &module.link}, [&] { return host.ups == 1 && module.ups == 1; }));
  host.to_send = {frame(0x0CC, 1), frame(0x0EC, 2)};
  ASSERT_TRUE(run(loop, {&host.link, &module.link}, [&] { return module.received.size() == 2; }));
  EXPECT_EQ(module.received, (std::vector{frame(0x0CC, 1), frame(0x0EC, 2)}));
  CanFrame extended = frame(0x0AC, 3);
  extended.extended = true;
  module.to_send = {frame(0x0AD, 1), extended, frame(0x06C, 5), frame(0x0AC, 6)};
  ASSERT_TRUE(run(loop, {&host.link, &module.link}, [&] { return host.received.size() == 2; }));
  EXPECT_EQ(host.received, (std::vector{frame(0x06C, 5), frame(0x0AC, 6)}));
}

/// On the virtual bus: QEMU 7.2's controller loses its place in the receive buffer after a remote frame.
TEST(CanSocketOnAKernel, RemoteFramesAreKeptOutByTheFilter) {
  Loop loop;
  End host{loop, "vcan0", {CanFilter{0x0AC, 0x7FF}}}, all{loop, "vcan0"}, module{loop, "vcan0"};
  ASSERT_TRUE(run(loop, {&host.link, &all.link, &module.link}, [&] { return host.ups + all.ups + module.ups == 3; }));
  CanFrame rtr = frame(0x0AC, 0);
  rtr.rtr = true;
  module.to_send = {rtr, frame(0x0AC, 6)};
  ASSERT_TRUE(run(loop, {&host.link, &all.link, &module.link},
                  [&] { return host.received.size() == 1 && all.received.size() == 2; }));
  EXPECT_EQ(host.received, std::vector{frame(0x0AC, 6)});
  EXPECT_EQ(all.received, (std::vector{rtr, frame(0x0AC, 6)}));
}

TEST(CanSocketOnAKernel, FramesCarryTheKernelsReceiveTime) {
  Loop loop;
  End host{loop, "can0"}, module{loop, "can1"};
  ASSERT_TRUE(run(loop, {&host.link, &module.link}, [&] { return host.ups == 1 && module.ups == 1; }));
  module.to_send = {frame(0x0AC, 1)};
  const TimePoint before = clock_now();
  module.link.flush(before);
  Loop elsewhere;  // the frame lies in the kernel meanwhile: its time must be that of its arrival
  elsewhere.wait(before + 200ms);
  const TimePoint after = clock_now();
  ASSERT_TRUE(run(loop, {&host.link, &module.link}, [&] { return host.received.size() == 1; }));
  EXPECT_EQ(host.link.counters().kernel_times, 1U);
  EXPECT_GE(host.times[0], before - 1ms);
  EXPECT_LT(host.times[0], after - 50ms) << "stamped when read, not when received";
}

TEST(CanSocketOnAKernel, AFullQueueIsWaitedOut) {
  // Two frames fit the queue, and a token bucket lets 200 a second pass: write answers ENOBUFS again and again.
  shell("real-tc qdisc add dev can0 root tbf rate 25600bit burst 32 limit 48");
  Loop loop;
  End host{loop, "can0"}, module{loop, "can1"};
  ASSERT_TRUE(run(loop, {&host.link, &module.link}, [&] { return host.ups == 1 && module.ups == 1; }));
  for (std::uint32_t i = 0; i < 12; ++i) host.to_send.push_back(frame(0x0CC, i));
  ASSERT_TRUE(run(loop, {&host.link, &module.link}, [&] { return module.received.size() == 12; }));
  for (std::uint32_t i = 0; i < 12; ++i) EXPECT_EQ(module.received[i], frame(0x0CC, i));
  EXPECT_GT(host.link.counters().queue_full, 0U);
  EXPECT_EQ(host.link.counters().unsent, 0U);
  std::printf("queue full %llu times, all 12 frames arrived in order\n",
              static_cast<unsigned long long>(host.link.counters().queue_full));
  shell("real-tc qdisc del dev can0 root");
}

TEST(CanSocketOnAKernel, AQueueThatStaysFullCostsFramesAndNoTime) {
  shell("real-tc qdisc add dev can0 root tbf rate 8bit burst 16 limit 16");  // as good as shut
  Loop loop;
  End host{loop, "can0"};
  ASSERT_TRUE(run(loop, {&host.link}, [&] { return host.ups == 1; }));
  for (std::uint32_t i = 0; i < 50; ++i) host.to_send.push_back(frame(0x0CC, i));
  EXPECT_TRUE(run(loop, {&host.link}, [&] { return host.link.counters().unsent >= 45; }));
  EXPECT_FALSE(host.link.deadline()) << "nothing left to try";
  shell("real-tc qdisc del dev can0 root");
}

TEST(CanSocketOnAKernel, AFloodArrivesWholeAndInOrder) {
  Loop loop;
  End host{loop, "can0"}, module{loop, "can1"};
  ASSERT_TRUE(run(loop, {&host.link, &module.link}, [&] { return host.ups == 1 && module.ups == 1; }));
  constexpr std::uint32_t kFrames = 2000;
  std::uint32_t sent = 0;
  const auto done = [&] {
    for (int i = 0; i < 8 && sent < kFrames; ++i) host.to_send.push_back(frame(0x0CC, sent++));
    return module.received.size() == kFrames;
  };
  ASSERT_TRUE(run(loop, {&host.link, &module.link}, done, 20s))
      << module.received.size() << " of " << kFrames << ", " << module.link.counters().dropped_by_kernel << " dropped";
  for (std::uint32_t i = 0; i < kFrames; ++i) ASSERT_EQ(module.received[i], frame(0x0CC, i));
}

TEST(CanSocketOnAKernel, AnInterfaceThatGoesDownIsFoundAgain) {
  Loop loop;
  End host{loop, "can0"}, module{loop, "can1"};
  ASSERT_TRUE(run(loop, {&host.link, &module.link}, [&] { return host.ups == 1 && module.ups == 1; }));
  shell("real-ip link set can0 down");
  ASSERT_TRUE(run(loop, {&host.link, &module.link}, [&] { return host.downs.size() >= 2; }));
  for (const std::string& why : host.downs) std::printf("down: %s\n", why.c_str());
  const TimePoint back = clock_now();
  shell("real-ip link set can0 up");
  ASSERT_TRUE(run(loop, {&host.link, &module.link}, [&] { return host.ups == 2; }));
  std::printf("up again %.0f ms after the interface\n", in_ms(clock_now() - back));
  EXPECT_LT(clock_now() - back, 3s);
  host.to_send = {frame(0x0CC, 7)};
  EXPECT_TRUE(run(loop, {&host.link, &module.link}, [&] { return module.received.size() == 1; }));
}

TEST(CanSocketOnAKernel, AnInterfaceThatVanishesIsFoundAgain) {
  Loop loop;
  End host{loop, "vcan0"};
  ASSERT_TRUE(run(loop, {&host.link}, [&] { return host.ups == 1; }));
  shell("real-ip link del vcan0");
  ASSERT_TRUE(run(loop, {&host.link}, [&] { return host.downs.size() >= 2; }));
  EXPECT_NE(host.downs.back().find("vcan0"), std::string::npos);
  for (const std::string& why : host.downs) std::printf("down: %s\n", why.c_str());
  shell("real-ip link add dev vcan0 type vcan");
  shell("real-ip link set vcan0 up");
  EXPECT_TRUE(run(loop, {&host.link}, [&] { return host.ups == 2; }));
}

/// The emulated controllers never go bus-off by themselves. The kernel hands an error frame that another program writes
/// to a virtual bus to our error filter just as one of a driver's.
TEST(CanSocketOnAKernel, BusOffIsDownAndARestartIsUp) {
  Loop loop;
  End host{loop, "vcan0", {CanFilter{0x0AC, 0x7FF}}};
  ASSERT_TRUE(run(loop, {&host.link}, [&] { return host.ups == 1; }));
  const int fd = ::socket(PF_CAN, SOCK_RAW, CAN_RAW);
  ifreq request{};
  std::memcpy(request.ifr_name, "vcan0", 6);
  ASSERT_EQ(::ioctl(fd, SIOCGIFINDEX, &request), 0);
  sockaddr_can address{};
  address.can_family = AF_CAN;
  address.can_ifindex = request.ifr_ifindex;
  ASSERT_EQ(::bind(fd, reinterpret_cast<const sockaddr*>(&address), sizeof address), 0);
  const auto write_error = [fd](std::uint32_t classes) {
    can_frame raw{};
    raw.can_id = CAN_ERR_FLAG | classes;
    raw.can_dlc = 8;
    return ::write(fd, &raw, sizeof raw) == sizeof raw;
  };
  ASSERT_TRUE(write_error(can_error::kBusOff));
  ASSERT_TRUE(run(loop, {&host.link}, [&] { return !host.downs.empty(); }));
  EXPECT_TRUE(host.downs[0].starts_with("bus-off")) << host.downs[0];
  ASSERT_EQ(host.received.size(), 1U);
  EXPECT_TRUE(host.received[0].error);
  host.to_send = {frame(0x0CC, 1)};
  host.link.flush(clock_now());
  EXPECT_EQ(host.link.counters().sent, 0U) << "nothing is queued for a bus that is off";
  ASSERT_TRUE(write_error(can_error::kRestarted));
  EXPECT_TRUE(run(loop, {&host.link}, [&] { return host.ups == 2; }));
  ::close(fd);
}

TEST(CanSocketOnAKernel, APivotIsReferencedAndMoves) {
  Loop loop;
  emulators::PivotOptions module_options;
  module_options.start = Angle::deg(3);
  emulators::Pivot module{module_options};
  pivot::Session session{pivot::Options{}};
  CanSocket bus{loop,
                "can1",
                {},
                CanPeer{{},
                        [&](const CanFrame& f, TimePoint at) { module.on_frame(f, at); },
                        {},
                        [&] { return module.take_frames(); }}};
  CanSocket link{loop,
                 "can0",
                 {CanFilter{0x0AC, 0x7FF}, CanFilter{0x06C, 0x7FF}},
                 CanPeer{[&](TimePoint now) { session.on_link_up(now); },
                         [&](const CanFrame& f, TimePoint at) { session.on_frame(f, at); },
                         [&](const std::string& why, TimePoint now) { session.on_link_down(why, now); },
                         [&] { return session.take_frames(); }}};
  std::optional<Angle> done;
  bool moving = false;
  std::size_t samples = 0;
  const TimePoint end = clock_now() + 30s;
  TimePoint now = clock_now();
  while (!done && now < end) {
    for (CanSocket* each : {&link, &bus})
      if (each->deadline() && *each->deadline() <= now) each->on_deadline(now);
    if (session.deadline() && *session.deadline() <= now) session.on_deadline(now);
    if (module.deadline() && *module.deadline() <= now) module.on_deadline(now);
    while (const auto event = session.take_event()) {
      if (const auto* move_done = std::get_if<pivot::MoveDone>(&*event)) done = move_done->angle;
      if (const auto* failed = std::get_if<pivot::Failed>(&*event)) std::printf("failed: %s\n", failed->text.c_str());
      if (std::holds_alternative<pivot::Sample>(*event)) ++samples;
    }
    if (session.state() == pivot::Session::State::Standing && !moving) {
      moving = true;
      session.move_to(Angle::deg(8), 0.5, now);
    }
    link.flush(now);
    bus.flush(now);
    now = loop.wait(earlier(earlier(earlier(end, session.deadline()), module.deadline()),
                            earlier(link.deadline(), bus.deadline())));
  }
  ASSERT_TRUE(done);
  EXPECT_NEAR(done->in_deg(), 8, 0.1);
  std::printf("moved over the bus, %zu positions read\n", samples);
}
}  // namespace
}  // namespace binpick::drivers::link

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  return RUN_ALL_TESTS();
}
