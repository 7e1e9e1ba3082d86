#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdlib>

#include "drivers/pivot/motion_codec.hpp"
#include "drivers/pivot/motion_errors.hpp"

/// Arbitrary frames of one sender through the assembler, and what it makes of them through both decoders. Input: the
/// unit system, then frames of a length byte and its bytes.
namespace {
using namespace binpick;
using namespace binpick::drivers::pivot;

void require(bool condition) {
  if (!condition) std::abort();
}
}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size == 0) return 0;
  const auto units = static_cast<motion::UnitSystem>(data[0] % (motion::kUnitSystemMax + 1));
  motion::Assembler assembler;
  for (std::size_t at = 1; at < size;) {
    CanFrame frame;
    frame.id = motion::kReplyBase + 12;
    frame.length = data[at++];  // more than 8, too: what a broken link may hand over
    for (std::size_t i = 0; i < frame.payload.size() && i < frame.length && at < size; ++i)
      frame.payload[i] = data[at++];
    const auto message = assembler.take(frame);
    if (!message) {
      require(!to_string(message.error()).empty());
      continue;
    }
    if (!*message) continue;
    require((*message)->parameters.size() <= 254);
    // A message goes through frames and comes back as it was.
    motion::Assembler again;
    std::optional<motion::Message> whole;
    for (const CanFrame& part : frames_of(frame.id, **message)) {
      const auto taken = again.take(part);
      // Only the fragment bytes themselves can never be a message's command.
      const bool fragment = (*message)->command >= 0x84 && (*message)->command <= 0x86;
      require(static_cast<bool>(taken) || fragment);
      if (taken) whole = *taken;
    }
    if (whole) require(*whole == **message || ((*message)->command >= 0x84 && (*message)->command <= 0x86));
    if (const auto reply = decode_reply(**message, units)) {
      if (const auto* report = std::get_if<motion::StateReport>(&*reply)) {
        require(std::isfinite(report->position_rad.value_or(0)));
        require(!motion::error_in_words(report->error).empty());
        static_cast<void>(motion::state_word(report->state, report->error));
      }
      const auto back = decode_reply(encode(*reply, units), units);
      require(back && back->index() == reply->index());
    }
    if (const auto request = decode_request(**message, units)) {
      const auto back = decode_request(encode(*request, units), units);
      require(back && back->index() == request->index());
    }
  }
  return 0;
}
