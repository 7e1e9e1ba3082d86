#include <algorithm>

#include "tests/emulators/plc/plc.hpp"

/// The emulated PLC as a Modbus server: the same program, on registers that the cell reads and writes.
namespace binpick::emulators {
namespace {
constexpr std::uint8_t kReadHolding = 3, kWriteSingle = 6, kWriteMultiple = 16, kException = 0x80;
constexpr std::uint8_t kIllegalFunction = 1, kIllegalAddress = 2, kIllegalValue = 3;
}  // namespace

void Plc::scan(TimePoint now) {
  if (next_poll_ && now < *next_poll_) return;
  next_poll_ = now + options_.scan;
  if (told_) {
    heard_alarms();
    if (!read_once_) check_map();
    program(now);
    read_once_ = true;
  }
  ++heartbeat_;
  std::ranges::copy(request_words(), image_.begin());
}

void Plc::serve(ByteView adu, TimePoint now) {
  const auto function = std::to_integer<std::uint8_t>(adu[7]);
  const Bytes content = answer(function, adu.subspan(8));
  Bytes frame;
  append_be(frame, static_cast<std::uint16_t>(read_be<std::uint16_t>(adu, 0) + (faults.wrong_id ? 1 : 0)));
  append_be<std::uint16_t>(frame, 0);
  append_be(frame, static_cast<std::uint16_t>(1 + content.size()));
  frame.push_back(adu[6]);
  append(frame, content);
  send(std::move(frame), now);
}

Bytes Plc::answer(std::uint8_t function, ByteView content) {
  const auto refuse = [&](std::uint8_t code) {
    return Bytes{static_cast<std::byte>(function | kException), std::byte{code}};
  };
  if (faults.error_code) return refuse(static_cast<std::uint8_t>(*faults.error_code));
  if (content.size() < 4) return refuse(kIllegalValue);
  const std::size_t address = read_be<std::uint16_t>(content, 0);
  const std::size_t second = read_be<std::uint16_t>(content, 2);
  const std::size_t count = function == kWriteSingle ? 1 : second;
  const bool inside = address >= options_.base_address && address + count <= options_.base_address + image_.size();
  const std::size_t first = address - options_.base_address;

  Bytes out{static_cast<std::byte>(function)};
  switch (function) {
    case kReadHolding:
      if (count < 1 || count > 125 || content.size() != 4) return refuse(kIllegalValue);
      if (!inside) return refuse(kIllegalAddress);
      out.push_back(static_cast<std::byte>(2 * count));
      for (std::size_t i = 0; i < count; ++i) append_be(out, image_[first + i]);
      // The cell has looked, and there was no request.
      if (read_once_ && (image_[plc::at("control")] & plc::control::kRequest) == 0) shown_zero_ = true;
      return out;
    case kWriteSingle:
      if (content.size() != 4) return refuse(kIllegalValue);
      if (!inside) return refuse(kIllegalAddress);
      image_[first] = static_cast<std::uint16_t>(second);
      append(out, content);
      return out;
    case kWriteMultiple:
      if (count < 1 || count > 123 || content.size() != 5 + 2 * count ||
          std::to_integer<std::size_t>(content[4]) != 2 * count)
        return refuse(kIllegalValue);
      if (!inside) return refuse(kIllegalAddress);
      for (std::size_t i = 0; i < count; ++i) image_[first + i] = read_be<std::uint16_t>(content, 5 + 2 * i);
      if (first + count == image_.size()) told_ = true;
      append(out, content.subspan(0, 4));
      return out;
    default:
      return refuse(kIllegalFunction);
  }
}
}  // namespace binpick::emulators
