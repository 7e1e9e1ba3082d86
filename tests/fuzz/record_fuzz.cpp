#include <cstdlib>
#include <span>

#include "base/crc32.hpp"
#include "tests/unit/cycle/records.hpp"

namespace {
using namespace binpick;
using namespace binpick::daemon;

void use(ByteView bytes) {
  const auto record = decode(bytes);
  if (!record) {
    if (record.error().text.empty()) std::abort();
    return;
  }
  // What was understood is written and read again as the same.
  const Bytes written = encode(*record);
  const auto again = decode(written);
  if (!again || encode(*again) != written) std::abort();
}

/// Makes the checksums of all sections right whose length fits.
void seal(std::span<std::byte> file) {
  for (std::size_t at = 12; file.size() - at >= 12;) {
    const std::size_t length = read_le<std::uint32_t>(file, at + 4);
    if (file.size() - at - 12 < length) return;
    const std::uint32_t sum = crc32(ByteView{file}.subspan(at, 8 + length));
    for (std::size_t i = 0; i < 4; ++i) file[at + 8 + length + i] = static_cast<std::byte>(sum >> (8 * i));
    at += 12 + length;
  }
}
}  // namespace

/// Once as it is; once with the checksums made right; once as changes (place, byte) to a good file, sealed again.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* bytes, std::size_t size) {
  const ByteView input = std::as_bytes(std::span(bytes, size));
  use(input);
  if (size >= 12) {
    Bytes sealed{input.begin(), input.end()};
    seal(sealed);
    use(sealed);
  }
  static const Bytes good = encode(record_of_all_fields());
  Bytes file = good;
  for (std::size_t i = 0; i + 2 < size; i += 3)
    file[(static_cast<std::size_t>(bytes[i]) << 8 | bytes[i + 1]) % file.size()] = static_cast<std::byte>(bytes[i + 2]);
  seal(file);
  use(file);
  return 0;
}
