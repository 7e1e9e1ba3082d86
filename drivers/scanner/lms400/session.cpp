#include "drivers/scanner/lms400/session.hpp"

#include <algorithm>
#include <cmath>
#include <deque>
#include <limits>

#include "base/log.hpp"
#include "drivers/scanner/lms400/codec.hpp"
#include "drivers/scanner/scan_clock.hpp"

namespace binpick::drivers::lms400 {
namespace {
using std::chrono::milliseconds;

/// A device that is busy, or whose motor still settles, is asked again after this.
constexpr milliseconds kRetry{500};
/// Events that nobody takes: the oldest profile goes first.
constexpr std::size_t kEventsMax = 4096;
/// The device rounds what it is told; a difference beyond these is reported.
constexpr double kFrequencyTolerance_hz = 0.5;
constexpr double kResolutionTolerance_deg = 0.005;

constexpr std::uint32_t kUnknownMethod = 0x2, kUnknownVariable = 0x3, kConditionFailed = 0x4, kBusy = 0xD;

enum class Step { StopOld, LogIn, Filter, Remission, ScanConfig, Check, Start, Stop };

const char* words(Step step) {
  switch (step) {
    case Step::StopOld:
      return "the stop command before start-up";
    case Step::LogIn:
      return "the login";
    case Step::Filter:
      return "the filter setting (FLsel)";
    case Step::Remission:
      return "the extended remission setting (MDblex)";
    case Step::ScanConfig:
      return "the scan configuration";
    case Step::Check:
      return "the idle check";
    case Step::Start:
      return "the start of measuring";
    case Step::Stop:
      return "the stop of measuring";
  }
  return "?";
}
}  // namespace

struct Session::Impl {
  Options options;
  State state = State::Offline;
  bool reopen = false;
  Bytes received, output;
  std::deque<Event> events;

  std::deque<Step> steps;  // still to do, the first one is under way when step_deadline is set
  bool accepted = false;   // the method of the first step was answered by sMA
  std::optional<TimePoint> step_deadline, retry_at, retry_until, profile_deadline, check_at;
  bool expects_profiles = false, restart_after_stop = false;

  Ready configured{};
  scanner::ScanClock clock;
  std::uint64_t lost = 0, skipped = 0, skipped_reported = 0;
  bool garbage_since_answer = false;
  bool has_telegram = false;  // of this connection

  explicit Impl(const Options& o) : options{o} {}

  void reset() {
    state = State::Offline;
    received.clear();
    output.clear();
    steps.clear();
    accepted = expects_profiles = restart_after_stop = garbage_since_answer = false;
    step_deadline = retry_at = retry_until = profile_deadline = check_at = std::nullopt;
  }

  void push(Event event) {
    if (events.size() >= kEventsMax) {
      const auto oldest =
          std::ranges::find_if(events, [](const Event& e) { return e.index() == Event{ProfileReceived{}}.index(); });
      events.erase(oldest == events.end() ? events.begin() : oldest);
      ++lost;
    }
    events.push_back(std::move(event));
  }

  void fail(Failed::Why why, std::string text) {
    reset();
    reopen = why != Failed::Why::LinkLost;
    push(Failed{why, std::move(text)});
  }

  Request request_of(Step step) const {
    switch (step) {
      case Step::StopOld:
      case Step::Stop:
        return lms400::stop_measuring();
      case Step::LogIn:
        return log_in();
      case Step::Filter:
        return set_filter(options.filter_mask);
      case Step::Remission:
        return set_extended_remission(options.extended_remission);
      case Step::ScanConfig:
        return set_scan(options.frequency_hz, options.resolution, options.start, options.range);
      case Step::Check:
        return read_address();
      case Step::Start:
        break;
    }
    return lms400::start_measuring(Format::DistanceAndRemission);
  }

  /// Result of these comes when the motor has settled.
  bool waits_for_motor(Step step) const { return step == Step::ScanConfig || step == Step::Start; }

  void send_first(TimePoint now) {
    const Step step = steps.front();
    append(output, encode(Text{to_text(request_of(step))}));
    accepted = false;
    step_deadline = now + options.reply_timeout;
    if (!retry_until) retry_until = now + options.spin_up_timeout;
    retry_at.reset();
    check_at.reset();
    if (step == Step::Start) expects_profiles = false;
  }

  void add(Step step, TimePoint now) {
    steps.push_back(step);
    if (steps.size() == 1) send_first(now);
  }

  void finish_first(TimePoint now) {
    const Step step = steps.front();
    steps.pop_front();
    step_deadline.reset();
    retry_until.reset();
    switch (step) {
      case Step::ScanConfig:
        state = State::Idle;
        push(configured);
        break;
      case Step::Start:
        profile_deadline = now + options.profile_timeout;
        break;
      case Step::Stop:
        expects_profiles = false;
        state = State::Idle;
        push(Stopped{});
        if (restart_after_stop) {
          restart_after_stop = false;
          begin_measuring(now);
        }
        break;
      default:
        break;
    }
    if (!steps.empty() && !step_deadline) send_first(now);
    schedule_check(now);
  }

  void schedule_check(TimePoint now) {
    if (state == State::Idle && steps.empty() && options.idle_check.count() > 0) check_at = now + options.idle_check;
  }

  void begin_measuring(TimePoint now) {
    state = State::Measuring;
    lost = 0;
    clock.restart(from_s(1 / configured.frequency_hz));
    add(Step::Start, now);
  }

  void on_refused(const Reply& reply, TimePoint now) {
    if (steps.empty() || !step_deadline) {
      BINPICK_LOG(Warning, "scanner", "unexpected refusal: %s", to_text(reply).c_str());
      return;
    }
    const Step step = steps.front();
    const auto code = static_cast<std::uint32_t>(parse_integer(reply.arguments[0]).value_or(0));
    // A device that does not know the variable is alive; one that cannot read it has a fault.
    if (step == Step::Check && (code == kUnknownMethod || code == kUnknownVariable)) return finish_first(now);
    const bool passes = code == kBusy || (code == kConditionFailed && waits_for_motor(step));
    if (passes && now + kRetry < *retry_until) {
      BINPICK_LOG(Notice, "scanner", "%s: %s; asked again", words(step), refusal_text(code).c_str());
      return retry_later(now);
    }
    fail(Failed::Why::Refused, std::string{"scanner refused "} + words(step) + ": " + refusal_text(code));
  }

  void retry_later(TimePoint now) {
    step_deadline.reset();
    retry_at = now + kRetry;
  }

  void on_result(const Reply& reply, TimePoint now) {
    const Step step = steps.front();
    const auto word = [&](std::size_t i) { return i < reply.arguments.size() ? reply.arguments[i] : std::string{}; };
    const auto code = parse_integer(word(0));
    switch (step) {
      case Step::LogIn:
        if (code != 1)
          return fail(Failed::Why::Refused,
                      "scanner refused the login (level 4, service); another program may hold "
                      "it, or the device's password was changed");
        return finish_first(now);
      case Step::ScanConfig:
        return on_configured(code, word(1), word(2), word(3), now);
      case Step::Start:
        if (code != 0) {
          if (now + kRetry < *retry_until) {
            BINPICK_LOG(Notice, "scanner", "start of measuring answered %s; asked again", word(0).c_str());
            return retry_later(now);
          }
          return fail(Failed::Why::Refused, "scanner does not start to measure (mLRreqdata answers " + word(0) +
                                                "); check its motor and its window, switch it off and on");
        }
        return finish_first(now);
      default:
        // A stop that the device could not do means that it was not measuring.
        if (code != 0) BINPICK_LOG(Notice, "scanner", "stop answered %s", word(0).c_str());
        return finish_first(now);
    }
  }

  void on_configured(std::optional<std::int64_t> code, const std::string& frequency, const std::string& resolution,
                     const std::string& quality, TimePoint now) {
    const auto asked = to_text(request_of(Step::ScanConfig));
    if (!code || *code != 0)
      return fail(Failed::Why::Refused, "scanner refused '" + asked + "' with error " +
                                            (code ? std::to_string(*code) : "?") +
                                            "; choose another pair of frequency_hz and resolution_deg in [scanner]");
    const auto f = parse_float_hex(frequency), r = parse_float_hex(resolution);
    if (!f || !r || *f < 10 || *f > 10000 || *r < 0.01 || *r > 10)
      return fail(Failed::Why::BadTelegram, "scanner answered '" + asked + "' with frequency '" + frequency +
                                                "' and resolution '" + resolution +
                                                "', which cannot be; check that "
                                                "the device is an LMS 400");
    configured = {*f, Angle::deg(*r)};
    if (std::abs(*f - options.frequency_hz) > kFrequencyTolerance_hz ||
        std::abs(*r - options.resolution.in_deg()) > kResolutionTolerance_deg)
      BINPICK_LOG(
          Warning, "scanner",
          "set to %.1f Hz and %.3f deg instead of %.1f Hz and %.3f deg (quality %s); write these into [scanner] "
          "or choose another pair",
          *f, *r, options.frequency_hz, options.resolution.in_deg(), quality.c_str());
    finish_first(now);
  }

  void on_text(const std::string& text, TimePoint now) {
    const auto reply = parse_reply(text);
    if (!reply) {
      BINPICK_LOG(Warning, "scanner", "not a reply: '%.60s'", text.c_str());
      return;
    }
    if (reply->kind == Reply::Kind::Refused) return on_refused(*reply, now);
    const bool under_way = !steps.empty() && step_deadline.has_value();
    if (!under_way || reply->name != request_of(steps.front()).name) {
      BINPICK_LOG(Notice, "scanner", "reply to nothing that was asked: '%.60s'", text.c_str());
      return;
    }
    const Step step = steps.front();
    switch (reply->kind) {
      case Reply::Kind::Accepted:
        accepted = true;
        if (step == Step::Start) expects_profiles = true;
        step_deadline = now + (waits_for_motor(step) ? options.spin_up_timeout : options.reply_timeout);
        return;
      case Reply::Kind::Result:
        return on_result(*reply, now);
      default:
        return finish_first(now);
    }
  }

  void on_measured(const Measured& m, TimePoint now) {
    if (!expects_profiles) return;  // still streaming for whoever was here before, until our stop is answered
    const auto reading = clock.on_scan(m.counter(), now);
    if (reading.counter_jumped) BINPICK_LOG(Notice, "scanner", "the scan counter jumped to %u", unsigned{m.counter()});
    lost += reading.lost;
    Profile profile;
    profile.counter = m.counter();
    const double first_rad = Angle::deg(m.start_1e4deg * 1e-4).in_rad();
    const double step_rad = Angle::deg(m.step_1e4deg * 1e-4).in_rad();
    profile.x_mm.reserve(m.points());
    profile.z_mm.reserve(m.points());
    for (std::size_t i = 0; i < m.points(); ++i) {
      const double range = m.range_mm(i).value_or(std::numeric_limits<float>::quiet_NaN());
      const double angle = first_rad + static_cast<double>(i) * step_rad;
      profile.x_mm.push_back(static_cast<float>(range * std::cos(angle)));
      profile.z_mm.push_back(static_cast<float>(range * std::sin(angle)));
    }
    profile.received_at = now;
    profile.measured_at = reading.measured_at;
    if (profile_deadline) profile_deadline = now + options.profile_timeout;
    push(ProfileReceived{std::move(profile)});
  }

  std::string stranger_text() const {
    return "what answers at the scanner's address is no LMS 400 (" + std::to_string(skipped) +
           " bytes of no telegram): a wrong device or port, or a broken line; check the address in [scanner], then the "
           "cable";
  }

  void on_timeout() {
    const bool is_garbled = garbage_since_answer;
    const Failed::Why why = is_garbled ? Failed::Why::BadTelegram : Failed::Why::NoReply;
    if (is_garbled && !has_telegram) return fail(why, stranger_text());
    const Step step = steps.front();
    fail(why, std::string{"scanner does not answer "} + words(step) +
                  (is_garbled ? ", what comes is garbled (" + std::to_string(skipped) +
                                    " bytes skipped); check the cable and that nothing else uses the port"
                   : accepted ? "; it accepted the command but did not finish it; switch it off and on"
                              : "; check its power, its cable and the address in [scanner]"));
  }
};

Session::Session(const Options& options) : impl_{std::make_shared<Impl>(options)} {}

void Session::on_connected(TimePoint now) {
  impl_->reset();
  impl_->reopen = false;
  impl_->skipped = impl_->skipped_reported = 0;
  impl_->has_telegram = false;
  impl_->state = State::Starting;
  for (const Step step : {Step::StopOld, Step::LogIn, Step::Filter, Step::Remission, Step::ScanConfig})
    impl_->add(step, now);
}

void Session::on_disconnected(TimePoint) {
  if (impl_->state == State::Offline) return;
  if (impl_->skipped > 0 && !impl_->has_telegram) {
    impl_->fail(Failed::Why::BadTelegram, impl_->stranger_text());
    impl_->reopen = false;  // it has closed by itself
    return;
  }
  impl_->fail(Failed::Why::LinkLost, "connection to the scanner lost; check its power and cable");
}

void Session::on_bytes(ByteView bytes, TimePoint now) {
  Impl& s = *impl_;
  if (s.state == State::Offline) return;
  append(s.received, bytes);
  std::size_t at = 0;
  while (s.state != State::Offline) {
    auto decoded = decode(ByteView{s.received}.subspan(at));
    if (!decoded) {
      at += decoded.error().skip;
      s.skipped += decoded.error().skip;
      s.garbage_since_answer = true;
      if (s.skipped >= 2 * s.skipped_reported + 1) {  // on change, then each time the count doubles
        s.skipped_reported = s.skipped;
        BINPICK_LOG(Notice, "scanner", "%s; %llu bytes skipped so far", to_string(decoded.error().kind).c_str(),
                    static_cast<unsigned long long>(s.skipped));
      }
      continue;
    }
    if (!*decoded) break;
    at += (*decoded)->consumed;
    s.garbage_since_answer = false;
    s.has_telegram = true;
    if (const Text* text = std::get_if<Text>(&(*decoded)->message))
      s.on_text(text->text, now);
    else
      s.on_measured(std::get<Measured>((*decoded)->message), now);
  }
  // After a failure the buffer is already empty.
  s.received.erase(s.received.begin(),
                   s.received.begin() + static_cast<std::ptrdiff_t>(std::min(at, s.received.size())));
}

void Session::on_deadline(TimePoint now) {
  Impl& s = *impl_;
  if (s.step_deadline && now >= *s.step_deadline) return s.on_timeout();
  if (s.profile_deadline && now >= *s.profile_deadline) {
    const auto why = s.garbage_since_answer ? Failed::Why::BadTelegram : Failed::Why::NoProfiles;
    return s.fail(why, "scanner measures but sends no " + std::string{s.garbage_since_answer ? "valid " : ""} +
                           "profiles for " + std::to_string(s.options.profile_timeout.count()) +
                           " ms; check its cable and window, switch it off and on");
  }
  if (s.retry_at && now >= *s.retry_at) s.send_first(now);
  if (s.check_at && now >= *s.check_at) {
    s.check_at.reset();
    s.add(Step::Check, now);
  }
}

std::optional<TimePoint> Session::deadline() const {
  const Impl& s = *impl_;
  return earlier(earlier(s.step_deadline, s.profile_deadline), earlier(s.retry_at, s.check_at));
}

Bytes Session::take_output() { return std::exchange(impl_->output, {}); }

std::optional<Event> Session::take_event() {
  if (impl_->events.empty()) return std::nullopt;
  Event event = std::move(impl_->events.front());
  impl_->events.pop_front();
  return event;
}

bool Session::take_reopen() { return std::exchange(impl_->reopen, false); }

Session::State Session::state() const { return impl_->state; }

void Session::start_measuring(TimePoint now) {
  Impl& s = *impl_;
  if (s.state == State::Idle) return s.begin_measuring(now);
  if (s.state == State::Measuring && std::ranges::find(s.steps, Step::Stop) != s.steps.end()) {
    s.restart_after_stop = true;
    return;
  }
  BINPICK_LOG(Notice, "scanner", "not ready to measure; ignored");
}

void Session::stop_measuring(TimePoint now) {
  Impl& s = *impl_;
  if (s.state != State::Measuring) {
    BINPICK_LOG(Notice, "scanner", "not measuring; nothing to stop");
    return;
  }
  s.restart_after_stop = false;
  if (std::ranges::find(s.steps, Step::Stop) != s.steps.end()) return;
  s.profile_deadline.reset();
  // A start that still waits for the motor is not waited for; its late answers fit no question any more.
  if (const auto start = std::ranges::find(s.steps, Step::Start); start != s.steps.end()) {
    if (start == s.steps.begin()) s.step_deadline = s.retry_at = s.retry_until = std::nullopt;
    s.steps.erase(start);
  }
  s.add(Step::Stop, now);
}

std::uint64_t Session::profiles_lost() const { return impl_->lost; }
std::uint64_t Session::bytes_skipped() const { return impl_->skipped; }
}  // namespace binpick::drivers::lms400
