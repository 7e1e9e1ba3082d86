#include "plc/modbus_client.hpp"

#include <algorithm>

#include "base/check.hpp"
#include "base/log.hpp"
#include "plc/write_order.hpp"

namespace binpick::plc::modbus {
Client::Client(ClientOptions options, std::span<const std::uint16_t> words, ClientCalls calls)
    : options_{std::move(options)}, words_{words}, calls_{std::move(calls)} {
  BINPICK_CHECK(words.size() == kMapLength);
  static_assert(kMapLength <= kReadWordsMax, "the map is read in one request");
}

Client::Words Client::ours() const {
  Words words{};
  std::ranges::copy(words_, words.begin());
  return words;
}

bool Client::told() const {
  if (!talking_) return true;
  return step_ == Step::Pause && believed_ && !next_write(there_, ours(), false);
}

void Client::on_connected(TimePoint now) {
  step_ = Step::Pause;
  next_poll_ = now + pause_;
  buffer_ = {};
  output_.clear();
  reopen_ = talking_ = blocks_written_ = believed_ = false;
  candidate_.reset();
}

void Client::on_disconnected(TimePoint now) {
  if (step_ != Step::Closed)
    fail(step_ == Step::Pause ? "the PLC closed the connection"
                              : "the connection was lost in the midst of " + to_string(request_),
         now);
  reopen_ = false;
}

void Client::on_bytes(ByteView bytes, TimePoint now) {
  buffer_.append(bytes);
  while (step_ != Step::Closed) {
    const auto frame = buffer_.take_frame();
    if (!frame) return fail("no Modbus comes from there: " + to_string(frame.error()), now);
    if (!*frame) return;
    if (step_ == Step::Pause) return fail("it sends what nobody asked for", now);
    on_reply(**frame, now);
  }
}

void Client::on_deadline(TimePoint now) {
  if (step_ == Step::Pause && now >= next_poll_) {
    poll_began_ = now;
    confirming_ = false;
    read(now);
  } else if ((step_ == Step::Reading || step_ == Step::Writing) && now >= reply_due_) {
    const auto waited = std::chrono::duration_cast<std::chrono::milliseconds>(options_.reply_timeout);
    fail("no reply to " + to_string(request_) + " within " + std::to_string(waited.count()) + " ms", now);
  }
}

std::optional<TimePoint> Client::deadline() const {
  switch (step_) {
    case Step::Closed:
      return std::nullopt;
    case Step::Pause:
      return next_poll_;
    case Step::Reading:
    case Step::Writing:
      return reply_due_;
  }
  return std::nullopt;
}

void Client::send(Request request, TimePoint now) {
  request_ = std::move(request);
  request_.transaction = ++transaction_;
  request_.unit = options_.unit;
  step_ = request_.is_read() ? Step::Reading : Step::Writing;
  reply_due_ = now + options_.reply_timeout;
  append(output_, encode(request_));
}

void Client::read(TimePoint now) { send({.first = options_.first, .count = kMapLength, .words = {}}, now); }

void Client::on_reply(ByteView frame, TimePoint now) {
  const auto words = parse_reply(frame, request_);
  if (!words) return fail(to_string(request_) + ": " + to_string(words.error()), now);
  if (!talking_) {
    talking_ = true;
    calls_.on_talking(now);
  }
  if (step_ == Step::Writing) {
    on_written();
    go_on(now);
  } else {
    on_read(*words, now);
  }
}

void Client::on_written() {
  const auto first = static_cast<std::size_t>(request_.first - options_.first);
  std::ranges::copy(request_.words, there_.begin() + static_cast<std::ptrdiff_t>(first));
  blocks_written_ = blocks_written_ || (first == kStatusFirst && first + request_.words.size() == kMapLength);
}

void Client::on_read(const std::vector<std::uint16_t>& words, TimePoint now) {
  if (believed_) {
    const auto other =
        std::ranges::mismatch(words.begin() + kStatusFirst, words.end(), there_.begin() + kStatusFirst, there_.end());
    if (other.in1 != words.end())
      tell("word " + std::to_string(options_.first + (other.in1 - words.begin())) +
           " is not as it was written: the PLC's program or another client writes there, too");
  }
  std::ranges::copy(words, there_.begin());
  const std::span<const std::uint16_t> request = std::span{there_}.first(kRequestLength);
  if (!believed_) {
    calls_.on_first_look(request, now);
    return go_on(now);
  }
  // The PLC's program may be in the midst of writing the block: what has changed counts when it is read again.
  const auto all_but_heartbeat = [](const auto& block) { return std::span<const std::uint16_t>{block}.subspan(1); };
  static_assert(at("plc_heartbeat") == kRequestFirst);
  if (candidate_ && std::ranges::equal(all_but_heartbeat(*candidate_), all_but_heartbeat(request))) {
    calls_.on_request(request, now);
    return go_on(now);
  }
  candidate_.emplace();
  std::ranges::copy(request, candidate_->begin());
  if (std::exchange(confirming_, true)) return go_on(now);  // it changes from read to read: at the next poll
  read(now);
}

void Client::go_on(TimePoint now) {
  if (auto write = next_write(there_, ours(), !blocks_written_)) {
    const auto count = static_cast<std::uint16_t>(write->words.size());
    const auto first = static_cast<std::uint16_t>(options_.first + write->first);
    return send({.first = first, .count = count, .words = std::move(write->words)}, now);
  }
  if (!believed_) {
    believed_ = true;
    BINPICK_LOG(Info, "plc", "%s, unit %u: the map is written, the PLC is polled every %lld ms",
                options_.address.c_str(), options_.unit,
                static_cast<long long>(std::chrono::duration_cast<std::chrono::milliseconds>(options_.poll).count()));
    pause_ = {};
    told_.clear();
  }
  step_ = Step::Pause;
  next_poll_ = std::max(now, poll_began_ + options_.poll);
}

void Client::tell(const std::string& what) {
  // A peer that fails in every attempt is told of once, whatever the numbers, and again when it went well in between.
  std::string kind = what;
  std::erase_if(kind, [](char c) { return c >= '0' && c <= '9'; });
  if (!told_.insert(kind).second) return;
  BINPICK_LOG(Warning, "plc", "%s, unit %u: %s", options_.address.c_str(), options_.unit, what.c_str());
}

void Client::fail(const std::string& what, TimePoint now) {
  tell(what + "; connecting anew");
  pause_ = std::clamp<Duration>(2 * pause_, kPauseFirst, kPauseMax);
  reopen_ = true;
  step_ = Step::Closed;
  output_.clear();
  if (!std::exchange(talking_, false)) return;
  calls_.on_lost(now);
}
}  // namespace binpick::plc::modbus
