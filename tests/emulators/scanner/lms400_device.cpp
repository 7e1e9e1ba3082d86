#include "tests/emulators/scanner/lms400_device.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>

namespace binpick::emulators {
namespace {
using drivers::lms400::Format;
using drivers::lms400::Measured;
using drivers::lms400::Request;
using drivers::lms400::Text;

// sFA codes, as newer devices of the maker use them.
constexpr std::uint32_t kAccessDenied = 0x1, kUnknownMethod = 0x2, kUnknownVariable = 0x3, kInvalidArgument = 0x5,
                        kTooFewArguments = 0x8, kWriteDenied = 0xA, kUnknownCommand = 0xC, kBusy = 0xD;
/// A host that cannot keep up loses lines. Those that are sent are hardly late, as a device's: on a busy machine that
/// would turn the picture by what the pivot moves meanwhile.
constexpr Duration kLagMax = std::chrono::milliseconds(8);

double rounded(double value, double step) { return step > 0 ? std::round(value / step) * step : value; }
}  // namespace

Lms400::Lms400(Measure measure) : Lms400{std::move(measure), Options{}} {}

Lms400::Lms400(Measure measure, const Options& options)
    : measure_{std::move(measure)},
      options_{options},
      frequency_hz_{options.frequency_hz},
      resolution_deg_{options.resolution_deg},
      counter_offset_{options.first_counter},
      random_{options.seed} {}

Duration Lms400::period() const { return from_s(1 / (frequency_hz_ * (1 + options_.clock_error))); }

TimePoint Lms400::middle_of(std::int64_t scan) const {
  return *epoch_ + from_s(static_cast<double>(scan) / (frequency_hz_ * (1 + options_.clock_error)));
}

void Lms400::on_connected(TimePoint now) {
  now_ = now;
  connected_ = true;
  closing_ = false;
  level_ = 0;
  received_.clear();
  output_.clear();
  due_.clear();
  if (!epoch_) epoch_ = now;
}

void Lms400::on_disconnected(TimePoint now) {
  now_ = now;
  connected_ = closing_ = false;
  level_ = 0;
  due_.clear();
  output_.clear();
  if (!options_.streams_on_after_close) format_.reset();
}

bool Lms400::wants_close() const { return connected_ && (closing_ || faults.unplugged); }

void Lms400::answer(const std::string& text, TimePoint at) {
  if (!faults.silent) due_.push_back({at + faults.delay, encode(Text{text})});
}

void Lms400::refuse(std::uint32_t code, TimePoint now) {
  char text[16];
  std::snprintf(text, sizeof text, "sFA %X", code);
  answer(text, now + options_.reply);
}

void Lms400::finish(const std::string& name, const std::string& result, TimePoint now, Duration extra) {
  answer("sMA " + name, now + options_.reply);
  answer("sAN " + name + ' ' + result, now + options_.reply + options_.method + extra);
}

void Lms400::on_bytes(ByteView bytes, TimePoint now) {
  now_ = now;
  if (faults.unplugged || !connected_) return;
  append(received_, bytes);
  std::size_t at = 0;
  while (at < received_.size()) {
    const ByteView rest = ByteView{received_}.subspan(at);
    const auto decoded = drivers::lms400::decode(rest);
    if (!decoded) {
      using Kind = drivers::lms400::DecodeError::Kind;
      ++commands_dropped_;
      if (decoded.error().kind == Kind::BadChecksum) {
        // The whole frame goes, or, where checksums do not count, is taken as it is.
        const std::size_t length = read_be<std::uint32_t>(rest, 4);
        if (!options_.checks_checksum) {
          --commands_dropped_;
          on_command(std::string{as_text(rest.subspan(8, length))}, now);
          at += length + drivers::lms400::kFramingBytes;
          continue;
        }
      }
      at += decoded.error().skip;
      continue;
    }
    if (!*decoded) break;
    at += (*decoded)->consumed;
    if (const Text* text = std::get_if<Text>(&(*decoded)->message))
      on_command(text->text, now);
    else
      ++commands_dropped_;
  }
  received_.erase(received_.begin(), received_.begin() + static_cast<std::ptrdiff_t>(std::min(at, received_.size())));
}

void Lms400::on_command(const std::string& text, TimePoint now) {
  if (faults.error_code) return refuse(*faults.error_code, now);
  const auto request = drivers::lms400::parse_request(text);
  if (!request) return refuse(kUnknownCommand, now);
  if (request->verb == "sMN") return call(*request, now);
  if (request->verb == "sWN") return write(*request, now);
  if (request->verb == "sRN") return read(*request, now);
  // sRI n: by index; only the serial number is known.
  if (request->name != "3") return refuse(kUnknownMethod, now);
  answer("sRA 0003 0008 12345678", now + options_.reply);
}

void Lms400::read(const Request& request, TimePoint now) {
  if (request.name == "EIip") return answer("sRA EIip C0 A8 0 1", now + options_.reply);
  if (request.name == "EImask") return answer("sRA EImask FF FF FF 0", now + options_.reply);
  if (request.name == "EIgate") return answer("sRA EIgate C0 A8 0 FE", now + options_.reply);
  if (request.name == "EImac") return answer("sRA EImac 00-06-77-12-34-56", now + options_.reply);
  refuse(kUnknownVariable, now);
}

void Lms400::write(const Request& request, TimePoint now) {
  struct Variable {
    const char* name;
    std::size_t arguments;
    double min, max;  // of each
  };
  static constexpr Variable variables[]{{"FLsel", 1, 0, 15},   {"FLmean", 2, 0, 200}, {"FLrang", 2, 0, 3600},
                                        {"MDblex", 1, 0, 1},   {"IOencm", 1, 0, 4},   {"EIip", 4, 0, 255},
                                        {"EImask", 4, 0, 255}, {"EIgate", 4, 0, 255}, {"EIport", 1, 1, 65535}};
  const auto* variable = std::ranges::find_if(variables, [&](const auto& v) { return request.name == v.name; });
  if (variable == std::end(variables)) return refuse(kUnknownVariable, now);
  if (level_ < 4) return refuse(kWriteDenied, now);
  if (request.arguments.size() < variable->arguments) return refuse(kTooFewArguments, now);
  for (const std::string& word : request.arguments) {
    // FLrang's limits are decimal fractions, all others are whole.
    std::optional<double> value = drivers::lms400::parse_decimal(word);
    if (request.name != "FLrang") {
      const auto whole = drivers::lms400::parse_integer(word);
      value = whole ? std::optional<double>{static_cast<double>(*whole)} : std::nullopt;
    }
    if (!value || *value < variable->min || *value > variable->max) return refuse(kInvalidArgument, now);
  }
  answer("sWA " + request.name, now + options_.reply);
}

void Lms400::call(const Request& request, TimePoint now) {
  const auto& arguments = request.arguments;
  const auto decimal = [&](std::size_t i) { return drivers::lms400::parse_decimal(arguments[i]); };
  if (now < busy_until_) return refuse(kBusy, now);
  if (request.name == "SetAccessMode") {
    if (arguments.size() < 2) return refuse(kTooFewArguments, now);
    const auto level = drivers::lms400::parse_integer(arguments[0]);
    const bool right = (level == 4 && arguments[1] == "81BE23AA") || (level == 3 && arguments[1] == "F4724744");
    if (right) level_ = static_cast<int>(*level);
    return finish(request.name, right ? "1" : "0", now);
  }
  if (request.name == "Run") {
    level_ = 0;
    return finish(request.name, "1", now);
  }
  if (request.name == "mLRstopdata") {
    format_.reset();
    return finish(request.name, "00000000", now);
  }
  if (request.name == "mLRreqdata") {
    if (arguments.empty()) return refuse(kTooFewArguments, now);
    const auto format = drivers::lms400::parse_integer(arguments[0]);
    if (!format || *format < 0x20 || *format > 0x22) return refuse(kInvalidArgument, now);
    const Duration settle = std::max(Duration{0}, motor_ready_at_ - now);
    finish(request.name, "00000000", now, settle);
    format_ = static_cast<Format>(*format);
    measures_from_ = now + options_.reply + options_.method + settle;
    next_scan_ = static_cast<std::int64_t>(std::ceil(in_s(*measures_from_ - *epoch_) / in_s(period())));
    return;
  }
  if (request.name == "mSCsetscanconfig") {
    if (arguments.size() < 4) return refuse(kTooFewArguments, now);
    const auto f = decimal(0), r = decimal(1), start = decimal(2), range = decimal(3);
    if (!f || !r || !start || !range) return refuse(kInvalidArgument, now);
    return set_scan(request.name, *f, *r, *start, *range, now);
  }
  if (request.name == "mSCconfigbyang" || request.name == "mSCconfigbyfreq") {
    if (arguments.size() < 6) return refuse(kTooFewArguments, now);
    const auto level = drivers::lms400::parse_integer(arguments[0]);
    const bool right = (level == 4 && arguments[1] == "81BE23AA") || (level == 3 && arguments[1] == "F4724744");
    if (!right) return refuse(kAccessDenied, now);
    const auto value = decimal(2), start = decimal(4), range = decimal(5);
    if (!value || !start || !range) return refuse(kInvalidArgument, now);
    const bool by_angle = request.name == "mSCconfigbyang";
    return set_scan(request.name, by_angle ? frequency_hz_ : *value, by_angle ? *value : resolution_deg_, *start,
                    *range, now);
  }
  if (request.name == "mDCreset") {
    if (level_ < 4) return refuse(kAccessDenied, now);
    answer("sMA mDCreset", now);  // the one reply that comes
    release(now);
    closing_ = true;
    format_.reset();
    frequency_hz_ = options_.frequency_hz;
    resolution_deg_ = options_.resolution_deg;
    motor_ready_at_ = now + options_.spin_up;
    return;
  }
  refuse(kUnknownMethod, now);
}

void Lms400::set_scan(const std::string& name, double frequency_hz, double resolution_deg, double start_deg,
                      double range_deg, TimePoint now) {
  constexpr double slack = 1e-6;
  if (frequency_hz < 150 || frequency_hz > 500 || resolution_deg < 0.1 - slack || resolution_deg > 1 + slack ||
      start_deg < 55 - slack || range_deg <= 0 || start_deg + range_deg > 125 + slack)
    return refuse(kInvalidArgument, now);
  const double f = rounded(frequency_hz, options_.frequency_step_hz);
  const double r = rounded(resolution_deg, options_.resolution_step_deg);
  const bool possible = f * range_deg / r <= options_.points_per_s_max;
  Duration settle{0};
  if (possible) {
    if (f != frequency_hz_) {
      settle = options_.spin_up;
      motor_ready_at_ = now + options_.reply + options_.method + settle;
      // The beat begins anew; the counter goes on from where it was.
      counter_offset_ =
          static_cast<std::uint16_t>(counter_offset_ + static_cast<std::int64_t>(in_s(now - *epoch_) / in_s(period())));
      epoch_ = now;
    }
    frequency_hz_ = f;
    resolution_deg_ = r;
    start_deg_ = start_deg;
    range_deg_ = range_deg;
    format_.reset();
    busy_until_ = motor_ready_at_;
  }
  finish(name,
         std::string{possible ? "00000000 " : "00000001 "} + drivers::lms400::to_float_hex(frequency_hz_) + ' ' +
             drivers::lms400::to_float_hex(resolution_deg_) + " 00000008",
         now, settle);
}

void Lms400::measure_lines(TimePoint now) {
  if (!format_ || !measures_from_ || !epoch_) return;
  if (now - middle_of(next_scan_) > kLagMax)
    next_scan_ = static_cast<std::int64_t>(in_s(now - *epoch_) / in_s(period()));
  for (; middle_of(next_scan_) <= now; ++next_scan_) {
    if (faults.silent || faults.unplugged || !connected_) continue;
    Measured m;
    m.format = *format_;
    m.start_1e4deg = static_cast<std::int32_t>(std::lround(start_deg_ * 1e4));
    m.step_1e4deg = static_cast<std::uint16_t>(std::lround(resolution_deg_ * 1e4));
    m.frequency_hz = static_cast<std::uint16_t>(std::lround(frequency_hz_));
    const auto points = static_cast<std::size_t>(std::lround(range_deg_ / resolution_deg_));
    const TimePoint middle = middle_of(next_scan_);
    const ScanLine line = measure_(middle, Angle::deg(start_deg_), Angle::deg(resolution_deg_), points);
    for (std::size_t i = 0; i < points; ++i) {
      const float range = i < line.range_mm.size() ? line.range_mm[i] : 0.F;
      if (m.format != Format::Remission)
        m.distance.push_back(range > 0 && range < 65535 ? static_cast<std::uint16_t>(std::lround(range)) : 0);
      if (m.format != Format::Distance) m.remission.push_back(i < line.remission.size() ? line.remission[i] : 0);
    }
    m.trailer[7] = m.trailer[8] = static_cast<std::uint16_t>(next_scan_ + counter_offset_);
    due_.push_back({middle + faults.delay, encode(m)});
    ++telegrams_sent_;
  }
}

void Lms400::release(TimePoint now) {
  std::ranges::stable_sort(due_, {}, &Due::at);
  while (!due_.empty() && due_.front().at <= now) {
    Bytes& frame = due_.front().frame;
    if (faults.garbage) {
      const std::size_t hits = 1 + frame.size() / 16;
      for (std::size_t i = 0; i < hits; ++i) {
        std::byte& b = frame[random_() % frame.size()];
        b ^= static_cast<std::byte>(1 + random_() % 255);
      }
    }
    append(output_, frame);
    due_.pop_front();
  }
}

void Lms400::on_deadline(TimePoint now) {
  now_ = now;
  if (connected_ || options_.streams_on_after_close) measure_lines(now);
  release(now);
}

std::optional<TimePoint> Lms400::deadline() const {
  std::optional<TimePoint> next;
  if (!connected_) return next;
  for (const Due& due : due_) next = earlier(next, due.at);
  if (format_) next = earlier(next, middle_of(next_scan_));
  if (!output_.empty()) next = earlier(next, now_);
  return next;
}

Bytes Lms400::take_output() {
  if (faults.silent || faults.unplugged) output_.clear();
  Bytes out;
  if (faults.split_every_byte && !output_.empty()) {
    out.push_back(output_.front());
    output_.erase(output_.begin());
  } else {
    out.swap(output_);
  }
  if (faults.disconnect_after_bytes != cut_after_) {
    cut_after_ = faults.disconnect_after_bytes;
    sent_since_ = 0;
  }
  if (cut_after_ && sent_since_ + out.size() >= *cut_after_) {
    out.resize(*cut_after_ - sent_since_);
    output_.clear();
    due_.clear();
    format_.reset();
    closing_ = true;
    faults.disconnect_after_bytes.reset();  // once
    cut_after_.reset();
  }
  sent_since_ += out.size();
  return out;
}
}  // namespace binpick::emulators
