#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "base/clock.hpp"
#include "base/units.hpp"

/// What every line scanner says, whatever its protocol.
namespace binpick::drivers::scanner {
/// One scan line. Point i lies at (x_mm[i], 0, z_mm[i]) in the scanner frame, z straight ahead.
struct Profile {
  std::uint16_t counter = 0;      ///< The device's scan counter; a gap means lost profiles.
  std::uint32_t encoder = 0;      ///< Of a device with an encoder input, else 0.
  std::vector<float> x_mm, z_mm;  ///< NaN in both where nothing was measured.
  TimePoint received_at;          ///< Of its first byte.
  TimePoint measured_at;          ///< received_at smoothed by the counter: these devices give no time stamp.
};

/// Configured as the device says it was really set.
struct Ready {
  double frequency_hz = 0;          ///< 0: triggered.
  std::optional<Angle> resolution;  ///< Between points, of a device that measures on an even raster of angles.
};
/// "360 profiles/s at 0.250 deg".
std::string in_words(const Ready& ready);
struct ProfileReceived {
  Profile profile;
};
struct Stopped {};  ///< Answer to stop_measuring.
/// Session is Offline again and the link must be reopened (see take_reopen).
struct Failed {
  enum class Why { NoReply, BadTelegram, Refused, NoProfiles, LinkLost } why = Why::NoReply;
  std::string text;
};
using Event = std::variant<Ready, ProfileReceived, Stopped, Failed>;

enum class State { Offline, Starting, Idle, Measuring };
}  // namespace binpick::drivers::scanner
