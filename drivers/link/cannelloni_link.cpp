#include "drivers/link/cannelloni_link.hpp"

#include <array>
#include <cerrno>
#include <stdexcept>
#include <sys/epoll.h>
#include <system_error>
#include <unistd.h>

#include "base/log.hpp"
#include "drivers/link/cannelloni.hpp"
#include "drivers/link/kernel_time.hpp"

namespace binpick::drivers::link {
namespace {
using namespace std::chrono_literals;
constexpr Duration kRetry = 1s;
constexpr int kDatagramsMax = 64;  // per wake-up, so that a flood does not keep the others waiting

std::string error_text(int error) { return std::generic_category().message(error); }

bool passes(const CanFrame& frame, const std::vector<CanFilter>& filters) {
  if (frame.error || filters.empty()) return true;
  if (frame.extended || frame.rtr) return false;
  for (const CanFilter& filter : filters)
    if ((frame.id & filter.mask) == (filter.id & filter.mask)) return true;
  return false;
}
}  // namespace

CannelloniLink::CannelloniLink(Loop& loop, Endpoint remote, std::vector<CanFilter> filters, CanPeer peer,
                               std::uint16_t listen_port)
    : loop_{loop},
      endpoint_{std::move(remote)},
      filters_{std::move(filters)},
      peer_{std::move(peer)},
      listen_port_{listen_port} {}

CannelloniLink::CannelloniLink(Loop& loop, const Endpoint& listen, CanPeer peer)
    : loop_{loop}, endpoint_{listen}, peer_{std::move(peer)}, listen_port_{listen.port}, learns_remote_{true} {
  const auto addresses = resolve(listen.host, listen.port, false, true);
  std::string why = addresses ? "no address" : addresses.error();
  if (!addresses || addresses->empty() || !bind_to(addresses->front(), why))
    throw std::runtime_error("CAN over UDP: cannot listen on " + to_string(listen) + ": " + why);
}

CannelloniLink::~CannelloniLink() {
  if (fd_ < 0) return;
  loop_.forget(fd_);
  ::close(fd_);
}

bool CannelloniLink::bind_to(const SocketAddress& address, std::string& why) {
  fd_ = ::socket(address.family(), SOCK_DGRAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
  if (fd_ < 0) {
    why = error_text(errno);
    return false;
  }
  const int one = 1;
  ::setsockopt(fd_, SOL_SOCKET, SO_TIMESTAMPNS, &one, sizeof one);  // without it the loop's time stamp serves
  if (::bind(fd_, address.raw(), address.length) != 0) {
    why = error_text(errno);
    ::close(fd_);
    fd_ = -1;
    return false;
  }
  loop_.watch(fd_, EPOLLIN, [this](std::uint32_t, TimePoint now) { receive(now); });
  return true;
}

std::uint16_t CannelloniLink::local_port() const {
  SocketAddress own;
  own.length = sizeof own.storage;
  if (fd_ < 0 || ::getsockname(fd_, own.raw(), &own.length) != 0) return 0;
  return port_of(own);
}

void CannelloniLink::on_deadline(TimePoint now) {
  if (!deadline_ || now < *deadline_) return;
  deadline_.reset();
  if (learns_remote_) {
    up_ = true;
    if (peer_.on_up) peer_.on_up(now);
    return flush(now);
  }
  if (auto numeric = resolve(endpoint_.host, endpoint_.port, true, false); numeric && !numeric->empty()) {
    remote_ = numeric->front();
    return open(now);
  }
  resolver_ = std::make_unique<Resolver>(loop_, endpoint_.host, endpoint_.port, [this](TimePoint at) {
    const auto addresses = resolver_->take_result();
    resolver_.reset();
    if (!addresses || addresses->empty()) return close(at, addresses ? "host has no address" : addresses.error());
    remote_ = addresses->front();
    open(at);
  });
}

void CannelloniLink::open(TimePoint now) {
  SocketAddress local;
  local.storage.ss_family = static_cast<sa_family_t>(remote_->family());
  local.length = remote_->length;  // any address of the peer's family
  if (remote_->family() == AF_INET6)
    reinterpret_cast<sockaddr_in6*>(&local.storage)->sin6_port = htons(listen_port_);
  else
    reinterpret_cast<sockaddr_in*>(&local.storage)->sin_port = htons(listen_port_);
  std::string why;
  if (!bind_to(local, why)) return close(now, "UDP port " + std::to_string(listen_port_) + ": " + why);
  up_ = true;
  last_why_.clear();
  sequence_received_.reset();
  if (peer_.on_up) peer_.on_up(now);
  flush(now);
}

void CannelloniLink::close(TimePoint now, const std::string& why) {
  if (fd_ >= 0) {
    loop_.forget(fd_);
    ::close(fd_);
    fd_ = -1;
  }
  const bool news = up_ || why != last_why_;
  up_ = false;
  last_why_ = why;
  deadline_ = now + kRetry;
  if (news && peer_.on_down) peer_.on_down(why, now);
}

void CannelloniLink::receive(TimePoint now) {
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
    on_datagram(ByteView{bytes.data(), static_cast<std::size_t>(n)}, from, received_at(message, now));
  }
  flush(now);
}

void CannelloniLink::on_datagram(ByteView bytes, const SocketAddress& from, TimePoint received) {
  if (learns_remote_) {
    if (!remote_ || port_of(*remote_) != port_of(from) || address_text(*remote_) != address_text(from))
      sequence_received_.reset();  // another one speaks
    remote_ = from;
  } else if (address_text(from) != address_text(*remote_)) {
    if (counters_.strangers++ == 0)
      BINPICK_LOG(Warning, "can", "datagrams from %s are dropped: the bus is at %s", address_text(from).c_str(),
                  to_string(endpoint_).c_str());
    return;
  }
  const auto datagram = cannelloni::decode(bytes);
  if (!datagram) {
    if (counters_.bad++ == 0)
      BINPICK_LOG(Warning, "can", "bad datagram from %s: %s", address_text(from).c_str(),
                  to_string(datagram.error()).c_str());
    return;
  }
  ++counters_.datagrams;
  if (sequence_received_) counters_.lost += cannelloni::lost_between(*sequence_received_, datagram->sequence);
  sequence_received_ = datagram->sequence;
  counters_.fd_frames += datagram->fd_frames;
  for (const CanFrame& frame : datagram->frames)
    if (passes(frame, filters_) && peer_.on_frame) peer_.on_frame(frame, received);
}

void CannelloniLink::flush(TimePoint now) {
  if (!peer_.take_frames) return;
  const std::vector<CanFrame> frames = peer_.take_frames();
  if (!up_ || !remote_) return;  // nobody to send them to
  for (std::size_t at = 0; at < frames.size() && up_; at += cannelloni::kFramesMax) {
    const std::size_t count = std::min(cannelloni::kFramesMax, frames.size() - at);
    const Bytes datagram = cannelloni::encode(sequence_++, std::span{frames}.subspan(at, count));
    ssize_t n = 0;
    do {
      n = ::sendto(fd_, datagram.data(), datagram.size(), MSG_DONTWAIT, remote_->raw(), remote_->length);
    } while (n < 0 && errno == EINTR);
    if (n >= 0 || errno == ECONNREFUSED) continue;
    ++counters_.unsent;  // as lost as on any network; the session repeats what matters
    if (errno != EAGAIN && errno != ENOBUFS && errno != ENETUNREACH && errno != EHOSTUNREACH && errno != EPERM)
      close(now, error_text(errno));
  }
}
}  // namespace binpick::drivers::link
