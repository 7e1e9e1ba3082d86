#include "drivers/link/socket.hpp"

#include <arpa/inet.h>
#include <cerrno>
#include <charconv>
#include <cstring>
#include <mutex>
#include <netdb.h>
#include <netinet/tcp.h>
#include <sys/epoll.h>
#include <sys/eventfd.h>
#include <system_error>
#include <thread>
#include <unistd.h>

#include "drivers/link/tcp.hpp"

namespace binpick::drivers::link {
std::string to_string(const Endpoint& endpoint) {
  const bool v6 = endpoint.host.find(':') != std::string::npos;
  return (v6 ? "[" + endpoint.host + "]" : endpoint.host) + ":" + std::to_string(endpoint.port);
}

Expected<Endpoint, std::string> parse_endpoint(std::string_view text) {
  const auto wrong = [&](const std::string& why) {
    return unexpected("\"" + std::string(text) + "\": " + why + "; write HOST:PORT or [IPv6]:PORT");
  };
  const std::size_t colon = text.rfind(':');
  if (colon == std::string_view::npos) return wrong("the port is missing");
  std::string_view host = text.substr(0, colon);
  const std::string_view port = text.substr(colon + 1);
  if (!host.empty() && host.front() == '[') {
    if (host.size() < 3 || host.back() != ']') return wrong("the closing bracket is missing");
    host = host.substr(1, host.size() - 2);
  } else if (host.find(':') != std::string_view::npos) {
    return wrong("an IPv6 address needs brackets");
  }
  for (const char c : host)
    if (static_cast<unsigned char>(c) <= ' ') return wrong("there is a blank in the host");
  Endpoint endpoint{std::string(host), 0};
  const auto [end, error] = std::from_chars(port.data(), port.data() + port.size(), endpoint.port);
  if (port.empty() || error != std::errc{} || end != port.data() + port.size())
    return wrong("the port has to be 0 … 65535");
  return endpoint;
}

std::string address_text(const SocketAddress& address) {
  char text[INET6_ADDRSTRLEN] = "?";
  if (address.family() == AF_INET) {
    ::inet_ntop(AF_INET, &reinterpret_cast<const sockaddr_in*>(&address.storage)->sin_addr, text, sizeof text);
  } else if (address.family() == AF_INET6) {
    const in6_addr& v6 = reinterpret_cast<const sockaddr_in6*>(&address.storage)->sin6_addr;
    if (IN6_IS_ADDR_V4MAPPED(&v6))
      ::inet_ntop(AF_INET, &v6.s6_addr[12], text, sizeof text);
    else
      ::inet_ntop(AF_INET6, &v6, text, sizeof text);
  }
  return text;
}

std::uint16_t port_of(const SocketAddress& address) {
  if (address.family() == AF_INET) return ntohs(reinterpret_cast<const sockaddr_in*>(&address.storage)->sin_port);
  if (address.family() == AF_INET6) return ntohs(reinterpret_cast<const sockaddr_in6*>(&address.storage)->sin6_port);
  return 0;
}

Expected<std::vector<SocketAddress>, std::string> resolve(const std::string& host, std::uint16_t port,
                                                          bool numeric_only, bool passive) {
  addrinfo hints{};
  hints.ai_family = AF_UNSPEC;
  hints.ai_socktype = SOCK_STREAM;
  hints.ai_flags = AI_NUMERICSERV | (numeric_only ? AI_NUMERICHOST : 0) | (passive ? AI_PASSIVE : 0);
  addrinfo* list = nullptr;
  const int status = ::getaddrinfo(host.empty() ? nullptr : host.c_str(), std::to_string(port).c_str(), &hints, &list);
  if (status != 0) return unexpected("cannot resolve \"" + host + "\": " + ::gai_strerror(status));
  std::vector<SocketAddress> addresses;
  for (const addrinfo* item = list; item != nullptr; item = item->ai_next) {
    SocketAddress& address = addresses.emplace_back();
    std::memcpy(&address.storage, item->ai_addr, item->ai_addrlen);
    address.length = item->ai_addrlen;
  }
  ::freeaddrinfo(list);
  return addresses;
}

struct Resolver::Shared {
  int done_fd = -1;
  std::mutex mutex;
  Expected<std::vector<SocketAddress>, std::string> result{tl::unexpect, "not resolved yet"};
  ~Shared() {
    if (done_fd >= 0) ::close(done_fd);
  }
};

Resolver::Resolver(Loop& loop, const std::string& host, std::uint16_t port, std::function<void(TimePoint)> on_done)
    : loop_{loop}, shared_{std::make_shared<Shared>()} {
  shared_->done_fd = ::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
  if (shared_->done_fd < 0) throw std::system_error(errno, std::generic_category(), "resolver: eventfd");
  loop_.watch(shared_->done_fd, EPOLLIN, [done = std::move(on_done)](std::uint32_t, TimePoint now) { done(now); });
  std::thread([shared = shared_, host, port] {
    auto result = resolve(host, port, false, false);
    {
      const std::lock_guard lock{shared->mutex};
      shared->result = std::move(result);
    }
    const std::uint64_t one = 1;
    while (::write(shared->done_fd, &one, sizeof one) < 0 && errno == EINTR) continue;
  }).detach();
}

Resolver::~Resolver() { loop_.forget(shared_->done_fd); }

Expected<std::vector<SocketAddress>, std::string> Resolver::take_result() {
  const std::lock_guard lock{shared_->mutex};
  return std::move(shared_->result);
}

std::string no_port_text(int error) {
  const std::string why = std::generic_category().message(error);
  switch (error) {
    case EADDRINUSE:
      return why + "; end the program that has it (ss -lntup tells), or use another port";
    case EADDRNOTAVAIL:
      return why + "; this machine has no such address (ip address tells), use one that it has or 0.0.0.0";
    case EACCES:
      return why +
             "; ports below 1024 need the capability that the service has, use one above or run it as the service";
    default:
      return why;
  }
}

void set_stream_options(int fd) {
  const auto set = [fd](int level, int option, int value) { ::setsockopt(fd, level, option, &value, sizeof value); };
  set(IPPROTO_TCP, TCP_NODELAY, 1);
  set(SOL_SOCKET, SO_KEEPALIVE, 1);
  set(IPPROTO_TCP, TCP_KEEPIDLE, 1);
  set(IPPROTO_TCP, TCP_KEEPINTVL, 1);
  set(IPPROTO_TCP, TCP_KEEPCNT, 2);
  set(IPPROTO_TCP, TCP_USER_TIMEOUT, 3000);
}

Sent send_some(int fd, Bytes& unsent) {
  std::size_t sent = 0;
  Sent outcome = Sent::All;
  while (sent < unsent.size()) {
    const ssize_t n = ::send(fd, unsent.data() + sent, unsent.size() - sent, MSG_NOSIGNAL | MSG_DONTWAIT);
    if (n >= 0) {
      sent += static_cast<std::size_t>(n);
    } else if (errno != EINTR) {
      outcome = errno == EAGAIN || errno == EWOULDBLOCK ? Sent::Some : Sent::Failed;
      break;
    }
  }
  const int why = errno;
  unsent.erase(unsent.begin(), unsent.begin() + static_cast<std::ptrdiff_t>(sent));
  errno = why;
  return outcome;
}
}  // namespace binpick::drivers::link
