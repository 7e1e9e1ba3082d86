#include "drivers/link/tcp.hpp"

#include <arpa/inet.h>
#include <array>
#include <fcntl.h>
#include <gtest/gtest.h>
#include <map>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <set>
#include <string>
#include <sys/resource.h>
#include <sys/socket.h>
#include <unistd.h>
#include <vector>

#include "base/log.hpp"

namespace binpick::drivers::link {
namespace {
using namespace std::chrono_literals;

/// Pumps loop and links until `reached` or for at most ten seconds of real time; false when it was not reached.
template <class Condition, class... Links>
bool pump_until(Loop& loop, Condition reached, Links&... links) {
  const TimePoint limit = std::chrono::steady_clock::now() + 10s;
  TimePoint now = std::chrono::steady_clock::now();
  while (!reached()) {
    if (now > limit) return false;
    std::optional<TimePoint> deadline = now + 50ms;
    const auto serve = [&](auto& link) {
      if constexpr (requires { link.on_deadline(now); }) {
        link.on_deadline(now);
        deadline = earlier(deadline, link.deadline());
      }
      link.flush(now);
    };
    (serve(links), ...);
    if (reached()) return true;
    now = loop.wait(deadline);
  }
  return true;
}

/// Records what a client link tells its session.
struct ClientSide {
  int ups = 0, downs = 0;
  Bytes received, output;
  StreamPeer peer() {
    return {[this](TimePoint) { ++ups; }, [this](ByteView bytes, TimePoint) { append(received, bytes); },
            [this](TimePoint) { ++downs; }, [this] { return std::exchange(output, {}); }};
  }
};

struct ServerSide {
  std::vector<std::string> addresses;
  std::vector<std::string> order;  // "+1", "-1"
  std::set<ConnectionId> open, wants_close;
  std::map<ConnectionId, Bytes> received, output;
  bool welcome = true;
  bool echo = false;
  ServerPeer peer() {
    return {[this](ConnectionId id, const std::string& address, std::uint16_t port, TimePoint) {
              EXPECT_NE(port, 0);
              addresses.push_back(address);
              if (!welcome) return false;
              order.push_back("+" + std::to_string(id));
              open.insert(id);
              return true;
            },
            [this](ConnectionId id, ByteView bytes, TimePoint) { append(echo ? output[id] : received[id], bytes); },
            [this](ConnectionId id, TimePoint) {
              order.push_back("-" + std::to_string(id));
              open.erase(id);
            },
            [this](ConnectionId id) { return std::exchange(output[id], {}); },
            [this](ConnectionId id) { return wants_close.contains(id); }};
  }
};

/// A plain blocking socket, for peers that misbehave.
struct RawClient {
  int fd = -1;
  explicit RawClient(int receive_buffer = 0) : fd{::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0)} {
    if (receive_buffer > 0) ::setsockopt(fd, SOL_SOCKET, SO_RCVBUF, &receive_buffer, sizeof receive_buffer);
  }
  bool connect_to(std::uint16_t port) const {
    sockaddr_in to{};
    to.sin_family = AF_INET;
    to.sin_port = htons(port);
    to.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    return ::connect(fd, reinterpret_cast<const sockaddr*>(&to), sizeof to) == 0;
  }
  bool closed_by_peer() const {
    char c = 0;
    const ssize_t n = ::recv(fd, &c, 1, MSG_DONTWAIT);
    return n == 0 || (n < 0 && errno == ECONNRESET);
  }
  ~RawClient() { ::close(fd); }
};

Bytes pattern(std::size_t size) {
  Bytes bytes(size);
  for (std::size_t i = 0; i < size; ++i) bytes[i] = static_cast<std::byte>((i * 31 + i / 257) & 0xFF);
  return bytes;
}

int option(int fd, int level, int name) {
  int value = -1;
  socklen_t length = sizeof value;
  EXPECT_EQ(::getsockopt(fd, level, name, &value, &length), 0);
  return value;
}
}  // namespace

TEST(Endpoint, ReadsWhatPeopleWrite) {
  const auto read = [](std::string_view text) {
    const auto endpoint = parse_endpoint(text);
    return endpoint ? to_string(*endpoint) : "error: " + endpoint.error();
  };
  EXPECT_EQ(read("192.168.0.1:2111"), "192.168.0.1:2111");
  EXPECT_EQ(read("scanner.cell:2111"), "scanner.cell:2111");
  EXPECT_EQ(read("[::1]:502"), "[::1]:502");
  EXPECT_EQ(read(":502"), ":502");
  EXPECT_EQ(read("0.0.0.0:0"), "0.0.0.0:0");
  for (const char* bad : {"", "host", "host:", "host:65536", "host:-1", "host:5x", "::1:502", "[::1:502", "a b:5"})
    EXPECT_EQ(read(bad).substr(0, 6), "error:") << bad;
}

TEST(Tcp, ClientAndServerExchangeBytes) {
  Loop loop;
  ServerSide s;
  s.echo = true;
  TcpServer server{loop, {"127.0.0.1", 0}, s.peer()};
  ClientSide c;
  TcpClient client{loop, {"127.0.0.1", server.port()}, c.peer()};
  c.output = {std::byte{'h'}, std::byte{'i'}};
  ASSERT_TRUE(pump_until(
      loop, [&] { return c.received.size() == 2; }, client, server));
  EXPECT_EQ(as_text(c.received), "hi");
  EXPECT_TRUE(client.connected());
  EXPECT_EQ(client.deadline(), std::nullopt);
  EXPECT_EQ(server.connections(), 1U);
  EXPECT_EQ(s.addresses, std::vector<std::string>{"127.0.0.1"});
}

TEST(Tcp, MegabytesArriveWholeThoughSocketsTakeThemInParts) {
  Loop loop;
  ServerSide s;
  s.echo = true;
  TcpServerOptions options;
  options.unsent_bytes_max = 32 << 20;
  TcpServer server{loop, {"127.0.0.1", 0}, s.peer(), options};
  ClientSide c;
  TcpClientOptions client_options;
  client_options.unsent_bytes_max = 32 << 20;
  TcpClient client{loop, {"127.0.0.1", server.port()}, c.peer(), client_options};
  const Bytes sent = pattern(12 << 20);
  c.output = sent;
  ASSERT_TRUE(pump_until(
      loop, [&] { return c.received.size() >= sent.size(); }, client, server));
  EXPECT_TRUE(c.received == sent);
}

TEST(Tcp, ANameIsResolvedBesideTheLoop) {
  Loop loop;
  ServerSide s;
  TcpServer server{loop, {"", 0}, s.peer()};
  ClientSide c;
  TcpClient client{loop, {"localhost", server.port()}, c.peer()};
  ASSERT_TRUE(pump_until(
      loop, [&] { return client.connected() && s.open.size() == 1; }, client, server));
}

TEST(Tcp, ANameThatDoesNotExistIsAnErrorThatIsRetried) {
  Loop loop;
  ClientSide c;
  TcpClientOptions options;
  options.connect_timeout = 200ms;  // a name server that does not answer is given up as well
  options.retry_first = options.retry_max = 10ms;
  TcpClient client{loop, {"no.such.host.invalid", 1}, c.peer(), options};
  ASSERT_TRUE(pump_until(
      loop, [&] { return !client.last_error().empty(); }, client));
  EXPECT_NE(client.last_error().find("no.such.host.invalid"), std::string::npos) << client.last_error();
  EXPECT_TRUE(client.deadline().has_value());
  EXPECT_EQ(c.ups + c.downs, 0);
}

TEST(Tcp, MappedAddressesAreUnmapped) {
  Loop loop;
  ServerSide s;
  TcpServer server{loop, {"", 0}, s.peer()};
  RawClient raw;
  ASSERT_TRUE(raw.connect_to(server.port()));
  ASSERT_TRUE(pump_until(
      loop, [&] { return !s.open.empty(); }, server));
  EXPECT_EQ(s.addresses, std::vector<std::string>{"127.0.0.1"});
}

TEST(Tcp, RefusedConnectionsAreRetriedWithACappedBackOff) {
  Loop loop;
  std::uint16_t port = 0;
  {
    ServerSide s;
    port = TcpServer{loop, {"127.0.0.1", 0}, s.peer()}.port();
  }
  ClientSide c;
  TcpClient client{loop, {"127.0.0.1", port}, c.peer()};
  // The client knows no time but the one it is told, so nobody has to wait for its deadlines here.
  std::vector<double> waits_ms;
  TimePoint now = std::chrono::steady_clock::now();
  for (int i = 0; i < 5; ++i) {
    client.on_deadline(now);
    const TimePoint refused_at = loop.wait(now + 10s);
    ASSERT_EQ(client.last_error(), "Connection refused");
    ASSERT_TRUE(client.deadline().has_value());
    waits_ms.push_back(in_ms(*client.deadline() - refused_at));
    now = *client.deadline();
  }
  EXPECT_EQ(waits_ms, (std::vector<double>{200, 400, 800, 1000, 1000}));
  EXPECT_EQ(c.ups + c.downs, 0);
}

TEST(Tcp, AnAddressThatNeverAnswersIsGivenUpAfterItsTimeOut) {
  // A listener with a full queue drops the greetings of further callers.
  const int listener = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  sockaddr_in at{};
  at.sin_family = AF_INET;
  at.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  ASSERT_EQ(::bind(listener, reinterpret_cast<const sockaddr*>(&at), sizeof at), 0);
  ASSERT_EQ(::listen(listener, 0), 0);
  socklen_t length = sizeof at;
  ASSERT_EQ(::getsockname(listener, reinterpret_cast<sockaddr*>(&at), &length), 0);
  const std::uint16_t port = ntohs(at.sin_port);

  Loop loop;
  ClientSide c;
  TcpClientOptions options;
  options.connect_timeout = 2s;
  std::vector<std::unique_ptr<TcpClient>> clients;
  const TimePoint start = std::chrono::steady_clock::now();
  for (int i = 0; i < 8; ++i) {
    clients.push_back(std::make_unique<TcpClient>(loop, Endpoint{"127.0.0.1", port}, c.peer(), options));
    clients.back()->on_deadline(start);
  }
  loop.wait(start + 20ms);
  loop.wait(start + 40ms);
  TcpClient& last = *clients.back();
  ASSERT_FALSE(last.connected());
  last.on_deadline(start + 1999ms);
  EXPECT_TRUE(last.last_error().empty());
  last.on_deadline(start + 2s);
  EXPECT_EQ(last.last_error(), "no answer within 2000 ms");
  EXPECT_EQ(last.deadline(), start + 2200ms);
  ::close(listener);
}

TEST(Tcp, TheSessionIsToldOfAClosedConnectionAndTheLinkComesBack) {
  Loop loop;
  ServerSide s;
  TcpServer server{loop, {"127.0.0.1", 0}, s.peer()};
  ClientSide c;
  TcpClientOptions options;
  options.retry_first = 1ms;
  TcpClient client{loop, {"127.0.0.1", server.port()}, c.peer(), options};
  ASSERT_TRUE(pump_until(
      loop, [&] { return !s.open.empty(); }, client, server));
  server.close(*s.open.begin(), std::chrono::steady_clock::now());
  ASSERT_TRUE(pump_until(
      loop, [&] { return c.ups == 2 && s.order.size() == 3; }, client, server));
  EXPECT_EQ(c.downs, 1);
  EXPECT_EQ(s.order, (std::vector<std::string>{"+1", "-1", "+2"}));
  client.reopen(std::chrono::steady_clock::now());
  EXPECT_EQ(c.downs, 2);
  ASSERT_TRUE(pump_until(
      loop, [&] { return c.ups == 3 && s.order.size() == 5; }, client, server));
}

TEST(Tcp, APeerThatIsRefusedAgainAndAgainIsCalledLessOften) {
  Loop loop;
  ServerSide s;
  TcpServer server{loop, {"127.0.0.1", 0}, s.peer()};
  ClientSide c;
  TcpClientOptions options;
  options.retry_first = 1ms;
  options.retry_max = 8ms;
  TcpClient client{loop, {"127.0.0.1", server.port()}, c.peer(), options};
  for (const auto pause : {1ms, 2ms, 4ms, 8ms, 8ms}) {
    const int ups = c.ups;
    ASSERT_TRUE(pump_until(
        loop, [&] { return c.ups > ups; }, client, server));
    const auto now = std::chrono::steady_clock::now();
    client.reopen(now);
    EXPECT_EQ(client.deadline(), now + pause);
  }
  // One that stood for a while is called at once again.
  ASSERT_TRUE(pump_until(
      loop, [&] { return client.connected(); }, client, server));
  const auto later = std::chrono::steady_clock::now() + 6s;
  client.reopen(later);
  EXPECT_EQ(client.deadline(), later + 1ms);
}

TEST(Tcp, OutputOfABrokenConnectionIsNotSentOnTheNext) {
  Loop loop;
  ServerSide s;
  TcpServer server{loop, {"127.0.0.1", 0}, s.peer()};
  ClientSide c;
  TcpClientOptions options;
  options.retry_first = 1ms;
  TcpClient client{loop, {"127.0.0.1", server.port()}, c.peer(), options};
  ASSERT_TRUE(pump_until(
      loop, [&] { return !s.open.empty(); }, client, server));
  c.output = pattern(10);
  client.reopen(std::chrono::steady_clock::now());
  ASSERT_TRUE(pump_until(
      loop, [&] { return c.ups == 2 && s.open.contains(2); }, client, server));
  EXPECT_TRUE(s.received[2].empty());
}

TEST(Tcp, AServerThatMayReopenInsideACallbackIsSafe) {
  Loop loop;
  ServerSide s;
  TcpServer server{loop, {"127.0.0.1", 0}, s.peer()};
  ClientSide c;
  TcpClient* link = nullptr;
  StreamPeer peer = c.peer();
  peer.on_bytes = [&](ByteView, TimePoint now) { link->reopen(now); };
  TcpClient client{loop, {"127.0.0.1", server.port()}, peer};
  link = &client;
  ASSERT_TRUE(pump_until(
      loop, [&] { return !s.open.empty(); }, client, server));
  s.output[1] = pattern(5);
  ASSERT_TRUE(pump_until(
      loop, [&] { return c.downs == 1; }, client, server));
}

TEST(Tcp, TheLimitTurnsAwayTheNextCaller) {
  Loop loop;
  ServerSide s;
  TcpServerOptions options;
  options.connections_max = 2;
  int warnings = 0;
  log::set_sink([&](log::Level, std::string_view, std::string_view) { ++warnings; });
  TcpServer server{loop, {"127.0.0.1", 0}, s.peer(), options};
  RawClient a, b, c, d;
  for (const RawClient* raw : {&a, &b, &c, &d}) ASSERT_TRUE(raw->connect_to(server.port()));
  ASSERT_TRUE(pump_until(
      loop, [&] { return c.closed_by_peer() && d.closed_by_peer(); }, server));
  log::set_sink({});
  EXPECT_EQ(server.connections(), 2U);
  EXPECT_EQ(warnings, 1) << "one line for a row of callers";
  EXPECT_FALSE(a.closed_by_peer());
}

TEST(Tcp, WithNewestWinsTheOldestGivesWayButNotToAStranger) {
  Loop loop;
  ServerSide s;
  TcpServerOptions options;
  options.connections_max = 1;
  options.newest_wins = true;
  TcpServer server{loop, {"127.0.0.1", 0}, s.peer(), options};
  RawClient first, stranger, second;
  ASSERT_TRUE(first.connect_to(server.port()));
  ASSERT_TRUE(pump_until(
      loop, [&] { return s.open.contains(1); }, server));
  s.welcome = false;
  ASSERT_TRUE(stranger.connect_to(server.port()));
  ASSERT_TRUE(pump_until(
      loop, [&] { return stranger.closed_by_peer(); }, server));
  EXPECT_TRUE(s.open.contains(1));
  s.welcome = true;
  ASSERT_TRUE(second.connect_to(server.port()));
  ASSERT_TRUE(pump_until(
      loop, [&] { return first.closed_by_peer(); }, server));
  EXPECT_EQ(s.order, (std::vector<std::string>{"+1", "+3", "-1"}));
  EXPECT_EQ(server.connections(), 1U);
}

TEST(Tcp, APeerThatDoesNotReadIsDropped) {
  Loop loop;
  ServerSide s;
  TcpServerOptions options;
  options.unsent_bytes_max = 100'000;
  TcpServer server{loop, {"127.0.0.1", 0}, s.peer(), options};
  RawClient deaf{4096};
  ASSERT_TRUE(deaf.connect_to(server.port()));
  ASSERT_TRUE(pump_until(
      loop, [&] { return s.open.contains(1); }, server));
  for (int i = 0; i < 1000 && s.open.contains(1); ++i) {
    s.output[1] = pattern(50'000);
    server.flush(std::chrono::steady_clock::now());
  }
  EXPECT_FALSE(s.open.contains(1));
}

TEST(Tcp, TheSessionMayWishToClose) {
  Loop loop;
  ServerSide s;
  TcpServer server{loop, {"127.0.0.1", 0}, s.peer()};
  RawClient raw;
  ASSERT_TRUE(raw.connect_to(server.port()));
  ASSERT_TRUE(pump_until(
      loop, [&] { return s.open.contains(1); }, server));
  s.output[1] = pattern(3);
  s.wants_close.insert(1);
  ASSERT_TRUE(pump_until(
      loop, [&] { return s.open.empty(); }, server));
  std::array<char, 8> last{};
  EXPECT_EQ(::recv(raw.fd, last.data(), last.size(), MSG_WAITALL), 3) << "what was said before closing arrives";
}

TEST(Tcp, AListenerThatRunsOutOfDescriptorsDoesNotSpinAndRecovers) {
  Loop loop;
  ServerSide s;
  TcpServer server{loop, {"127.0.0.1", 0}, s.peer()};
  RawClient turned_away, later;
  int errors = 0;
  log::set_sink([&](log::Level, std::string_view, std::string_view) { ++errors; });
  rlimit before{};
  ASSERT_EQ(::getrlimit(RLIMIT_NOFILE, &before), 0);
  const int lowest_free = ::dup(0);
  ::close(lowest_free);
  rlimit none = before;
  none.rlim_cur = static_cast<rlim_t>(lowest_free);
  ASSERT_EQ(::setrlimit(RLIMIT_NOFILE, &none), 0);
  const bool connected = turned_away.connect_to(server.port());
  const TimePoint start = std::chrono::steady_clock::now();
  int wake_ups = 0;
  for (TimePoint now = start; now < start + 30ms; ++wake_ups) now = loop.wait(start + 30ms);
  ::setrlimit(RLIMIT_NOFILE, &before);
  log::set_sink({});
  ASSERT_TRUE(connected);
  EXPECT_LT(wake_ups, 10);
  EXPECT_EQ(errors, 1);
  EXPECT_TRUE(s.open.empty());
  ASSERT_TRUE(later.connect_to(server.port()));
  EXPECT_TRUE(pump_until(
      loop, [&] { return s.open.size() == 1; }, server));
}

TEST(Tcp, ABusyPeerDoesNotKeepAnotherWaiting) {
  Loop loop;
  ServerSide s;
  std::vector<ConnectionId> turns;
  ServerPeer peer = s.peer();
  peer.on_bytes = [&](ConnectionId id, ByteView bytes, TimePoint) {
    EXPECT_LE(bytes.size(), 64U * 1024);
    turns.push_back(id);
  };
  TcpServer server{loop, {"127.0.0.1", 0}, peer};
  RawClient busy, quiet;
  ASSERT_TRUE(busy.connect_to(server.port()));
  ASSERT_TRUE(quiet.connect_to(server.port()));
  ASSERT_TRUE(pump_until(
      loop, [&] { return s.open.size() == 2; }, server));
  const Bytes flood = pattern(1 << 20);
  ASSERT_GT(::send(busy.fd, flood.data(), flood.size(), MSG_DONTWAIT), 64 * 1024);
  ASSERT_EQ(::send(quiet.fd, flood.data(), 1, 0), 1);
  loop.wait(std::chrono::steady_clock::now() + 1s);
  EXPECT_EQ(turns, (std::vector<ConnectionId>{1, 2}));
}

TEST(Tcp, ListeningTwiceOnOnePortSaysWhichAndWhy) {
  Loop loop;
  ServerSide s;
  TcpServer server{loop, {"127.0.0.1", 0}, s.peer()};
  try {
    TcpServer second{loop, {"127.0.0.1", server.port()}, s.peer()};
    FAIL() << "no exception";
  } catch (const std::runtime_error& error) {
    EXPECT_EQ(std::string(error.what()),
              "cannot listen on 127.0.0.1:" + std::to_string(server.port()) +
                  ": Address already in use; end the program that has it (ss -lntup tells), or use another port");
  }
}

TEST(Tcp, AnAddressOfAnotherMachineSaysWhatToDo) {
  Loop loop;
  ServerSide s;
  try {
    TcpServer server{loop, {"192.0.2.1", 0}, s.peer()};
    FAIL() << "no exception";
  } catch (const std::runtime_error& error) {
    EXPECT_EQ(std::string(error.what()),
              "cannot listen on 192.0.2.1:0: Cannot assign requested address; this machine has no such address (ip "
              "address tells), use one that it has or 0.0.0.0");
  }
}

TEST(Tcp, AcceptedSocketsAreGuardedAgainstDeadPeersAndNagle) {
  Loop loop;
  ServerSide s;
  TcpServer server{loop, {"127.0.0.1", 0}, s.peer()};
  ClientSide c;
  const int below = ::dup(0);
  ::close(below);
  TcpClient client{loop, {"127.0.0.1", server.port()}, c.peer()};
  ASSERT_TRUE(pump_until(
      loop, [&] { return client.connected() && !s.open.empty(); }, client, server));
  int sockets = 0;
  for (int fd = below; fd < below + 2; ++fd) {  // the client's and the accepted one: the two newest descriptors
    EXPECT_EQ(option(fd, IPPROTO_TCP, TCP_NODELAY), 1);
    EXPECT_EQ(option(fd, SOL_SOCKET, SO_KEEPALIVE), 1);
    EXPECT_EQ(option(fd, IPPROTO_TCP, TCP_USER_TIMEOUT), 3000);
    EXPECT_EQ(::fcntl(fd, F_GETFD) & FD_CLOEXEC, FD_CLOEXEC);
    ++sockets;
  }
  EXPECT_EQ(sockets, 2);
}
}  // namespace binpick::drivers::link
