#include <chrono>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <stdexcept>
#include <string>
#include <sys/socket.h>
#include <unistd.h>
#include <vector>

#include "base/log.hpp"
#include "drivers/link/udp_link.hpp"

/// UDP links with the real loop and real sockets, on 127.0.0.1.
namespace binpick::drivers::link {
namespace {
using namespace std::chrono_literals;

Bytes bytes(std::size_t count, std::uint8_t first) {
  Bytes all(count, std::byte{first});
  return all;
}

struct End {
  std::vector<Bytes> received, to_send;
  std::vector<std::string> downs;
  int ups = 0, others = 0;

  DatagramPeer peer() {
    return {[this](TimePoint) { ++ups; }, [this](ByteView b, TimePoint) { received.emplace_back(b.begin(), b.end()); },
            [this](const std::string& why, TimePoint) { downs.push_back(why); },
            [this] { return std::exchange(to_send, {}); }, [this] { ++others; }};
  }
};

template <class Done>
bool run(Loop& loop, const std::vector<UdpLink*>& links, Done done, Duration limit = 2s) {
  const TimePoint end = std::chrono::steady_clock::now() + limit;
  for (TimePoint now = std::chrono::steady_clock::now(); now < end;) {
    for (UdpLink* link : links) {
      if (link->deadline() && *link->deadline() <= now) link->on_deadline(now);
      link->flush(now);
    }
    if (done()) return true;
    std::optional<TimePoint> deadline = end;
    for (UdpLink* link : links) deadline = earlier(deadline, link->deadline());
    now = loop.wait(deadline);
  }
  return done();
}

TEST(UdpLink, WholeDatagramsBothWaysAndNothingOfOthers) {
  Loop loop;
  End device, host;
  UdpLink device_link{loop, Endpoint{"127.0.0.1", 0}, device.peer(), "device"};
  UdpLink host_link{loop, Endpoint{"127.0.0.1", device_link.local_port()}, host.peer()};
  host.to_send = {bytes(1, 1), bytes(1472, 2)};
  ASSERT_TRUE(run(loop, {&device_link, &host_link}, [&] { return device.received.size() == 2; }));
  EXPECT_EQ(host.ups, 1);
  EXPECT_EQ(device.received[1], bytes(1472, 2));
  device.to_send = {bytes(3, 3)};
  ASSERT_TRUE(run(loop, {&device_link, &host_link}, [&] { return host.received.size() == 1; }));
  EXPECT_EQ(host.received[0], bytes(3, 3));

  const int stranger = ::socket(AF_INET, SOCK_DGRAM, 0);
  sockaddr_in from{};
  from.sin_family = AF_INET;
  from.sin_addr.s_addr = htonl(0x7F000002);
  ASSERT_EQ(::bind(stranger, reinterpret_cast<const sockaddr*>(&from), sizeof from), 0);
  sockaddr_in to = from;
  to.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  to.sin_port = htons(host_link.local_port());
  log::set_sink([](log::Level, std::string_view, std::string_view) {});
  ::sendto(stranger, "x", 1, 0, reinterpret_cast<const sockaddr*>(&to), sizeof to);
  EXPECT_TRUE(run(loop, {&device_link, &host_link}, [&] { return host_link.counters().strangers == 1; }));
  log::set_sink({});
  ::close(stranger);
  EXPECT_EQ(host.received.size(), 1U);
}

TEST(UdpLink, ADatagramLongerThanAnyTelegramIsDroppedAndCounted) {
  Loop loop;
  End device, host;
  UdpLink device_link{loop, Endpoint{"127.0.0.1", 0}, device.peer(), "device"};
  UdpLink host_link{loop, Endpoint{"127.0.0.1", device_link.local_port()}, host.peer()};
  log::set_sink([](log::Level, std::string_view, std::string_view) {});
  host.to_send = {bytes(2049, 1), bytes(2048, 2)};
  EXPECT_TRUE(run(loop, {&device_link, &host_link}, [&] { return device.received.size() == 1; }));
  log::set_sink({});
  EXPECT_EQ(device_link.counters().cut, 1U);
  EXPECT_EQ(device.received[0].size(), 2048U);
}

TEST(UdpLink, ReopensAfterAPauseAndADeviceThatIsAwayDoesNotDisturb) {
  Loop loop;
  End host;
  UdpLink link{loop, Endpoint{"127.0.0.1", 9}, host.peer()};  // nobody listens there: refused, tolerated
  ASSERT_TRUE(run(loop, {&link}, [&] { return host.ups == 1; }));
  host.to_send = {bytes(1, 1), bytes(1, 2)};
  run(
      loop, {&link}, [] { return false; }, 50ms);
  EXPECT_TRUE(host.downs.empty());
  link.reopen(std::chrono::steady_clock::now());
  EXPECT_EQ(host.downs, std::vector<std::string>{"closed by us"});
  EXPECT_EQ(link.local_port(), 0);
  EXPECT_TRUE(run(loop, {&link}, [&] { return host.ups == 2; }));
}

TEST(UdpLink, APortThatIsTakenIsSaid) {
  Loop loop;
  End a, b;
  UdpLink first{loop, Endpoint{"127.0.0.1", 0}, a.peer(), "device"};
  EXPECT_THROW((UdpLink{loop, Endpoint{"127.0.0.1", first.local_port()}, b.peer(), "device"}), std::runtime_error);
  UdpLink client{loop, Endpoint{"127.0.0.1", 9}, b.peer(), first.local_port()};
  ASSERT_TRUE(run(loop, {&client}, [&] { return b.downs.size() == 1; }));
  EXPECT_NE(b.downs[0].find("UDP port " + std::to_string(first.local_port())), std::string::npos) << b.downs[0];
}
}  // namespace
}  // namespace binpick::drivers::link
