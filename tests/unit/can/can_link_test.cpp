#include <arpa/inet.h>
#include <cerrno>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <stdexcept>
#include <string>
#include <sys/socket.h>
#include <unistd.h>
#include <vector>

#include "base/log.hpp"
#include "drivers/link/can.hpp"
#include "drivers/link/can_socket.hpp"
#include "drivers/link/cannelloni.hpp"
#include "drivers/link/cannelloni_link.hpp"
#include "drivers/pivot/session.hpp"
#include "tests/emulators/pivot/pivot.hpp"

/// The CAN links with the real loop and real sockets, on 127.0.0.1.
namespace binpick::drivers::link {
namespace {
using namespace std::chrono_literals;

struct End {
  std::vector<CanFrame> received, to_send;
  std::vector<std::string> downs;
  int ups = 0;
  TimePoint received_at{};

  CanPeer peer() {
    return {[this](TimePoint) { ++ups; },
            [this](const CanFrame& frame, TimePoint at) {
              received.push_back(frame);
              received_at = at;
            },
            [this](const std::string& why, TimePoint) { downs.push_back(why); },
            [this] { return std::exchange(to_send, {}); }};
  }
};

CanFrame frame(std::uint32_t id, std::uint8_t first) {
  CanFrame f;
  f.id = id;
  f.length = 1;
  f.payload[0] = first;
  return f;
}

/// Runs loop and links until `done`, at most two seconds.
template <class Done>
bool run(Loop& loop, const std::vector<CanLink*>& links, Done done) {
  const TimePoint end = std::chrono::steady_clock::now() + 2s;
  for (TimePoint now = std::chrono::steady_clock::now(); now < end;) {
    for (CanLink* link : links) {
      if (link->deadline() && *link->deadline() <= now) link->on_deadline(now);
      link->flush(now);
    }
    if (done()) return true;
    std::optional<TimePoint> deadline = end;
    for (CanLink* link : links) deadline = earlier(deadline, link->deadline());
    now = loop.wait(deadline);
  }
  return done();
}

TEST(CannelloniLink, FramesBothWaysThroughTheFilter) {
  Loop loop;
  End module, host;
  CannelloniLink bus{loop, Endpoint{"127.0.0.1", 0}, module.peer()};
  const auto link = open_can(loop, "cannelloni://127.0.0.1:" + std::to_string(bus.local_port()),
                             {CanFilter{0x0AC, 0x7FF}}, host.peer());
  host.to_send = {frame(0x0CC, 1), frame(0x0EC, 2)};
  ASSERT_TRUE(run(loop, {&bus, link.get()}, [&] { return module.received.size() == 2; }));
  EXPECT_EQ(host.ups, 1);
  EXPECT_EQ(module.received[1], frame(0x0EC, 2));
  CanFrame bus_off = frame(0x040, 0);
  bus_off.error = true;
  const TimePoint before = std::chrono::steady_clock::now();
  module.to_send = {frame(0x0AD, 9), frame(0x0AC, 3), bus_off};
  ASSERT_TRUE(run(loop, {&bus, link.get()}, [&] { return host.received.size() == 2; }));
  EXPECT_EQ(host.received, (std::vector{frame(0x0AC, 3), bus_off})) << "another module's frame is filtered";
  EXPECT_GE(host.received_at, before - 1ms);
  EXPECT_LE(host.received_at, std::chrono::steady_clock::now());
}

TEST(CannelloniLink, CountsGapsAndBadDatagramsAndIsNotDisturbed) {
  Loop loop;
  End host;
  CannelloniLink link{loop, Endpoint{"127.0.0.1", 9}, {}, host.peer(), 0};  // nobody listens there: refused, tolerated
  ASSERT_TRUE(run(loop, {&link}, [&] { return host.ups == 1; }));
  const int fd = ::socket(AF_INET, SOCK_DGRAM, 0);
  sockaddr_in to{};
  to.sin_family = AF_INET;
  to.sin_port = htons(link.local_port());
  to.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  const auto send = [&](const Bytes& bytes) {
    ::sendto(fd, bytes.data(), bytes.size(), 0, reinterpret_cast<const sockaddr*>(&to), sizeof to);
  };
  log::set_sink([](log::Level, std::string_view, std::string_view) {});
  send(cannelloni::encode(250, std::vector{frame(1, 1)}));
  send(Bytes{std::byte{7}});
  send(cannelloni::encode(3, std::vector{frame(2, 2)}));  // 251 … 255 and 0 … 2 are missing
  host.to_send = {frame(0x0CC, 1)};
  EXPECT_TRUE(run(loop, {&link}, [&] { return host.received.size() == 2; }));
  log::set_sink({});
  ::close(fd);
  EXPECT_EQ(link.counters().lost, 8U);
  EXPECT_EQ(link.counters().bad, 1U);
  EXPECT_TRUE(host.downs.empty());
}

TEST(CannelloniLink, StrangersAreDropped) {
  Loop loop;
  End host;
  CannelloniLink link{loop, Endpoint{"127.0.0.2", 9}, {}, host.peer(), 0};
  ASSERT_TRUE(run(loop, {&link}, [&] { return host.ups == 1; }));
  const int fd = ::socket(AF_INET, SOCK_DGRAM, 0);  // speaks from 127.0.0.1
  sockaddr_in to{};
  to.sin_family = AF_INET;
  to.sin_port = htons(link.local_port());
  to.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  const Bytes bytes = cannelloni::encode(0, std::vector{frame(1, 1)});
  ::sendto(fd, bytes.data(), bytes.size(), 0, reinterpret_cast<const sockaddr*>(&to), sizeof to);
  log::set_sink([](log::Level, std::string_view, std::string_view) {});
  EXPECT_TRUE(run(loop, {&link}, [&] { return link.counters().strangers == 1; }));
  log::set_sink({});
  ::close(fd);
  EXPECT_TRUE(host.received.empty());
}

TEST(CannelloniLink, ABusyPortIsSaidOnceAndTriedAgain) {
  Loop loop;
  End other, host;
  std::optional<CannelloniLink> busy;
  busy.emplace(loop, Endpoint{"0.0.0.0", 0}, other.peer());
  const std::uint16_t port = busy->local_port();
  CannelloniLink link{loop, Endpoint{"127.0.0.1", 9}, {}, host.peer(), port};
  ASSERT_TRUE(run(loop, {&link}, [&] { return !host.downs.empty(); }));
  EXPECT_NE(host.downs[0].find(std::to_string(port)), std::string::npos) << host.downs[0];
  EXPECT_THROW((CannelloniLink{loop, Endpoint{"0.0.0.0", port}, other.peer()}), std::runtime_error);
  busy.reset();
  link.on_deadline(*link.deadline());  // when the time has come
  EXPECT_EQ(host.ups, 1);
  EXPECT_EQ(host.downs.size(), 1U);
}

TEST(OpenCan, RefusesAddressesThatCanNeverWork) {
  Loop loop;
  End host;
  for (const char* address : {"", "can 0", "a-name-too-long-for-linux", "cannelloni://", "cannelloni://host",
                              "cannelloni://host:0", "cannelloni://host:70000", "tcp://host:1"})
    EXPECT_THROW(open_can(loop, address, {}, host.peer()), std::runtime_error) << address;
}

TEST(CanSocket, AMissingInterfaceIsDownAndTriedAgain) {
  Loop loop;
  End host;
  const auto link = open_can(loop, "nocan7", {CanFilter{0x0AC, 0x7FF}}, host.peer());
  const TimePoint start = std::chrono::steady_clock::now();
  ASSERT_TRUE(link->deadline());
  link->on_deadline(start);
  ASSERT_EQ(host.downs.size(), 1U);
  EXPECT_TRUE(host.downs[0].find("nocan7") != std::string::npos || host.downs[0].find("no CAN") != std::string::npos)
      << host.downs[0];
  host.to_send = {frame(0x0CC, 1)};
  link->flush(start);
  EXPECT_TRUE(host.to_send.empty()) << "frames for a bus that is down are thrown away";
  Duration last{0};
  for (int i = 0; i < 6; ++i) {  // in virtual time
    const TimePoint at = *link->deadline();
    link->on_deadline(at);
    last = *link->deadline() - at;
  }
  EXPECT_EQ(last, 1s);
  EXPECT_EQ(host.downs.size(), 1U) << "the same reason again is not news";
}

/// A session and an emulated pivot, joined by UDP and the real clock.
TEST(CannelloniLink, APivotIsReadyAndMovesOverUdp) {
  Loop loop;
  emulators::PivotOptions module_options;
  module_options.start = Angle::deg(2);
  emulators::Pivot module{module_options};
  pivot::Session session{pivot::Options{}};
  CannelloniLink bus{loop, Endpoint{"127.0.0.1", 0},
                     CanPeer{{},
                             [&](const CanFrame& f, TimePoint at) { module.on_frame(f, at); },
                             {},
                             [&] { return module.take_frames(); }}};
  const auto link =
      open_can(loop, "cannelloni://127.0.0.1:" + std::to_string(bus.local_port()), {CanFilter{0x0AC, 0x7FF}},
               CanPeer{[&](TimePoint now) { session.on_link_up(now); },
                       [&](const CanFrame& f, TimePoint at) { session.on_frame(f, at); },
                       [&](const std::string& why, TimePoint now) { session.on_link_down(why, now); },
                       [&] { return session.take_frames(); }});
  std::optional<Angle> done;
  bool moving = false;
  const TimePoint end = std::chrono::steady_clock::now() + 10s;
  TimePoint now = std::chrono::steady_clock::now();
  while (!done && now < end) {
    if (link->deadline() && *link->deadline() <= now) link->on_deadline(now);
    if (bus.deadline() && *bus.deadline() <= now) bus.on_deadline(now);
    if (session.deadline() && *session.deadline() <= now) session.on_deadline(now);
    if (module.deadline() && *module.deadline() <= now) module.on_deadline(now);
    while (const auto event = session.take_event())
      if (const auto* move_done = std::get_if<pivot::MoveDone>(&*event)) done = move_done->angle;
    if (session.state() == pivot::Session::State::Standing && !moving) {
      moving = true;
      session.move_to(Angle::deg(5), 1.0, now);
    }
    link->flush(now);
    bus.flush(now);
    now = loop.wait(earlier(earlier(earlier(end, session.deadline()), module.deadline()),
                            earlier(link->deadline(), bus.deadline())));
  }
  ASSERT_TRUE(done);
  EXPECT_NEAR(done->in_deg(), 5, 0.1);
}
}  // namespace

TEST(CanSocket, ARefusedSocketNamesAllThatMayRefuseIt) {
  const auto says = [](int error, const char* words) {
    return no_can_socket_text(error).find(words) != std::string::npos;
  };
  // systemd's RestrictAddressFamilies= answers EAFNOSUPPORT, as a kernel without CAN does.
  EXPECT_TRUE(says(EAFNOSUPPORT, "kernel has no CAN") && says(EAFNOSUPPORT, "RestrictAddressFamilies="));
  EXPECT_TRUE(says(EPERM, "RestrictAddressFamilies=") && !says(EPERM, "kernel has no CAN"));
  EXPECT_TRUE(says(EACCES, "sandbox") && !says(EACCES, "kernel has no CAN"));
  EXPECT_TRUE(says(ENOMEM, "Cannot allocate memory") && !says(ENOMEM, "RestrictAddressFamilies="));
}
}  // namespace binpick::drivers::link
