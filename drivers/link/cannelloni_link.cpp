#include "drivers/link/cannelloni_link.hpp"

#include <span>

#include "base/log.hpp"
#include "drivers/link/cannelloni.hpp"

namespace binpick::drivers::link {
namespace {
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
    : filters_{std::move(filters)}, peer_{std::move(peer)}, udp_{loop, std::move(remote), datagrams(), listen_port} {}

CannelloniLink::CannelloniLink(Loop& loop, const Endpoint& listen, CanPeer peer)
    : peer_{std::move(peer)}, udp_{loop, listen, datagrams(), "CAN over UDP"} {}

DatagramPeer CannelloniLink::datagrams() {
  return {
      .on_connected =
          [this](TimePoint now) {
            sequence_received_.reset();
            if (peer_.on_up) peer_.on_up(now);
          },
      .on_frame = [this](ByteView bytes, TimePoint at) { on_datagram(bytes, at); },
      .on_disconnected =
          [this](const std::string& why, TimePoint now) {
            if (peer_.on_down) peer_.on_down(why, now);
          },
      .take_frames = [this] { return take_datagrams(); },
      .on_other_peer = [this] { sequence_received_.reset(); },
  };
}

CannelloniLink::Counters CannelloniLink::counters() const {
  Counters all = counters_;
  all.strangers = udp_.counters().strangers;
  all.unsent = udp_.counters().unsent;
  return all;
}

void CannelloniLink::on_datagram(ByteView bytes, TimePoint received) {
  const auto datagram = cannelloni::decode(bytes);
  if (!datagram) {
    if (counters_.bad++ == 0)
      BINPICK_LOG(Warning, "can", "bad datagram: %s; is that a cannelloni?", to_string(datagram.error()).c_str());
    return;
  }
  ++counters_.datagrams;
  if (sequence_received_) counters_.lost += cannelloni::lost_between(*sequence_received_, datagram->sequence);
  sequence_received_ = datagram->sequence;
  counters_.fd_frames += datagram->fd_frames;
  for (const CanFrame& frame : datagram->frames)
    if (passes(frame, filters_) && peer_.on_frame) peer_.on_frame(frame, received);
}

std::vector<Bytes> CannelloniLink::take_datagrams() {
  std::vector<Bytes> datagrams;
  if (!peer_.take_frames) return datagrams;
  const std::vector<CanFrame> frames = peer_.take_frames();
  for (std::size_t at = 0; at < frames.size(); at += cannelloni::kFramesMax)
    datagrams.push_back(cannelloni::encode(
        sequence_++, std::span{frames}.subspan(at, std::min(cannelloni::kFramesMax, frames.size() - at))));
  return datagrams;
}
}  // namespace binpick::drivers::link
