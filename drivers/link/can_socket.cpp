#include "drivers/link/can_socket.hpp"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <linux/can.h>
#include <linux/can/raw.h>
#include <linux/net_tstamp.h>
#include <net/if.h>
#include <sys/epoll.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <system_error>
#include <unistd.h>

#include "base/log.hpp"
#include "drivers/link/kernel_time.hpp"

namespace binpick::drivers::link {
namespace {
using namespace std::chrono_literals;
constexpr Duration kRetryFirst = 200ms;
constexpr Duration kRetryMax = 1s;
constexpr Duration kSendRetry = 2ms;  // poll(POLLOUT) does not wait for room in the interface's queue
constexpr Duration kSendMax = 100ms;  // an older frame asks for what nobody wants to know any more
constexpr std::size_t kUnsentMax = 1000;
constexpr int kFramesPerWakeUp = 256;
constexpr std::uint32_t kErrorClasses = 0x001 | can_error::kController | 0x010 | can_error::kBusOff |
                                        can_error::kRestarted;  // time-out, controller, transceiver, bus-off, restarted

std::string error_text(int error) { return std::generic_category().message(error); }

can_frame to_kernel(const CanFrame& frame) {
  can_frame raw{};
  raw.can_id = frame.id | (frame.extended ? CAN_EFF_FLAG : 0) | (frame.rtr ? CAN_RTR_FLAG : 0);
  raw.can_dlc = std::min<std::uint8_t>(frame.length, 8);
  std::copy_n(frame.payload.begin(), raw.can_dlc, raw.data);
  return raw;
}

CanFrame from_kernel(const can_frame& raw) {
  CanFrame frame;
  frame.extended = (raw.can_id & CAN_EFF_FLAG) != 0;
  frame.rtr = (raw.can_id & CAN_RTR_FLAG) != 0;
  frame.error = (raw.can_id & CAN_ERR_FLAG) != 0;
  frame.id = raw.can_id & (frame.extended || frame.error ? CAN_EFF_MASK : CAN_SFF_MASK);
  frame.length = std::min<std::uint8_t>(raw.can_dlc, 8);
  if (!frame.rtr) std::copy_n(raw.data, frame.length, frame.payload.begin());
  return frame;
}

/// Frames that this socket had to drop so far, from a received message.
std::optional<std::uint32_t> overflow_of(msghdr& message) {
  for (cmsghdr* header = CMSG_FIRSTHDR(&message); header != nullptr; header = CMSG_NXTHDR(&message, header)) {
    if (header->cmsg_level != SOL_SOCKET || header->cmsg_type != SO_RXQ_OVFL) continue;
    std::uint32_t total = 0;
    std::memcpy(&total, CMSG_DATA(header), sizeof total);
    return total;
  }
  return std::nullopt;
}
}  // namespace

std::string no_can_socket_text(int error) {
  constexpr const char* kSandbox = "the service's sandbox has no AF_CAN in RestrictAddressFamilies=";
  constexpr const char* kRemedy = "; cannelloni://HOST:PORT does without";
  const std::string text = "cannot open a CAN socket: " + error_text(error) + "; ";
  switch (error) {
    case EAFNOSUPPORT:  // what systemd's filter answers looks like a kernel without CAN
    case EPROTONOSUPPORT:
      return text + "either the kernel has no CAN (modprobe can_raw), or " + kSandbox + kRemedy;
    case EPERM:
    case EACCES:
      return text + "refused by a sandbox, a container or a security module: perhaps " + kSandbox + kRemedy;
    default:
      return text + "see the kernel's log (dmesg)" + kRemedy;
  }
}

CanSocket::CanSocket(Loop& loop, std::string interface, std::vector<CanFilter> filters, CanPeer peer)
    : loop_{loop},
      interface_{std::move(interface)},
      filters_{std::move(filters)},
      peer_{std::move(peer)},
      retry_{kRetryFirst} {}

CanSocket::~CanSocket() { close_fd(); }

void CanSocket::close_fd() {
  if (fd_ < 0) return;
  loop_.forget(fd_);
  ::close(fd_);
  fd_ = -1;
}

std::optional<TimePoint> CanSocket::deadline() const { return earlier(open_at_, send_at_); }

void CanSocket::on_deadline(TimePoint now) {
  if (open_at_ && now >= *open_at_) open(now);
  if (send_at_ && now >= *send_at_) flush(now);
}

std::string CanSocket::try_open() {
  const int fd = ::socket(PF_CAN, SOCK_RAW | SOCK_NONBLOCK | SOCK_CLOEXEC, CAN_RAW);
  if (fd < 0) return no_can_socket_text(errno);
  const auto failed = [fd](const std::string& why) {
    ::close(fd);
    return why;
  };
  ifreq request{};
  std::memcpy(request.ifr_name, interface_.c_str(), std::min<std::size_t>(interface_.size(), IFNAMSIZ - 1));
  if (::ioctl(fd, SIOCGIFINDEX, &request) != 0) return failed("there is no interface " + interface_ + " (ip link)");
  sockaddr_can address{};
  address.can_family = AF_CAN;
  address.can_ifindex = request.ifr_ifindex;
  if (::ioctl(fd, SIOCGIFFLAGS, &request) != 0 || (request.ifr_flags & IFF_UP) == 0)
    return failed(interface_ + " is down: ip link set " + interface_ + " up type can bitrate 500000 restart-ms 100");
  std::vector<can_filter> filters;
  for (const CanFilter& filter : filters_)
    filters.push_back({filter.id, (filter.mask & CAN_SFF_MASK) | CAN_EFF_FLAG | CAN_RTR_FLAG});
  if (!filters.empty() && ::setsockopt(fd, SOL_CAN_RAW, CAN_RAW_FILTER, filters.data(),
                                       static_cast<socklen_t>(filters.size() * sizeof(can_filter))) != 0)
    return failed("cannot set the CAN filters: " + error_text(errno));
  const can_err_mask_t errors = kErrorClasses;
  if (::setsockopt(fd, SOL_CAN_RAW, CAN_RAW_ERR_FILTER, &errors, sizeof errors) != 0)
    return failed("cannot ask for CAN error frames: " + error_text(errno));
  // Of these two, either may be refused by an old kernel: the loop's time stamp and no count of drops then serve.
  const int stamps = SOF_TIMESTAMPING_SOFTWARE | SOF_TIMESTAMPING_RX_SOFTWARE;
  ::setsockopt(fd, SOL_SOCKET, SO_TIMESTAMPING, &stamps, sizeof stamps);
  const int one = 1;
  ::setsockopt(fd, SOL_SOCKET, SO_RXQ_OVFL, &one, sizeof one);
  if (::bind(fd, reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0)
    return failed("cannot bind to " + interface_ + ": " + error_text(errno));
  fd_ = fd;
  return {};
}

void CanSocket::open(TimePoint now) {
  open_at_.reset();
  if (const std::string why = try_open(); !why.empty()) return close(now, why);
  loop_.watch(fd_, EPOLLIN, [this](std::uint32_t, TimePoint at) { receive(at); });
  BINPICK_LOG(Info, "can", "%s is open", interface_.c_str());
  retry_ = kRetryFirst;
  last_why_.clear();
  bus_off_ = false;
  overflow_ = 0;
  if (peer_.on_up) peer_.on_up(now);
  flush(now);
}

void CanSocket::close(TimePoint now, const std::string& why) {
  const bool news = fd_ >= 0 || why != last_why_;
  close_fd();
  unsent_.clear();
  send_at_.reset();
  last_why_ = why;
  open_at_ = now + retry_;
  retry_ = std::min(2 * retry_, kRetryMax);
  if (news && peer_.on_down) peer_.on_down(why, now);
}

void CanSocket::receive(TimePoint now) {
  for (int i = 0; i < kFramesPerWakeUp && fd_ >= 0; ++i) {
    can_frame raw{};
    alignas(cmsghdr) std::array<char, 256> control;
    iovec part{&raw, sizeof raw};
    msghdr message{};
    message.msg_iov = &part;
    message.msg_iovlen = 1;
    message.msg_control = control.data();
    message.msg_controllen = control.size();
    const ssize_t n = ::recvmsg(fd_, &message, 0);
    if (n < 0) {
      if (errno == EINTR) continue;
      if (errno == EAGAIN || errno == EWOULDBLOCK) break;
      return close(now, interface_ + ": " + error_text(errno));  // ENETDOWN: set down, ENODEV: gone
    }
    if (n != sizeof raw) continue;  // one read is one frame; anything else is none
    const TimePoint none{};
    const TimePoint stamp = received_at(message, none);
    if (stamp != none) ++counters_.kernel_times;
    if (const auto total = overflow_of(message); total && *total != overflow_) {
      counters_.dropped_by_kernel += *total - overflow_;
      overflow_ = *total;
      BINPICK_LOG(Warning, "can", "%s: %u frames dropped so far, the loop was too slow", interface_.c_str(), *total);
    }
    ++counters_.received;
    on_frame(from_kernel(raw), stamp != none ? stamp : now, now);
  }
  flush(now);
}

void CanSocket::on_frame(const CanFrame& frame, TimePoint received, TimePoint now) {
  if (peer_.on_frame) peer_.on_frame(frame, received);
  const bool off = frame.error && (frame.id & can_error::kBusOff) != 0;
  if (off && !bus_off_) {
    bus_off_ = true;
    unsent_.clear();
    send_at_.reset();
    if (peer_.on_down)
      peer_.on_down("bus-off on " + interface_ +
                        ": short circuit, wrong termination or bit rate; without restart-ms: ip link set " +
                        interface_ + " type can restart",
                    now);
  } else if (bus_off_ && !off && (!frame.error || (frame.id & can_error::kRestarted) != 0)) {
    bus_off_ = false;
    if (peer_.on_up) peer_.on_up(now);
  }
}

void CanSocket::flush(TimePoint now) {
  if (peer_.take_frames)
    for (const CanFrame& frame : peer_.take_frames()) unsent_.push_back({frame, now});
  send_at_.reset();
  if (fd_ < 0 || bus_off_) return unsent_.clear();
  while (!unsent_.empty()) {
    const can_frame raw = to_kernel(unsent_.front().frame);
    const ssize_t n = ::write(fd_, &raw, sizeof raw);
    if (n == sizeof raw) {
      ++counters_.sent;
      unsent_.pop_front();
      continue;
    }
    if (n < 0 && errno == EINTR) continue;
    if (n < 0 && errno != ENOBUFS && errno != EAGAIN && errno != EWOULDBLOCK)
      return close(now, interface_ + ": " + error_text(errno));
    ++counters_.queue_full;
    while (!unsent_.empty() && (now - unsent_.front().since > kSendMax || unsent_.size() > kUnsentMax)) {
      if (counters_.unsent++ == 0)
        BINPICK_LOG(Warning, "can", "%s takes no frames: does any node acknowledge? Is txqueuelen large enough?",
                    interface_.c_str());
      unsent_.pop_front();
    }
    if (!unsent_.empty()) send_at_ = now + kSendRetry;
    return;
  }
}
}  // namespace binpick::drivers::link
