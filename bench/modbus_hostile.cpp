#include <algorithm>
#include <atomic>
#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <sys/socket.h>
#include <thread>
#include <unistd.h>
#include <vector>

#include "base/log.hpp"
#include "drivers/link/tcp.hpp"
#include "plc/registers.hpp"
#include "plc/session.hpp"

/// A good Modbus peer beside a hostile one, over real sockets: how long does the good one wait for its answers?
/// Usage: modbus_hostile [SECONDS]. The first fifth of the time the good one is alone.
/// The hostile one, at once: one byte per 0.4 s; wrong counts and unknown functions every 5 ms; protocol id 7; floods
/// of pipelined requests; writes as a second writer; 1000 connects in ten bursts.
namespace {
using namespace binpick;
using namespace std::chrono_literals;
namespace link = binpick::drivers::link;
using Clock = std::chrono::steady_clock;

Bytes hex(std::initializer_list<int> values) {
  Bytes out;
  for (const int v : values) out.push_back(static_cast<std::byte>(v));
  return out;
}

/// The server's thread: what the daemon does for the PLC, without devices.
void serve(link::Loop& loop, plc::Session& session, link::TcpServer& server, const std::atomic<bool>& stop) {
  while (!stop) {
    const TimePoint now = loop.wait(session.deadline());
    if (session.deadline() && *session.deadline() <= now) session.on_deadline(now);
    while (session.take_event()) continue;
    server.flush(now);
  }
}

int connect_to(std::uint16_t port, bool blocking) {
  const int fd = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC | (blocking ? 0 : SOCK_NONBLOCK), 0);
  if (fd < 0) return -1;
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(port);
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  const int one = 1;
  setsockopt(fd, IPPROTO_TCP, TCP_NODELAY, &one, sizeof one);
  if (connect(fd, reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0 && errno != EINPROGRESS) {
    close(fd);
    return -1;
  }
  return fd;
}

void wait_until(TimePoint at) {
  const auto left = std::chrono::duration_cast<std::chrono::microseconds>(at - Clock::now());
  const timespec span{left.count() / 1'000'000, (left.count() % 1'000'000) * 1000};
  if (left.count() > 0) ppoll(nullptr, 0, &span, nullptr);
}

/// Sends one request and waits for its whole answer; the time it took, or a negative one when the line broke.
double round_trip_ms(int fd, const Bytes& request, std::size_t answer_bytes) {
  const auto begin = Clock::now();
  if (send(fd, request.data(), request.size(), MSG_NOSIGNAL) != static_cast<ssize_t>(request.size())) return -1;
  std::array<std::byte, 300> answer{};
  if (recv(fd, answer.data(), answer_bytes, MSG_WAITALL) != static_cast<ssize_t>(answer_bytes)) return -1;
  return in_ms(Clock::now() - begin);
}

struct Hostile {
  std::uint16_t port;
  unsigned connects = 0, frames = 0, dripped = 0;

  void run(TimePoint begin, Duration duration, const std::atomic<bool>& stop) {
    const std::vector<Bytes> bad{
        hex({0, 1, 0, 0, 0, 6, 255, 3, 0, 0, 0, 126}),
        hex({0, 1, 0, 0, 0, 11, 255, 16, 0, 0, 0, 9, 4, 0, 0, 0, 0}),
        hex({0, 1, 0, 0, 0, 2, 255, 7}),
        hex({0, 1, 0, 0, 0, 5, 255, 43, 14, 1, 0}),
        hex({0, 1, 0, 0, 0, 6, 255, 6, 0, 7, 0, 1}),  // a second writer
        hex({0, 1, 0, 7, 0, 6, 255, 3, 0, 14, 0, 1}),
        hex({0, 1, 0, 0, 0xFF, 0xFF, 255, 3}),
    };
    Bytes flood;
    for (int i = 0; i < 300; ++i) append(flood, hex({0, 1, 0, 0, 0, 6, 255, 3, 0, 8, 0, 74}));
    int drip = -1;
    int abuse = -1;
    std::vector<int> burst;
    std::size_t drip_at = 0;
    std::size_t turn = 0;
    TimePoint next_drip = begin;
    TimePoint next_burst = begin;
    for (TimePoint at = begin; !stop; at += 5ms) {
      wait_until(at);
      if (at >= next_drip) {
        next_drip = at + 400ms;
        const Bytes& frame = bad[0];
        if (drip < 0) drip = connect_to(port, false), drip_at = 0;
        if (drip >= 0 && send(drip, &frame[drip_at], 1, MSG_NOSIGNAL) != 1 && errno != EAGAIN) close(drip), drip = -1;
        drip_at = (drip_at + 1) % frame.size();
        ++dripped;
      }
      if (abuse < 0) abuse = connect_to(port, false), ++connects;
      if (abuse >= 0) {
        const Bytes& frame = ++turn % 50 == 0 ? flood : bad[turn % bad.size()];
        if (send(abuse, frame.data(), frame.size(), MSG_NOSIGNAL) < 0 && errno != EAGAIN && errno != ENOTCONN)
          close(abuse), abuse = -1;
        ++frames;
        std::array<std::byte, 4096> ignored{};
        if (abuse >= 0 && recv(abuse, ignored.data(), ignored.size(), MSG_DONTWAIT) == 0) close(abuse), abuse = -1;
      }
      if (at >= next_burst) {
        next_burst = at + duration / 10;
        for (const int fd : burst) close(fd);
        burst.clear();
        for (int i = 0; i < 100; ++i)
          if (const int fd = connect_to(port, false); fd >= 0) burst.push_back(fd), ++connects;
      }
    }
    for (const int fd : burst) close(fd);
    if (drip >= 0) close(drip);
    if (abuse >= 0) close(abuse);
  }
};

void print(const char* what, std::vector<double>& times_ms) {
  std::ranges::sort(times_ms);
  const auto at = [&](double share) {
    return times_ms[std::min(times_ms.size() - 1,
                             static_cast<std::size_t>(share * static_cast<double>(times_ms.size())))];
  };
  std::printf("%-28s %6zu answers  p50 %7.3f ms  p99 %7.3f ms  max %7.3f ms\n", what, times_ms.size(), at(0.5),
              at(0.99), times_ms.back());
}

int bench(double seconds) {
  plc::Options options;
  options.part_ids = options.supply_ids = {1};
  plc::Session session{options, 1};
  link::Loop loop;
  link::TcpServer server{loop,
                         {"127.0.0.1", 0},
                         {.on_accept = [&](auto id, const std::string& address, std::uint16_t from,
                                           TimePoint now) { return session.on_accept(id, address, from, now); },
                          .on_bytes = [&](auto id, ByteView bytes, TimePoint now) { session.on_bytes(id, bytes, now); },
                          .on_closed = [&](auto id, TimePoint now) { session.on_closed(id, now); },
                          .take_output = [&](auto id) { return session.take_output(id); },
                          .wants_close = [&](auto id) { return session.wants_close(id); }}};
  std::atomic<bool> stop = false;
  std::thread server_thread{[&] { serve(loop, session, server, stop); }};

  const Bytes write = hex({0, 2, 0, 0, 0, 23, 255, 16, 0, 0, 0, 8, 16, 0, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 8});
  const Bytes read = hex({0, 1, 0, 0, 0, 6, 255, 3, 0, 8, 0, 74});
  const int good = connect_to(server.port(), true);
  std::vector<double> alone_ms, beside_ms;
  const TimePoint begin = Clock::now();
  const TimePoint hostile_from = begin + from_s(seconds / 5);
  const TimePoint end = begin + from_s(seconds);
  Hostile hostile{server.port()};
  std::thread hostile_thread{[&] {
    wait_until(hostile_from);
    hostile.run(hostile_from, end - hostile_from, stop);
  }};
  bool broken = good < 0;
  for (TimePoint at = begin; at < end && !broken; at += 20ms) {
    wait_until(at);
    auto& times_ms = at < hostile_from ? alone_ms : beside_ms;
    for (const double ms : {round_trip_ms(good, write, 12), round_trip_ms(good, read, 9 + 2 * 74)}) {
      broken = broken || ms < 0;
      times_ms.push_back(ms);
    }
  }
  stop = true;
  loop.wake();
  hostile_thread.join();
  server_thread.join();
  if (good >= 0) close(good);
  if (broken || alone_ms.empty() || beside_ms.empty()) {
    std::fprintf(stderr, "modbus_hostile: the good peer's line broke: %s\n", std::strerror(errno));
    return 1;
  }
  print("good peer alone", alone_ms);
  print("good peer beside hostile one", beside_ms);
  std::printf("hostile peer: %u connects, %u bad or flooding sends, %u single bytes\n", hostile.connects,
              hostile.frames, hostile.dripped);
  return 0;
}
}  // namespace

int main(int argc, char** argv) {
  const double seconds = argc > 1 ? std::strtod(argv[1], nullptr) : 60;
  if (seconds < 1) {
    std::fprintf(stderr, "usage: modbus_hostile [SECONDS]\n");
    return 2;
  }
  log::set_threshold(log::Level::Error);
  return bench(seconds);
}
