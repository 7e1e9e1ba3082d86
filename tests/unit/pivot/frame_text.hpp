#pragma once

#include <cstdio>
#include <string>

#include "drivers/link/can.hpp"

/// CAN frames as they stand in the byte tables: "0CC [2] 0A 3C".
namespace binpick::drivers::pivot {
inline link::CanFrame frame(const std::string& text) {
  link::CanFrame f;
  f.id = static_cast<std::uint32_t>(std::stoul(text.substr(0, 3), nullptr, 16));
  f.length = static_cast<std::uint8_t>(text[5] - '0');
  for (std::size_t i = 0; i < f.length; ++i)
    f.payload[i] = static_cast<std::uint8_t>(std::stoul(text.substr(8 + 3 * i, 2), nullptr, 16));
  return f;
}

inline std::string text_of(const link::CanFrame& f) {
  char text[48];
  int at = std::snprintf(text, sizeof text, "%03X [%d]", f.id, f.length);
  for (std::size_t i = 0; i < f.length; ++i)
    at += std::snprintf(text + at, sizeof text - static_cast<std::size_t>(at), " %02X", f.payload[i]);
  return text;
}
}  // namespace binpick::drivers::pivot
