#include "drivers/scanner/lps36/pairing.hpp"

#include <algorithm>
#include <cstdlib>
#include <utility>

namespace binpick::drivers::lps36 {
namespace {
constexpr unsigned kZ = 1, kX = 2, kBoth = kZ | kX;

unsigned parts_of(const Measured& measured) {
  switch (measured.part) {
    case Measured::Part::Z:
      return kZ;
    case Measured::Part::X:
      return kX;
    case Measured::Part::Both:
      break;
  }
  return kBoth;
}

/// From `from` to `to` the shorter way round.
std::int16_t steps(std::uint16_t from, std::uint16_t to) { return static_cast<std::int16_t>(to - from); }
}  // namespace

void Pairing::restart() { *this = Pairing{hold_}; }

bool Pairing::fits(const Measured& measured) const {
  return !began_ || std::abs(steps(static_cast<std::uint16_t>(newest_), measured.scan)) < kFar;
}

void Pairing::add(Measured measured, TimePoint now) {
  if (!fits(measured)) return put_aside(std::move(measured), now);
  aside_.reset();
  accept(std::move(measured), now);
}

void Pairing::put_aside(Measured measured, TimePoint now) {
  const bool is_repeated = aside_ && aside_->measured.scan == measured.scan && aside_->measured.part == measured.part;
  const bool counts_anew = aside_ && !is_repeated && std::abs(steps(aside_->measured.scan, measured.scan)) < kFar;
  if (!counts_anew) {
    ++counts_.strays;
    aside_ = Aside{std::move(measured), now};
    return;
  }
  Aside first = *std::exchange(aside_, std::nullopt);
  --counts_.strays;
  ++counts_.jumps;
  flush();
  began_ = handed_out_ = next_is_fixed_ = false;
  done_.fill({});
  accept(std::move(first.measured), first.at);
  accept(std::move(measured), now);
}

void Pairing::accept(Measured measured, TimePoint now) {
  if (!began_) {
    began_ = true;
    newest_ = next_ = 65536 + std::int64_t{measured.scan};  // equal to the wire's number modulo 65536
    newest_telegram_ = 0;
  }
  const std::int64_t scan = newest_ + steps(static_cast<std::uint16_t>(newest_), measured.scan);
  const unsigned parts = parts_of(measured);
  if (scan < next_ && !next_is_fixed_) next_ = scan;
  if (scan < next_) {
    Done& past = done(scan);
    if (past.scan != scan) past = {scan, 0};
    ++((past.parts & parts) != 0 ? counts_.duplicates : counts_.late);
    past.parts |= parts;
    return;
  }
  Waiting& waiting = waiting_.try_emplace(scan, Waiting{now, 0, {}}).first->second;
  if ((waiting.parts & parts) != 0) {
    ++counts_.duplicates;
    return;
  }
  const std::int64_t telegram = 2 * scan + (parts == kX ? 1 : 0);
  if (telegram < newest_telegram_) ++counts_.overtaken;
  newest_telegram_ = std::max(newest_telegram_, telegram);
  newest_ = std::max(newest_, scan);

  Line& line = waiting.line;
  if (waiting.parts == 0 || parts != kX) {  // both halves say the same; Z's word counts
    line.scan = measured.scan;
    line.encoder = measured.encoder;
  }
  if (waiting.parts == 0) line.received_at = now;
  waiting.parts |= parts;
  line.hi = measured.part == Measured::Part::Both;
  if ((parts & kZ) != 0) line.z = std::move(measured.z);
  if ((parts & kX) != 0) line.x = std::move(measured.x);
  release(now);
}

void Pairing::on_deadline(TimePoint now) {
  if (deadline_ && now >= *deadline_) release(now);
}

void Pairing::release(TimePoint now) {
  deadline_.reset();
  while (!waiting_.empty()) {
    const auto first = waiting_.begin();
    if (first->first != next_ || first->second.parts != kBoth) {
      std::optional<TimePoint> newer_since;
      for (const auto& [scan, waiting] : waiting_)
        if (scan > next_) newer_since = earlier(newer_since, waiting.first_at);
      if (!newer_since) return;
      if (now < *newer_since + hold_ && waiting_.size() < kWaitingMax) {
        deadline_ = *newer_since + hold_;
        return;
      }
    }
    finish_next();
  }
}

/// Hands the next scan's line out, or gives it up.
void Pairing::finish_next() {
  const auto found = waiting_.find(next_);
  const unsigned parts = found == waiting_.end() ? 0 : found->second.parts;
  done(next_) = {next_, parts};
  if (parts == kBoth) {
    lines_.push_back(std::move(found->second.line));
    ++counts_.lines;
    handed_out_ = true;
  } else if (handed_out_) {
    ++counts_.lost;
    if (parts != 0) ++counts_.halves;
  }
  if (found != waiting_.end()) waiting_.erase(found);
  next_is_fixed_ = true;
  ++next_;
}

void Pairing::flush() {
  const auto last =
      std::find_if(waiting_.rbegin(), waiting_.rend(), [](const auto& entry) { return entry.second.parts == kBoth; });
  if (last != waiting_.rend())
    for (const std::int64_t scan = last->first; next_ <= scan;) finish_next();
  waiting_.clear();
  deadline_.reset();
}

std::optional<Line> Pairing::take_line() {
  if (lines_.empty()) return std::nullopt;
  Line line = std::move(lines_.front());
  lines_.pop_front();
  return line;
}
}  // namespace binpick::drivers::lps36
