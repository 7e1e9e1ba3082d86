#include "drivers/scanner/lps36/session.hpp"

#include <algorithm>
#include <array>
#include <cstdio>
#include <deque>
#include <limits>
#include <utility>

#include "base/log.hpp"
#include "drivers/scanner/lps36/codec.hpp"
#include "drivers/scanner/lps36/step.hpp"
#include "drivers/scanner/scan_clock.hpp"

namespace binpick::drivers::lps36 {
namespace {
using std::chrono::milliseconds;

constexpr double kFrequency_hz = 100;  // [LES, LXSN, NODE]
/// Someone else is connected or at the display: asked again after this.
constexpr milliseconds kRetry{500};
constexpr milliseconds kBetweenTriggers{18};  // [LXSD]
/// A value that the device reads back otherwise is set again so often.
constexpr int kSetAgainMax = 3;
/// So many telegrams of one kind without one of the other are no accident.
constexpr std::uint64_t kHalvesMin = 3;
/// Events that nobody takes: the oldest profile goes first.
constexpr std::size_t kEventsMax = 4096;

std::string hex(std::uint16_t word) {
  std::array<char, 8> text{};
  std::snprintf(text.data(), text.size(), "0x%04X", unsigned{word});
  return text.data();
}
}  // namespace

struct Session::Impl {
  Options options;
  std::vector<Setting> settings;
  State state = State::Offline;
  bool reopen = false;
  std::vector<Bytes> output;
  std::deque<Event> events;

  std::deque<Step> steps;  // still to do, the first one is under way when step_deadline is set
  int tries = 0;           // of the first step
  int set_again = 0;
  std::optional<TimePoint> step_deadline, retry_at, busy_until, profile_deadline, check_at, triggered_at;
  bool expects_profiles = false, restart_after_stop = false;

  Pairing pairing;
  scanner::ScanClock clock;
  std::uint64_t lost_otherwise = 0;  // while the sensor counted anew, or because nobody took them
  std::uint64_t discarded = 0, discarded_reported = 0;
  bool garbage_since_answer = false;
  std::uint64_t z_since_profile = 0, x_since_profile = 0;  // telegrams
  Status status;
  bool other_model_told = false;

  explicit Impl(const Options& o) : options{o}, settings{settings_of(o)}, pairing{o.hold} {}

  bool is_free_running() const { return options.trigger == Options::Trigger::FreeRunning; }

  void reset() {
    state = State::Offline;
    output.clear();
    steps.clear();
    expects_profiles = restart_after_stop = garbage_since_answer = other_model_told = false;
    step_deadline = retry_at = busy_until = profile_deadline = check_at = triggered_at = std::nullopt;
    status = {};
  }

  void push(Event event) {
    if (events.size() >= kEventsMax) {
      const auto oldest =
          std::ranges::find_if(events, [](const Event& e) { return std::holds_alternative<ProfileReceived>(e); });
      events.erase(oldest == events.end() ? events.begin() : oldest);
      ++lost_otherwise;
    }
    events.push_back(std::move(event));
  }

  void fail(Failed::Why why, std::string text) {
    reset();
    reopen = why != Failed::Why::LinkLost;
    push(Failed{why, std::move(text)});
  }

  void send_first(TimePoint now) {
    output.push_back(encode(telegram_of(steps.front(), options, settings)));
    ++tries;
    step_deadline = now + options.reply_timeout;
    retry_at.reset();
    check_at.reset();
  }

  void begin_first(TimePoint now) {
    tries = 0;
    send_first(now);
  }

  void add(Ask ask, TimePoint now) {
    steps.push_back({ask, 0});
    if (steps.size() == 1) begin_first(now);
  }

  void finish_first(TimePoint now) {
    const Step step = steps.front();
    steps.pop_front();
    step_deadline.reset();
    if (step.ask != Ask::DropOld) busy_until.reset();
    switch (step.ask) {
      case Ask::ReadBack:
        set_again = 0;
        break;
      case Ask::Start:
        expects_profiles = true;
        if (is_free_running()) profile_deadline = now + options.profile_timeout;
        break;
      case Ask::Stop:
        pairing.flush();
        hand_out_profiles(now);
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
    if (state == State::Starting && steps.empty()) {
      state = State::Idle;
      push(Ready{.frequency_hz = is_free_running() ? kFrequency_hz : 0, .resolution = {}});
    }
    if (!steps.empty() && !step_deadline) begin_first(now);
    if (state == State::Idle && steps.empty() && options.idle_check.count() > 0) check_at = now + options.idle_check;
  }

  void begin_measuring(TimePoint now) {
    state = State::Measuring;
    pairing.restart();
    clock.restart(from_s(1 / kFrequency_hz));
    lost_otherwise = 0;
    z_since_profile = x_since_profile = 0;
    triggered_at.reset();
    add(Ask::Start, now);
  }

  void on_status(Status said) {
    const bool is_worse = (said.fault() && !status.fault()) || (said.warning() && !status.warning());
    if (is_worse)
      BINPICK_LOG(Warning, "scanner", "reports a %s fault (status %s); %s", said.fault() ? "permanent" : "temporary",
                  hex(said.bits).c_str(),
                  said.fault() ? "switch it off and on; if it comes again, have it serviced"
                               : "check that its window is clean and that no strong light falls in");
    if ((status.fault() && !said.fault()) || (status.warning() && !said.warning() && !said.fault()))
      BINPICK_LOG(Notice, "scanner", "its fault is gone (status %s)", hex(said.bits).c_str());
    status = said;
  }

  void on_answer(const Telegram& telegram, TimePoint now) {
    const bool under_way = !steps.empty() && step_deadline.has_value();
    if (!under_way ||
        telegram.transaction != static_cast<std::uint16_t>(telegram_of(steps.front(), options, settings).id)) {
      // The second answer to a command that was sent twice, mostly.
      BINPICK_LOG(Debug, "scanner", "answer to nothing that is asked: telegram %s, command %s",
                  hex(static_cast<std::uint16_t>(telegram.id)).c_str(), hex(telegram.transaction).c_str());
      return;
    }
    garbage_since_answer = false;
    const Ask ask = steps.front().ask;
    if (telegram.id == Id::Nack) return on_refused(telegram.status, now);
    if (ask == Ask::ReadBack && on_read_back(telegram, now)) return;
    if (ask == Ask::Check && telegram.id == Id::Task) return finish_first(now);
    if (ask != Ask::ReadBack && ask != Ask::Check && telegram.id == Id::Ack) return finish_first(now);
    fail(Failed::Why::BadTelegram, "scanner answers " + words_for(steps.front(), settings) + " with telegram " +
                                       hex(static_cast<std::uint16_t>(telegram.id)) + " of " +
                                       std::to_string(telegram.words.size()) +
                                       " words, which does not fit; check that the device is an LPS 36 and that its "
                                       "address belongs to no other device");
  }

  /// False: the answer does not fit the question.
  bool on_read_back(const Telegram& telegram, TimePoint now) {
    const Step step = steps.front();
    const Setting& setting = settings[step.setting];
    std::vector<std::uint16_t> values;
    if (setting.is_user) {
      if (telegram.id != Id::UserParameter || telegram.words.empty()) return false;
      values = {telegram.words.front()};
    } else {
      const auto parameter = parameter_of(telegram);
      if (!parameter || parameter->id != setting.id) return false;
      values = parameter->values;
    }
    if (values == setting.values) {
      finish_first(now);
      return true;
    }
    if (set_again < kSetAgainMax) {  // the setting was lost, and an answer to an earlier one taken for its own
      ++set_again;
      steps.push_front({Ask::Set, step.setting});
      begin_first(now);
      return true;
    }
    BINPICK_LOG(Warning, "scanner", "%s is %s after it was set to %s; set it in the device's menu",
                setting.what.c_str(), values.empty() ? "nothing" : hex(values.front()).c_str(),
                hex(setting.values.front()).c_str());
    finish_first(now);
    return true;
  }

  void on_refused(Status said, TimePoint now) {
    const Step step = steps.front();
    const std::string with_status = " (status " + hex(said.bits) + ")";
    const auto refused = [&](const std::string& why) {
      fail(Failed::Why::Refused, "scanner refused " + words_for(step, settings) + why);
    };
    if (is_done_already(step.ask, said)) return finish_first(now);
    if (said.mode() == Mode::Error)
      return refused(with_status +
                     ": it has a permanent fault; switch it off and on; if it comes again, have it "
                     "serviced");
    const bool is_in_menu = said.mode() == Mode::Menu;
    if (step.ask == Ask::Check && is_in_menu)
      return refused(with_status + ": someone is in the menu of its display; leave the menu");
    if (step.ask == Ask::Check)  // it refuses nothing: it was away, and knows us no more
      return fail(Failed::Why::NoReply, "scanner has left command mode" + with_status +
                                            ": it was switched off and on, or another program uses it; check its "
                                            "power if it comes again");
    if (is_in_menu || step.ask == Ask::Connect) {
      if (!busy_until) busy_until = now + options.busy_timeout;
      if (now + kRetry < *busy_until) {
        BINPICK_LOG(Notice, "scanner", "%s refused%s; asked again", words_for(step, settings).c_str(),
                    with_status.c_str());
        if (step.ask == Ask::Connect) steps.push_front({Ask::DropOld, 0});
        step_deadline.reset();
        retry_at = now + kRetry;
        return;
      }
      return refused(with_status + (is_in_menu ? ": someone is in the menu of its display; leave the menu (it closes "
                                                 "by itself after 3 minutes)"
                                               : ": another program holds it; end that program, or switch the "
                                                 "scanner off and on"));
    }
    if (step.ask == Ask::ReadBack) {
      BINPICK_LOG(Notice, "scanner", "%s refused%s; taken as set", words_for(step, settings).c_str(),
                  with_status.c_str());
      return finish_first(now);
    }
    if (step.ask == Ask::Set) return refused(with_status + "; choose a value in the range that its menu allows");
    refused(with_status + "; switch it off and on");
  }

  void on_measured(Measured measured, TimePoint now) {
    if (!expects_profiles) return;  // from before the change to command mode
    garbage_since_answer = false;
    if ((measured.part == Measured::Part::Both) != options.hi && !std::exchange(other_model_told, true))
      BINPICK_LOG(Warning, "scanner",
                  "is configured as an LPS 36%s, but measures as the other model; correct the model",
                  options.hi ? " HI" : "");
    if (measured.part != Measured::Part::X) ++z_since_profile;
    if (measured.part != Measured::Part::Z) ++x_since_profile;
    pairing.add(std::move(measured), now);
    hand_out_profiles(now);
  }

  void hand_out_profiles(TimePoint now) {
    while (const auto line = pairing.take_line()) {
      const auto nothing = std::numeric_limits<float>::quiet_NaN();
      const double count_mm = line->hi ? kCountHi_mm : kCount_mm;
      Profile profile;
      profile.counter = line->scan;
      profile.encoder = line->encoder;
      profile.x_mm.reserve(line->z.size());
      profile.z_mm.reserve(line->z.size());
      for (std::size_t i = 0; i < line->z.size(); ++i) {
        const bool is_valid = is_point(line->z[i], line->hi);
        profile.x_mm.push_back(is_valid ? static_cast<float>(line->x[i] * count_mm) : nothing);
        profile.z_mm.push_back(is_valid ? static_cast<float>(line->z[i] * count_mm) : nothing);
      }
      profile.received_at = profile.measured_at = line->received_at;
      if (is_free_running()) {
        const auto reading = clock.on_scan(line->scan, line->received_at);
        profile.measured_at = reading.measured_at;
        if (reading.counter_jumped) {
          BINPICK_LOG(Notice, "scanner", "the scan number jumped to %u", unsigned{line->scan});
          lost_otherwise += reading.lost;
        }
      }
      z_since_profile = x_since_profile = 0;
      if (profile_deadline)
        profile_deadline = is_free_running() ? std::optional{now + options.profile_timeout} : std::nullopt;
      push(ProfileReceived{std::move(profile)});
    }
  }

  void on_discarded(const DecodeError& error) {
    ++discarded;
    garbage_since_answer = true;
    if (discarded < 2 * discarded_reported + 1) return;  // on change, then each time the count doubles
    discarded_reported = discarded;
    BINPICK_LOG(Notice, "scanner", "%s; %llu datagrams discarded so far", to_string(error).c_str(),
                static_cast<unsigned long long>(discarded));
  }

  void on_no_reply(TimePoint now) {
    const Step step = steps.front();
    if (step.ask == Ask::DropOld) return finish_first(now);  // nobody was connected, perhaps
    if (tries < options.tries) return send_first(now);
    fail(garbage_since_answer ? Failed::Why::BadTelegram : Failed::Why::NoReply,
         "scanner does not answer " + words_for(step, settings) +
             (garbage_since_answer ? ", what comes is no telegram of an LPS 36 (" + std::to_string(discarded) +
                                         " datagrams discarded); check that nothing else uses the port"
                                   : "; check its power, its cable, its address and the port that it sends to"));
  }

  void on_no_profile() {
    const std::string time = " for " + std::to_string(options.profile_timeout.count()) + " ms; ";
    const char* const remedy = "check its cable and window and that nobody is in its menu, switch it off and on";
    if (garbage_since_answer)
      return fail(Failed::Why::BadTelegram, "scanner measures but sends no valid profiles" + time + remedy);
    const bool is_only_z = x_since_profile == 0 && z_since_profile >= kHalvesMin;
    const bool is_only_x = z_since_profile == 0 && x_since_profile >= kHalvesMin;
    if (is_only_z || is_only_x)
      return fail(Failed::Why::NoProfiles, std::string{"scanner sends "} + (is_only_z ? "Z but no X" : "X but no Z") +
                                               " telegrams" + time +
                                               "check that it sends X (parameter 0x07D4), and the network for losses");
    fail(Failed::Why::NoProfiles, "scanner measures but sends no profiles" + time + remedy);
  }
};

Session::Session(const Options& options) : impl_{std::make_shared<Impl>(options)} {}

void Session::on_connected(TimePoint now) {
  Impl& s = *impl_;
  s.reset();
  s.reopen = false;
  s.discarded = s.discarded_reported = 0;
  s.set_again = 0;
  s.state = State::Starting;
  for (const Ask ask : {Ask::DropOld, Ask::Connect, Ask::EnterCommandMode}) s.add(ask, now);
  for (std::size_t i = 0; i < s.settings.size(); ++i) {
    s.steps.push_back({Ask::Set, i});
    s.steps.push_back({Ask::ReadBack, i});
  }
}

void Session::on_disconnected(TimePoint) {
  if (impl_->state == State::Offline) return;
  impl_->fail(Failed::Why::LinkLost, "the socket to the scanner failed; check its power, its cable and its address");
}

void Session::on_frame(ByteView datagram, TimePoint now) {
  Impl& s = *impl_;
  if (s.state == State::Offline) return;
  const auto telegram = decode(datagram);
  if (!telegram) return s.on_discarded(telegram.error());
  if (!is_measured(telegram->id)) {
    s.on_status(telegram->status);
    return s.on_answer(*telegram, now);
  }
  auto measured = measured_of(*telegram);
  if (!measured) return s.on_discarded(measured.error());
  s.on_status(telegram->status);
  s.on_measured(std::move(*measured), now);
}

void Session::on_deadline(TimePoint now) {
  Impl& s = *impl_;
  if (s.step_deadline && now >= *s.step_deadline) s.on_no_reply(now);
  s.pairing.on_deadline(now);
  if (s.expects_profiles) s.hand_out_profiles(now);
  if (s.profile_deadline && now >= *s.profile_deadline) return s.on_no_profile();
  if (s.retry_at && now >= *s.retry_at) s.begin_first(now);
  if (s.check_at && now >= *s.check_at) {
    s.check_at.reset();
    s.add(Ask::Check, now);
  }
}

std::optional<TimePoint> Session::deadline() const {
  const Impl& s = *impl_;
  const auto waiting = s.expects_profiles ? s.pairing.deadline() : std::nullopt;
  return earlier(earlier(earlier(s.step_deadline, s.profile_deadline), earlier(s.retry_at, s.check_at)), waiting);
}

std::vector<Bytes> Session::take_frames() { return std::exchange(impl_->output, {}); }

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
  const auto stop = std::ranges::find(s.steps, Ask::Stop, &Step::ask);
  if (s.state == State::Idle) return s.begin_measuring(now);
  if (s.state == State::Measuring && stop != s.steps.end()) {
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
  if (std::ranges::find(s.steps, Ask::Stop, &Step::ask) != s.steps.end()) return;
  s.profile_deadline.reset();
  // A start that is not answered yet is not waited for; its late answer fits no question any more.
  if (const auto start = std::ranges::find(s.steps, Ask::Start, &Step::ask); start != s.steps.end()) {
    if (start == s.steps.begin()) s.step_deadline = s.retry_at = s.busy_until = std::nullopt;
    s.steps.erase(start);
  }
  s.add(Ask::Stop, now);
}

bool Session::trigger(TimePoint now) {
  Impl& s = *impl_;
  const bool is_stopping = std::ranges::find(s.steps, Ask::Stop, &Step::ask) != s.steps.end();
  if (s.options.trigger != Options::Trigger::Ethernet || !s.expects_profiles || is_stopping) return false;
  if (s.triggered_at && now - *s.triggered_at < kBetweenTriggers) return false;
  s.triggered_at = now;
  s.output.push_back(encode(command(Id::Trigger)));
  if (!s.profile_deadline) s.profile_deadline = now + s.options.profile_timeout;
  return true;
}

std::uint64_t Session::profiles_lost() const { return impl_->pairing.counts().lost + impl_->lost_otherwise; }
Pairing::Counts Session::telegrams() const { return impl_->pairing.counts(); }
std::uint64_t Session::frames_discarded() const { return impl_->discarded; }
Status Session::status() const { return impl_->status; }
}  // namespace binpick::drivers::lps36
