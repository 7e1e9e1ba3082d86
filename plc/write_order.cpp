#include "plc/write_order.hpp"

#include <algorithm>

#include "plc/modbus_request.hpp"

namespace binpick::plc {
namespace {
constexpr std::uint16_t kFlags = at("status");
static_assert(kStatusLength + kResultLength <= modbus::kWriteWordsMax, "status and result are written in one request");
}  // namespace

std::optional<Write> next_write(Map there, Map ours, bool everything) {
  const auto differ = [&](std::size_t first, std::size_t count) {
    return !std::ranges::equal(there.subspan(first, count), ours.subspan(first, count));
  };
  const bool result = everything || differ(kResultFirst, kResultLength);
  const bool words =
      result || differ(kStatusFirst, kFlags - kStatusFirst) || differ(kFlags + 1, kResultFirst - kFlags - 1);
  if (words) {
    std::uint16_t low = there[kFlags] & ours[kFlags];
    if (result) low &= static_cast<std::uint16_t>(~status::kResultValid);
    if (there[kFlags] != low) return Write{kFlags, {low}};
    const auto block = ours.subspan(kStatusFirst, kStatusLength + (result ? kResultLength : 0));
    Write write{kStatusFirst, {block.begin(), block.end()}};
    write.words[kFlags - kStatusFirst] = low;
    return write;
  }
  if (there[kFlags] != ours[kFlags]) return Write{kFlags, {ours[kFlags]}};
  return std::nullopt;
}
}  // namespace binpick::plc
