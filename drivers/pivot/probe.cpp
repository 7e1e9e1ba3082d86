#include "drivers/pivot/probe.hpp"

#include "drivers/pivot/codec.hpp"

namespace binpick::drivers::pivot {
namespace {
/// A module that answers has done so by then, a lost frame or two included.
constexpr Duration kSilentFor = std::chrono::seconds(1);
}  // namespace

Probe::Probe(const Options& options)
    : session_{options},
      other_protocol_{options.protocol == Protocol::Motion ? Protocol::PowerCube : Protocol::Motion} {
  if (!options.identify_only) return;
  Options other = options;
  other.protocol = other_protocol_;
  if (other.protocol == Protocol::PowerCube && other.module_id > kModuleIdMax) return;  // it has no such number
  other_.emplace(other);
}

std::vector<link::CanFilter> Probe::filters() const {
  auto filters = session_.filters();
  if (other_)
    for (const auto& filter : other_->filters()) filters.push_back(filter);
  return filters;
}

void Probe::on_link_up(TimePoint now) {
  session_.on_link_up(now);
  if (other_) ask_other_at_ = now + kSilentFor;
}

void Probe::on_link_down(const std::string& why, TimePoint now) {
  session_.on_link_down(why, now);
  if (other_) other_->on_link_down(why, now);
  ask_other_at_.reset();
}

void Probe::on_frame(const CanFrame& frame, TimePoint received_at) {
  session_.on_frame(frame, received_at);
  if (other_) other_->on_frame(frame, received_at);
}

void Probe::on_deadline(TimePoint now) {
  const auto due = [now](const std::optional<TimePoint>& at) { return at && *at <= now; };
  if (due(session_.deadline())) session_.on_deadline(now);
  if (other_ && due(other_->deadline())) other_->on_deadline(now);
  if (!due(ask_other_at_)) return;
  ask_other_at_.reset();
  if (!session_.module()) other_->on_link_up(now);
}

std::optional<TimePoint> Probe::deadline() const {
  const auto at = earlier(session_.deadline(), ask_other_at_);
  return other_ ? earlier(at, other_->deadline()) : at;
}

std::vector<CanFrame> Probe::take_frames() {
  auto frames = session_.take_frames();
  if (other_)
    for (const CanFrame& frame : other_->take_frames()) frames.push_back(frame);
  return frames;
}

std::optional<Protocol> Probe::answers_in_other() const {
  if (!other_ || !other_->module() || session_.module()) return std::nullopt;
  return other_protocol_;
}
}  // namespace binpick::drivers::pivot
