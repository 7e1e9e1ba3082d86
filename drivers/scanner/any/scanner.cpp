#include "drivers/scanner/any/scanner.hpp"

#include <array>
#include <cstdio>

#include "base/overloaded.hpp"

namespace binpick::drivers::scanner {
namespace {
std::variant<lms400::Session, lps36::Session> session_of(const Options& options) {
  if (const auto* lps36 = std::get_if<lps36::Options>(&options)) return lps36::Session{*lps36};
  return lms400::Session{std::get<lms400::Options>(options)};
}
}  // namespace

std::string model_name(const Options& options) {
  if (const auto* lps36 = std::get_if<lps36::Options>(&options)) return lps36->hi ? "Leuze LPS 36 HI" : "Leuze LPS 36";
  return "SICK LMS 400";
}

std::string in_words(const Ready& ready) {
  std::array<char, 64> text{};
  const int n = ready.frequency_hz > 0 ? std::snprintf(text.data(), text.size(), "%.0f profiles/s", ready.frequency_hz)
                                       : std::snprintf(text.data(), text.size(), "triggered");
  if (ready.resolution)
    std::snprintf(text.data() + n, text.size() - static_cast<std::size_t>(n), " at %.3f deg",
                  ready.resolution->in_deg());
  return text.data();
}

Scanner::Scanner(const Options& options) : device_{session_of(options)} {}

void Scanner::on_bytes(ByteView bytes, TimePoint now) {
  std::visit(Overloaded{[&](lms400::Session& stream) { stream.on_bytes(bytes, now); },
                        [&](lps36::Session& datagrams) { datagrams.on_frame(bytes, now); }},
             device_);
}

std::vector<Bytes> Scanner::take_frames() {
  if (auto* datagrams = std::get_if<lps36::Session>(&device_)) return datagrams->take_frames();
  Bytes piece = take_output();
  return piece.empty() ? std::vector<Bytes>{} : std::vector<Bytes>{std::move(piece)};
}

Bytes Scanner::take_output() {
  auto* stream = std::get_if<lms400::Session>(&device_);
  return stream != nullptr ? stream->take_output() : Bytes{};
}

void Scanner::on_connected(TimePoint now) {
  std::visit([&](auto& device) { device.on_connected(now); }, device_);
}
void Scanner::on_disconnected(TimePoint now) {
  std::visit([&](auto& device) { device.on_disconnected(now); }, device_);
}
void Scanner::on_deadline(TimePoint now) {
  std::visit([&](auto& device) { device.on_deadline(now); }, device_);
}
std::optional<TimePoint> Scanner::deadline() const {
  return std::visit([](const auto& device) { return device.deadline(); }, device_);
}
std::optional<Event> Scanner::take_event() {
  return std::visit([](auto& device) { return device.take_event(); }, device_);
}
bool Scanner::take_reopen() {
  return std::visit([](auto& device) { return device.take_reopen(); }, device_);
}
State Scanner::state() const {
  return std::visit([](const auto& device) { return device.state(); }, device_);
}
void Scanner::start_measuring(TimePoint now) {
  std::visit([&](auto& device) { device.start_measuring(now); }, device_);
}
void Scanner::stop_measuring(TimePoint now) {
  std::visit([&](auto& device) { device.stop_measuring(now); }, device_);
}
std::uint64_t Scanner::profiles_lost() const {
  return std::visit([](const auto& device) { return device.profiles_lost(); }, device_);
}
}  // namespace binpick::drivers::scanner
