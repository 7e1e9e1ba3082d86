#include "drivers/link/udp_link.hpp"

#include <array>
#include <cerrno>
#include <stdexcept>
#include <sys/epoll.h>
#include <system_error>
#include <unistd.h>

#include "base/log.hpp"
#include "drivers/link/kernel_time.hpp"

namespace binpick::drivers::link {
namespace {
using namespace std::chrono_literals;
constexpr Duration kRetry = 1s;
constexpr int kDatagramsMax = 64;  // per wake-up, so that a flood does not keep the others waiting

std::string error_text(int error) { return std::generic_category().message(error); }
}  // namespace

UdpLink::UdpLink(Loop& loop, Endpoint remote, DatagramPeer peer, std::uint16_t listen_port)
    : loop_{loop}, endpoint_{std::move(remote)}, peer_{std::move(peer)}, listen_port_{listen_port} {}

UdpLink::UdpLink(Loop& loop, const Endpoint& listen, DatagramPeer peer, const char* what)
    : loop_{loop}, endpoint_{listen}, peer_{std::move(peer)}, listen_port_{listen.port}, learns_remote_{true} {
  const auto addresses = resolve(listen.host, listen.port, false, true);
  std::string why = addresses ? "no address" : addresses.error();
  if (!addresses || addresses->empty() || !bind_to(addresses->front(), why))
    throw std::runtime_error(std::string(what) + ": cannot listen on " + to_string(listen) + ": " + why);
}

UdpLink::~UdpLink() {
  if (fd_ < 0) return;
  loop_.forget(fd_);
  ::close(fd_);
}

bool UdpLink::bind_to(const SocketAddress& address, std::string& why) {
  fd_ = ::socket(address.family(), SOCK_DGRAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
  if (fd_ < 0) {
    why = error_text(errno);
    return false;
  }
  const int one = 1;
  ::setsockopt(fd_, SOL_SOCKET, SO_TIMESTAMPNS, &one, sizeof one);  // without it the loop's time stamp serves
  if (::bind(fd_, address.raw(), address.length) != 0) {
    why = no_port_text(errno);
    ::close(fd_);
    fd_ = -1;
    return false;
  }
  loop_.watch(fd_, EPOLLIN, [this](std::uint32_t, TimePoint now) { receive(now); });
  return true;
}

std::uint16_t UdpLink::local_port() const {
  SocketAddress own;
  own.length = sizeof own.storage;
  if (fd_ < 0 || ::getsockname(fd_, own.raw(), &own.length) != 0) return 0;
  return port_of(own);
}

void UdpLink::on_deadline(TimePoint now) {
  if (!deadline_ || now < *deadline_) return;
  deadline_.reset();
  if (learns_remote_) {
    up_ = true;
    if (peer_.on_connected) peer_.on_connected(now);
    return flush(now);
  }
  if (auto numeric = resolve(endpoint_.host, endpoint_.port, true, false); numeric && !numeric->empty()) {
    remote_ = numeric->front();
    return open(now);
  }
  try {
    resolver_ = std::make_unique<Resolver>(loop_, endpoint_.host, endpoint_.port, [this](TimePoint at) {
      const auto addresses = resolver_->take_result();
      resolver_.reset();
      if (!addresses || addresses->empty()) return close(at, addresses ? "host has no address" : addresses.error());
      remote_ = addresses->front();
      open(at);
    });
  } catch (const std::system_error& error) {  // out of descriptors or threads: later, perhaps
    close(now, error.what());
  }
}

void UdpLink::open(TimePoint now) {
  SocketAddress local;
  local.storage.ss_family = static_cast<sa_family_t>(remote_->family());
  local.length = remote_->length;  // any address of the peer's family
  if (remote_->family() == AF_INET6)
    reinterpret_cast<sockaddr_in6*>(&local.storage)->sin6_port = htons(listen_port_);
  else
    reinterpret_cast<sockaddr_in*>(&local.storage)->sin_port = htons(listen_port_);
  std::string why;
  if (!bind_to(local, why))
    return close(now, "own UDP port " + std::to_string(listen_port_) + " (listen_port in the cell file): " + why);
  up_ = true;
  last_why_.clear();
  if (peer_.on_connected) peer_.on_connected(now);
  flush(now);
}

void UdpLink::reopen(TimePoint now) { close(now, kClosedByUs); }

void UdpLink::close(TimePoint now, const std::string& why) {
  resolver_.reset();
  if (fd_ >= 0) {
    loop_.forget(fd_);
    ::close(fd_);
    fd_ = -1;
  }
  const bool news = up_ || why != last_why_;
  up_ = false;
  last_why_ = why;
  deadline_ = now + kRetry;
  if (!news) return;
  if (peer_.on_disconnected) peer_.on_disconnected(why, now);
  if (peer_.take_frames) peer_.take_frames();  // meant for a socket that is gone
}

void UdpLink::receive(TimePoint now) {
  for (int i = 0; i < kDatagramsMax && fd_ >= 0; ++i) {
    std::array<std::byte, 2048> bytes;
    alignas(cmsghdr) std::array<char, 128> control;
    SocketAddress from;
    iovec part{bytes.data(), bytes.size()};
    msghdr message{};
    message.msg_name = &from.storage;
    message.msg_namelen = sizeof from.storage;
    message.msg_iov = &part;
    message.msg_iovlen = 1;
    message.msg_control = control.data();
    message.msg_controllen = control.size();
    const ssize_t n = ::recvmsg(fd_, &message, 0);
    if (n < 0 && (errno == EINTR || errno == ECONNREFUSED)) continue;  // refused: the peer is not there yet
    if (n < 0) break;
    from.length = message.msg_namelen;
    if (!is_from_peer(from)) continue;
    if ((message.msg_flags & MSG_TRUNC) != 0) {
      if (counters_.cut++ == 0)
        BINPICK_LOG(Warning, "udp", "datagrams of more than %zu bytes from %s are dropped", bytes.size(),
                    address_text(from).c_str());
      continue;
    }
    if (peer_.on_frame) peer_.on_frame(ByteView{bytes.data(), static_cast<std::size_t>(n)}, received_at(message, now));
  }
  flush(now);
}

bool UdpLink::is_from_peer(const SocketAddress& from) {
  if (learns_remote_) {
    const bool is_other =
        !remote_ || port_of(*remote_) != port_of(from) || address_text(*remote_) != address_text(from);
    remote_ = from;
    if (is_other && peer_.on_other_peer) peer_.on_other_peer();
    return true;
  }
  if (address_text(from) == address_text(*remote_)) return true;
  if (counters_.strangers++ == 0)
    BINPICK_LOG(Warning, "udp", "datagrams from %s are dropped: only %s is heard", address_text(from).c_str(),
                to_string(endpoint_).c_str());
  return false;
}

void UdpLink::flush(TimePoint now) {
  if (!peer_.take_frames) return;
  const std::vector<Bytes> frames = peer_.take_frames();
  if (!remote_) return;  // nobody to send them to
  for (const Bytes& frame : frames) {
    if (!up_ || send(frame)) continue;
    ++counters_.unsent;  // as lost as on any network; the session repeats what matters
    if (errno != EAGAIN && errno != ENOBUFS && errno != ENETUNREACH && errno != EHOSTUNREACH && errno != EPERM)
      close(now, error_text(errno));
  }
}

bool UdpLink::send(const Bytes& datagram) {
  ssize_t n = 0;
  do {
    n = ::sendto(fd_, datagram.data(), datagram.size(), MSG_DONTWAIT, remote_->raw(), remote_->length);
  } while (n < 0 && errno == EINTR);
  return n >= 0 || errno == ECONNREFUSED;
}
}  // namespace binpick::drivers::link
