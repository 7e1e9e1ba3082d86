#include "tests/emulators/scanner/lps36_device.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <iterator>
#include <limits>
#include <utility>

namespace binpick::emulators {
namespace {
using drivers::lps36::Id;
using drivers::lps36::Measured;
using drivers::lps36::Mode;
using drivers::lps36::Status;
using drivers::lps36::Telegram;
namespace task = drivers::lps36::task;
namespace user = drivers::lps36::user;
using Words = std::vector<std::uint16_t>;

constexpr double kFrequency_hz = 100;
constexpr Duration kBetweenTriggers = std::chrono::milliseconds(18);
/// A host that cannot keep up loses lines, as with the device itself.
constexpr Duration kLagMax = std::chrono::milliseconds(100);
constexpr std::uint16_t kUnsigned8 = 1, kUnsigned16 = 2, kSigned16 = 5;

std::int16_t signed_of(std::uint16_t word) { return std::bit_cast<std::int16_t>(word); }
std::uint16_t word_of(int value) { return std::bit_cast<std::uint16_t>(static_cast<std::int16_t>(value)); }
}  // namespace

Lps36::Lps36(Measure measure) : Lps36{std::move(measure), Options{}} {}

Lps36::Lps36(Measure measure, const Options& options)
    : measure_{std::move(measure)}, options_{options}, scan_{options.first_scan}, random_{options.seed} {
  set_defaults();
}

/// Ranges as in the table of task parameters that LES and NODE print; X and Z limits are those of LXSP.
void Lps36::set_defaults() {
  user_ = {{user::kXDisabled, {kUnsigned8, 0, 1, {0}}}, {user::kPause, {kUnsigned8, 0, 9, {0}}}};
  task_ = {{task::kOperationMode, {kUnsigned8, 0, 1, {0}}},
           {task::kActivation, {kUnsigned8, 0, 1, {0}}},
           {task::kExposure, {kUnsigned8, 0, 4, {0}}},
           {task::kManualExposure, {kUnsigned16, options_.hi ? 739 : 973, 13109, {1635}}},
           {task::kFieldX, {kSigned16, -3000, 3000, {word_of(-3000), word_of(3000)}}},
           {task::kFieldZ, {kUnsigned16, 1900, 8100, {1900, 8100}}}};
  task_number_ = 0;
}

void Lps36::power_cycle(TimePoint now) {
  connected_ = hi_connected_ = command_mode_ = false;
  active_ = true;
  scan_ = options_.first_scan;
  encoder_base_ = 0;
  encoder_zero_ = now;
  tick_.reset();
  triggered_at_.reset();
  once_z_.clear();
  once_x_.clear();
  due_.clear();
  output_.clear();
  triggers_.clear();
  set_defaults();
}

bool Lps36::happens(double share) { return share > 0 && static_cast<double>(random_() >> 11) * 0x1p-53 < share; }

Mode Lps36::mode() const {
  if (permanent_fault) return Mode::Error;
  if (in_menu) return Mode::Menu;
  return command_mode_ ? Mode::Command : Mode::Measure;
}

bool Lps36::is_triggered() const { return task_.at(task::kOperationMode).values[0] == 1; }

Status Lps36::status() const {
  const bool is_active = task_.at(task::kActivation).values[0] == 0 || active_;
  return {static_cast<std::uint16_t>((connected_ ? 0x0001 : 0) | static_cast<int>(mode()) | (is_active ? 0x0100 : 0) |
                                     (warning ? 0x0200 : 0) | (permanent_fault ? 0x2000 : 0))};
}

Duration Lps36::period() const { return from_s(1 / (kFrequency_hz * (1 + options_.clock_error))); }
Duration Lps36::pause() const { return std::chrono::microseconds(100) * (1 + user_.at(user::kPause).values[0]); }

std::uint32_t Lps36::encoder(TimePoint at) const {
  const double counts = in_s(at - encoder_zero_) * options_.encoder_per_s;
  return encoder_base_ + static_cast<std::uint32_t>(static_cast<std::int64_t>(counts));
}

bool Lps36::measuring() const {
  return connected_ && mode() == Mode::Measure && !is_triggered() && status().activated();
}

std::vector<std::uint16_t> Lps36::parameter(std::uint16_t id) const {
  for (const auto* all : {&user_, &task_})
    if (const auto found = all->find(id); found != all->end()) return found->second.values;
  return {};
}

void Lps36::reply(const Telegram& asked, Id id, TimePoint now, Words words) {
  if (faults.silent || faults.unplugged || happens(datagrams.answers_lost)) return;
  Telegram telegram = drivers::lps36::answer(id, asked.id, status(), std::move(words));
  if (faults.wrong_id) telegram.transaction = static_cast<std::uint16_t>(telegram.transaction + 1);
  if (datagrams.type_zero) telegram.type = 0;
  due_.push_back({now + options_.reply + faults.delay, encode(telegram)});
}

void Lps36::on_frame(ByteView datagram, TimePoint now) {
  if (faults.unplugged) return;
  const auto telegram = drivers::lps36::decode(datagram);
  if (!telegram) {
    ++commands_dropped_;
    return;
  }
  if (encoder_zero_ == TimePoint{}) encoder_zero_ = now;
  if (faults.error_code || in_menu || permanent_fault) return reply(*telegram, Id::Nack, now);
  if (!on_common(*telegram, now)) {
    if (command_mode_)
      on_command(*telegram, now);
    else
      reply(*telegram, Id::Nack, now);
  }
}

/// What is answered in both modes. A mode that it is in already, and a second connect, are refused.
bool Lps36::on_common(const Telegram& telegram, TimePoint now) {
  const auto acknowledge = [&](bool yes) { reply(telegram, yes ? Id::Ack : Id::Nack, now); };
  switch (telegram.id) {
    case Id::Connect:
      // The first answer does not show the connection yet.
      acknowledge(!connected_);
      if (!connected_) {
        hi_connected_ = options_.hi && !telegram.words.empty() && telegram.words[0] == 1;
        connected_ = true;
        command_mode_ = false;
        next_tick(now);
      }
      return true;
    case Id::Disconnect:
      acknowledge(connected_);
      connected_ = hi_connected_ = command_mode_ = false;
      return true;
    case Id::EnterCommandMode: {
      const bool was_in_it = std::exchange(command_mode_, connected_);
      acknowledge(connected_ && !was_in_it);
      return true;
    }
    case Id::ExitCommandMode: {
      const bool was_in_it = std::exchange(command_mode_, false);
      acknowledge(was_in_it);
      next_tick(now);
      return true;
    }
    case Id::Trigger:
      if (mode() != Mode::Measure || !is_triggered() || (triggered_at_ && now - *triggered_at_ < kBetweenTriggers)) {
        ++triggers_ignored_;
        return true;
      }
      triggered_at_ = now;
      triggers_.push_back(now + options_.exposure);
      return true;
    case Id::Activate:
      active_ = !telegram.words.empty() && telegram.words[0] == 1;
      next_tick(now);
      return true;
    default:
      return false;
  }
}

bool Lps36::store(std::map<std::uint16_t, Stored>& all, std::uint16_t id, Words values) {
  const auto found = all.find(id);
  if (found == all.end() || values.size() != found->second.values.size()) return false;
  const Stored& stored = found->second;
  const auto is_in_range = [&](std::uint16_t word) {
    const std::int32_t value = stored.type == kSigned16 ? signed_of(word) : word;
    return value >= stored.min && value <= stored.max;
  };
  if (!std::ranges::all_of(values, is_in_range)) return false;
  if (!ignores_settings) found->second.values = std::move(values);
  return true;
}

void Lps36::on_command(const Telegram& telegram, TimePoint now) {
  const Words& words = telegram.words;
  const auto acknowledge = [&](bool yes) { reply(telegram, yes ? Id::Ack : Id::Nack, now); };
  switch (telegram.id) {
    case Id::SetLaser:
      return acknowledge(words.size() == 1 && words[0] <= 1);
    case Id::MeasureOnce:
      acknowledge(true);
      return measure(now, true);
    case Id::GetZ:
    case Id::GetX:
    case Id::GetZx:
      return read_measured(telegram, now);
    case Id::SetEncoder:
      if (words.size() == 2) {
        encoder_base_ = std::uint32_t{words[1]} << 16 | words[0];
        encoder_zero_ = now;
      }
      return acknowledge(words.size() == 2);
    case Id::GetTask:
      return reply(telegram, Id::Task, now, {task_number_});
    case Id::SetTask: {
      const bool is_known = words.size() == 2 && words[0] <= 15 && words[1] <= 1;
      if (is_known) task_number_ = words[0];  // all tasks share their parameters here
      return acknowledge(is_known);
    }
    case Id::SetScanNumber:
      if (words.size() == 1) scan_ = words[0];
      return acknowledge(words.size() == 1);
    case Id::SetUserParameter:
      return acknowledge(words.size() == 3 && words[0] <= 1 && store(user_, words[1], {words[2]}));
    case Id::SetTaskParameter:
      return acknowledge(words.size() >= 3 && words[0] <= 1 &&
                         store(task_, words[1], {words.begin() + 2, words.end()}));
    case Id::GetUserParameter: {
      const auto found = words.size() == 1 ? user_.find(words[0]) : user_.end();
      return found == user_.end() ? acknowledge(false) : reply(telegram, Id::UserParameter, now, found->second.values);
    }
    case Id::GetTaskParameter: {
      const auto found = words.size() == 1 ? task_.find(words[0]) : task_.end();
      if (found == task_.end()) return acknowledge(false);
      const Stored& stored = found->second;
      const drivers::lps36::Parameter parameter{
          found->first, stored.type, static_cast<std::uint32_t>(stored.min), static_cast<std::uint32_t>(stored.max), 0,
          stored.values};
      return reply(telegram, Id::TaskParameter, now, telegram_of(parameter, status()).words);
    }
    default:
      return acknowledge(false);
  }
}

void Lps36::read_measured(const Telegram& telegram, TimePoint now) {
  if (once_z_.empty() || (telegram.id == Id::GetZx && !hi_connected_)) return reply(telegram, Id::Nack, now);
  // A line of an HI has fewer points; what is read singly is always 376 words long.
  Words z = once_z_, x = once_x_;
  if (telegram.id == Id::GetZx) {
    z.insert(z.end(), x.begin(), x.end());
    return reply(telegram, Id::Zx, now, z);
  }
  z.resize(drivers::lps36::kPoints);
  x.resize(drivers::lps36::kPoints);
  reply(telegram, telegram.id == Id::GetZ ? Id::Z : Id::X, now, telegram.id == Id::GetZ ? z : x);
}

/// The beat begins one period from now.
void Lps36::next_tick(TimePoint now) { tick_ = now + period(); }

void Lps36::measure(TimePoint at, bool triggered) {
  const std::size_t points = options_.hi ? drivers::lps36::kPointsHi : drivers::lps36::kPoints;
  const double count_mm = hi_connected_ ? drivers::lps36::kCountHi_mm : drivers::lps36::kCount_mm;
  const PointLine line = measure_(at, points);
  Measured measured;
  measured.encoder = options_.encoder_per_s != 0 ? encoder(at) : 0;
  measured.status = status();
  if (triggered) measured.status.bits |= 0x0400;
  measured.scan = scan_++;
  ++scans_measured_;
  for (std::size_t i = 0; i < points; ++i) {
    const double z = i < line.z_mm.size() ? std::round(line.z_mm[i] / count_mm) : 0;
    const double x = i < line.x_mm.size() ? std::round(line.x_mm[i] / count_mm) : 0;
    const double z_max = hi_connected_ ? drivers::lps36::kZMaxHi : drivers::lps36::kZMax;
    const bool is_valid = z > 0 && z <= z_max && std::abs(x) <= std::numeric_limits<std::int16_t>::max();
    measured.z.push_back(is_valid ? static_cast<std::uint16_t>(z) : 0);
    measured.x.push_back(is_valid ? static_cast<std::int16_t>(x) : 0);
  }
  if (command_mode_) {
    once_z_ = measured.z;
    once_x_.clear();
    std::ranges::transform(measured.x, std::back_inserter(once_x_), word_of);
    return;
  }
  bool is_z_sent = true, is_x_sent = true;
  if (hi_connected_) {
    measured.part = Measured::Part::Both;
    is_z_sent = is_x_sent = send_measured(measured, at);
  } else {
    measured.z.resize(drivers::lps36::kPoints);
    measured.x.resize(drivers::lps36::kPoints);
    Measured half = measured;
    half.part = Measured::Part::Z;
    half.x.clear();
    is_z_sent = !datagrams.no_z && send_measured(half, at);
    half = measured;
    half.part = Measured::Part::X;
    half.z.clear();
    is_x_sent = !datagrams.no_x && user_.at(user::kXDisabled).values[0] == 0 && send_measured(half, at + pause());
  }
  if (!is_z_sent || !is_x_sent) ++scans_spoiled_;
  if (is_z_sent != is_x_sent) ++scans_halved_;
}

/// False: it was lost.
bool Lps36::send_measured(const Measured& measured, TimePoint at) {
  if (faults.silent || faults.unplugged || happens(datagrams.lost)) return false;
  Telegram telegram = telegram_of(measured);
  if (datagrams.type_zero) telegram.type = 0;
  Bytes frame = encode(telegram);
  if (datagrams.truncated) frame.pop_back();
  if (datagrams.wrong_start) frame[0] = std::byte{0x7F};
  const TimePoint sent = at + faults.delay + (happens(datagrams.late) ? datagrams.late_by : Duration{0});
  if (happens(datagrams.duplicated)) {
    ++copies_sent_;
    due_.push_back({sent + std::chrono::microseconds(random_() % 5000), frame});
  }
  due_.push_back({sent, std::move(frame)});
  return true;
}

void Lps36::on_deadline(TimePoint now) {
  std::ranges::sort(triggers_);
  while (!triggers_.empty() && triggers_.front() <= now) {
    if (connected_ && mode() == Mode::Measure) measure(triggers_.front(), true);
    triggers_.erase(triggers_.begin());
  }
  if (tick_ && now - *tick_ > kLagMax) tick_ = now;
  for (; tick_ && *tick_ <= now; *tick_ += period())
    if (measuring()) measure(*tick_, false);
  release(now);
}

void Lps36::release(TimePoint now) {
  std::ranges::stable_sort(due_, {}, &Due::at);
  const auto later = std::ranges::find_if(due_, [&](const Due& due) { return due.at > now; });
  for (auto due = due_.begin(); due != later; ++due) {
    for (std::size_t hits = faults.garbage ? 1 + due->frame.size() / 16 : 0; hits > 0; --hits)
      due->frame[random_() % due->frame.size()] ^= static_cast<std::byte>(1 + random_() % 255);
    output_.push_back(std::move(due->frame));
  }
  due_.erase(due_.begin(), later);
}

std::vector<Bytes> Lps36::take_frames() {
  if (faults.silent || faults.unplugged) output_.clear();
  return std::exchange(output_, {});
}

std::optional<TimePoint> Lps36::deadline() const {
  std::optional<TimePoint> next;
  for (const Due& due : due_) next = earlier(next, due.at);
  for (const TimePoint at : triggers_) next = earlier(next, at);
  if (tick_ && connected_) next = earlier(next, tick_);
  return next;
}
}  // namespace binpick::emulators
