#include <algorithm>
#include <array>
#include <cerrno>
#include <cmath>
#include <sys/epoll.h>
#include <system_error>
#include <unistd.h>

#include "drivers/link/socket.hpp"
#include "drivers/link/tcp.hpp"

namespace binpick::drivers::link {
namespace {
constexpr Duration kStood = std::chrono::seconds(5);

std::string error_text(int error) { return std::generic_category().message(error); }

/// On loopback the kernel may join a connecting socket with itself when its own port is the one asked for.
bool talks_to_itself(int fd) {
  SocketAddress own, other;
  own.length = other.length = sizeof(sockaddr_storage);
  return ::getsockname(fd, own.raw(), &own.length) == 0 && ::getpeername(fd, other.raw(), &other.length) == 0 &&
         port_of(own) == port_of(other) && address_text(own) == address_text(other);
}
}  // namespace

TcpClient::TcpClient(Loop& loop, Endpoint endpoint, StreamPeer peer, TcpClientOptions options)
    : loop_{loop},
      endpoint_{std::move(endpoint)},
      peer_{std::move(peer)},
      options_{options},
      retry_{options.retry_first} {}

TcpClient::~TcpClient() {
  if (fd_ < 0) return;
  loop_.forget(fd_);
  ::close(fd_);
}

std::optional<TimePoint> TcpClient::deadline() const { return deadline_; }
bool TcpClient::connected() const { return state_ == State::Connected; }
std::string TcpClient::last_error() const { return last_error_; }

void TcpClient::on_deadline(TimePoint now) {
  if (!deadline_ || now < *deadline_) return;
  if (state_ == State::Waiting) return start(now);
  drop(now, state_ == State::Resolving
                ? "no answer from the name server for \"" + endpoint_.host + "\""
                : "no answer within " + std::to_string(std::lround(in_ms(options_.connect_timeout))) + " ms");
}

void TcpClient::start(TimePoint now) {
  deadline_ = now + options_.connect_timeout;
  const auto numeric = resolve(endpoint_.host.empty() ? "127.0.0.1" : endpoint_.host, endpoint_.port, true, false);
  if (numeric && !numeric->empty()) return connect_to(numeric->front(), now);
  state_ = State::Resolving;
  try {
    resolver_ =
        std::make_unique<Resolver>(loop_, endpoint_.host, endpoint_.port, [this](TimePoint at) { on_resolved(at); });
  } catch (const std::system_error& error) {  // out of descriptors or threads: later, perhaps
    drop(now, error.what());
  }
}

void TcpClient::on_resolved(TimePoint now) {
  const auto addresses = resolver_->take_result();
  resolver_.reset();
  if (!addresses) return drop(now, addresses.error());
  connect_to((*addresses)[attempts_++ % addresses->size()], now);
}

void TcpClient::connect_to(const SocketAddress& address, TimePoint now) {
  fd_ = ::socket(address.family(), SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, IPPROTO_TCP);
  if (fd_ < 0) return drop(now, error_text(errno));
  set_stream_options(fd_);
  if (::connect(fd_, address.raw(), address.length) != 0 && errno != EINPROGRESS && errno != EINTR)
    return drop(now, error_text(errno));
  state_ = State::Connecting;
  loop_.watch(fd_, EPOLLOUT, [this](std::uint32_t events, TimePoint at) { on_event(events, at); });
}

void TcpClient::on_connect_done(TimePoint now) {
  int error = 0;
  socklen_t length = sizeof error;
  if (::getsockopt(fd_, SOL_SOCKET, SO_ERROR, &error, &length) != 0) error = errno;
  if (error != 0) return drop(now, error_text(error));
  if (talks_to_itself(fd_)) return drop(now, error_text(ECONNREFUSED));
  state_ = State::Connected;
  deadline_.reset();
  connected_at_ = now;
  last_error_.clear();
  wants_write_ = false;
  loop_.change(fd_, EPOLLIN | EPOLLRDHUP);
  if (peer_.on_connected) peer_.on_connected(now);
  flush(now);
}

void TcpClient::drop(TimePoint now, const std::string& why) {
  const bool was_connected = state_ == State::Connected;
  if (fd_ >= 0) {
    loop_.forget(fd_);
    ::close(fd_);
  }
  fd_ = -1;
  resolver_.reset();
  unsent_.clear();
  state_ = State::Waiting;
  last_error_ = why;
  // A peer that is reached and refused, or that hangs up at once, is no better than one that is not there.
  if (was_connected && now - connected_at_ >= kStood) retry_ = options_.retry_first;
  deadline_ = now + retry_;
  retry_ = std::min(2 * retry_, options_.retry_max);
  if (!was_connected) return;
  if (peer_.on_disconnected) peer_.on_disconnected(now);
  if (peer_.take_output) peer_.take_output();  // meant for a connection that is gone
}

void TcpClient::reopen(TimePoint now) { drop(now, kClosedByUs); }

void TcpClient::on_event(std::uint32_t events, TimePoint now) {
  if (state_ == State::Connecting) return on_connect_done(now);
  const int fd = fd_;
  if ((events & (EPOLLIN | EPOLLRDHUP | EPOLLHUP | EPOLLERR)) != 0) receive(now);
  if (fd_ == fd && state_ == State::Connected && (events & EPOLLOUT) != 0) flush(now);
}

void TcpClient::receive(TimePoint now) {
  std::array<std::byte, kReadBytesMax> chunk;
  ssize_t n = 0;
  do {
    n = ::recv(fd_, chunk.data(), chunk.size(), 0);
  } while (n < 0 && errno == EINTR);
  if (n < 0 && (errno == EAGAIN || errno == EWOULDBLOCK)) return;
  if (n <= 0) return drop(now, n == 0 ? "closed by the peer" : error_text(errno));
  if (peer_.on_bytes) peer_.on_bytes(ByteView{chunk.data(), static_cast<std::size_t>(n)}, now);
  flush(now);
}

void TcpClient::flush(TimePoint now) {
  if (state_ != State::Connected) return;
  if (peer_.take_output) append(unsent_, peer_.take_output());
  const Sent outcome = send_some(fd_, unsent_);
  if (outcome == Sent::Failed) return drop(now, error_text(errno));
  if (unsent_.size() > options_.unsent_bytes_max) return drop(now, "the peer does not read");
  const bool wants_write = !unsent_.empty();
  if (wants_write != wants_write_) loop_.change(fd_, EPOLLIN | EPOLLRDHUP | (wants_write ? EPOLLOUT : 0U));
  wants_write_ = wants_write;
}
}  // namespace binpick::drivers::link
