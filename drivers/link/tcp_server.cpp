#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <fcntl.h>
#include <stdexcept>
#include <sys/epoll.h>
#include <system_error>
#include <unistd.h>
#include <vector>

#include "base/log.hpp"
#include "drivers/link/socket.hpp"
#include "drivers/link/tcp.hpp"

namespace binpick::drivers::link {
namespace {
/// Strangers taken per wake-up, so that a flood of them does not keep the others waiting.
constexpr int kAcceptsMax = 16;
constexpr Duration kAcceptPause = std::chrono::milliseconds(100);

int listen_on(const SocketAddress& address) {
  const int fd = ::socket(address.family(), SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, IPPROTO_TCP);
  if (fd < 0) return -1;
  const int on = 1, off = 0;
  ::setsockopt(fd, SOL_SOCKET, SO_REUSEADDR, &on, sizeof on);
  if (address.family() == AF_INET6) ::setsockopt(fd, IPPROTO_IPV6, IPV6_V6ONLY, &off, sizeof off);
  if (::bind(fd, address.raw(), address.length) == 0 && ::listen(fd, 128) == 0) return fd;
  const int why = errno;
  ::close(fd);
  errno = why;
  return -1;
}

int open_spare() { return ::open("/dev/null", O_RDONLY | O_CLOEXEC); }
}  // namespace

TcpServer::TcpServer(Loop& loop, const Endpoint& listen, ServerPeer peer, TcpServerOptions options)
    : loop_{loop}, peer_{std::move(peer)}, options_{options} {
  auto addresses = resolve(listen.host, listen.port, false, true);
  if (!addresses) throw std::runtime_error("cannot listen on " + to_string(listen) + ": " + addresses.error());
  // IPv6 first where both are meant: such a socket takes IPv4 callers too.
  std::stable_partition(addresses->begin(), addresses->end(),
                        [](const SocketAddress& a) { return a.family() == AF_INET6; });
  int why = 0;
  for (const SocketAddress& address : *addresses) {
    listen_fd_ = listen_on(address);
    if (listen_fd_ >= 0) break;
    why = errno;
  }
  if (listen_fd_ < 0) throw std::runtime_error("cannot listen on " + to_string(listen) + ": " + no_port_text(why));
  spare_fd_ = open_spare();
  loop_.watch(listen_fd_, EPOLLIN, [this](std::uint32_t, TimePoint now) { accept_all(now); });
}

TcpServer::~TcpServer() {
  for (auto& [id, connection] : connections_) {
    loop_.forget(connection.fd);
    ::close(connection.fd);
  }
  loop_.forget(listen_fd_);
  ::close(listen_fd_);
  if (spare_fd_ >= 0) ::close(spare_fd_);
}

std::uint16_t TcpServer::port() const {
  SocketAddress own;
  own.length = sizeof own.storage;
  return ::getsockname(listen_fd_, own.raw(), &own.length) == 0 ? port_of(own) : std::uint16_t{0};
}

std::size_t TcpServer::connections() const { return connections_.size(); }

void TcpServer::accept_all(TimePoint now) {
  for (int i = 0; i < kAcceptsMax; ++i)
    if (!accept_one(now)) return;
}

bool TcpServer::accept_one(TimePoint now) {
  SocketAddress from;
  from.length = sizeof from.storage;
  const int fd = ::accept4(listen_fd_, from.raw(), &from.length, SOCK_NONBLOCK | SOCK_CLOEXEC);
  if (fd < 0) {
    if (errno == EMFILE || errno == ENFILE || errno == ENOBUFS || errno == ENOMEM) refuse_one(now);
    // What a caller did wrong before it was accepted (ECONNABORTED and the network's errors) is no reason to stop.
    return errno == EINTR || errno == ECONNABORTED || errno == EPROTO;
  }
  starved_logged_ = false;
  set_stream_options(fd);
  const bool full = connections_.size() >= options_.connections_max;
  if (full && !options_.newest_wins) {
    if (!full_logged_)
      BINPICK_LOG(Warning, "tcp", "port %u: %zu connections are the limit, %s is turned away; close one of them",
                  port(), options_.connections_max, address_text(from).c_str());
    full_logged_ = true;
    ::close(fd);
    return true;
  }
  const ConnectionId id = next_id_++;
  if (peer_.on_accept && !peer_.on_accept(id, address_text(from), port_of(from), now)) {
    ::close(fd);
    return true;
  }
  if (full) close(connections_.begin()->first, now);
  connections_.emplace(id, Connection{fd, {}, false});
  loop_.watch(fd, EPOLLIN | EPOLLRDHUP, [this, id](std::uint32_t events, TimePoint at) { on_event(id, events, at); });
  flush(id, now);
  return true;
}

/// Out of descriptors: the caller would stay in the queue and wake the loop for ever. It is taken on the spare one and
/// turned away; where that fails too, nobody is accepted for a moment.
void TcpServer::refuse_one(TimePoint now) {
  if (!starved_logged_)
    BINPICK_LOG(Error, "tcp", "port %u: no descriptor for a new connection (%s); raise LimitNOFILE", port(),
                std::strerror(errno));
  starved_logged_ = true;
  if (spare_fd_ >= 0) ::close(spare_fd_);
  const int fd = ::accept4(listen_fd_, nullptr, nullptr, SOCK_CLOEXEC);
  if (fd >= 0) ::close(fd);
  spare_fd_ = open_spare();
  accept_paused_until_ = now + kAcceptPause;
  loop_.change(listen_fd_, 0);
  errno = EMFILE;
}

void TcpServer::close(ConnectionId id, TimePoint now) {
  const auto found = connections_.find(id);
  if (found == connections_.end()) return;
  loop_.forget(found->second.fd);
  ::close(found->second.fd);
  connections_.erase(found);
  full_logged_ = false;
  if (peer_.on_closed) peer_.on_closed(id, now);
}

void TcpServer::on_event(ConnectionId id, std::uint32_t events, TimePoint now) {
  if ((events & (EPOLLIN | EPOLLRDHUP | EPOLLHUP | EPOLLERR)) != 0) receive(id, now);
  if ((events & EPOLLOUT) != 0) flush(id, now);
}

void TcpServer::receive(ConnectionId id, TimePoint now) {
  const auto found = connections_.find(id);
  if (found == connections_.end()) return;
  std::array<std::byte, kReadBytesMax> chunk;
  ssize_t n = 0;
  do {
    n = ::recv(found->second.fd, chunk.data(), chunk.size(), 0);
  } while (n < 0 && errno == EINTR);
  if (n < 0 && (errno == EAGAIN || errno == EWOULDBLOCK)) return;
  if (n <= 0) return close(id, now);
  if (peer_.on_bytes) peer_.on_bytes(id, ByteView{chunk.data(), static_cast<std::size_t>(n)}, now);
  flush(id, now);
}

void TcpServer::flush(ConnectionId id, TimePoint now) {
  auto found = connections_.find(id);
  if (found == connections_.end()) return;
  const Bytes output = peer_.take_output ? peer_.take_output(id) : Bytes{};
  found = connections_.find(id);  // a callback may have closed it
  if (found == connections_.end()) return;
  Connection& connection = found->second;
  append(connection.unsent, output);
  const Sent outcome = send_some(connection.fd, connection.unsent);
  if (outcome == Sent::Failed || connection.unsent.size() > options_.unsent_bytes_max) return close(id, now);
  const bool wants_write = !connection.unsent.empty();
  if (wants_write != connection.wants_write)
    loop_.change(connection.fd, EPOLLIN | EPOLLRDHUP | (wants_write ? EPOLLOUT : 0U));
  connection.wants_write = wants_write;
  if (peer_.wants_close && peer_.wants_close(id)) close(id, now);
}

void TcpServer::flush(TimePoint now) {
  if (accept_paused_until_ && now >= *accept_paused_until_) {
    accept_paused_until_.reset();
    loop_.change(listen_fd_, EPOLLIN);
  }
  std::vector<ConnectionId> ids;
  ids.reserve(connections_.size());
  for (const auto& [id, connection] : connections_) ids.push_back(id);
  for (const ConnectionId id : ids) flush(id, now);
}
}  // namespace binpick::drivers::link
