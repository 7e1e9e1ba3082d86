#pragma once

#include <string>

#include "base/bytes.hpp"
#include "base/expected.hpp"
#include "daemon/cycle/record.hpp"

/// The file of a record, all little-endian (docs/records.md):
///   8 bytes "BINPICKR", u32 format version;
///   sections: u32 name (four letters), u32 length, so many bytes, u32 CRC-32 of name, length and bytes;
///   the last one is "end.": without it the file is cut off.
/// Only the section "orig" is always there, and first. A reader skips sections that it does not know, and what follows
/// in a section or list entry after the fields that it knows: a later version may have added them; what an earlier one
/// did not write yet has its default.
namespace binpick::daemon {
inline constexpr std::uint32_t kRecordVersion = 1;

struct RecordError {
  enum class Kind {
    CannotRead,  ///< The file.
    NotARecord,
    Version,  ///< Of a later format.
    CutOff,   ///< Its writing did not come to an end.
    Damaged,  ///< A checksum is wrong, or something stands behind the end.
    Content,  ///< Sound bytes that say something impossible.
  } kind = Kind::NotARecord;
  std::string text;  ///< What is wrong, and where.
};

Bytes encode(const Record& record);
Expected<Record, RecordError> decode(ByteView bytes);
/// Of a file; the error's text begins with its path.
Expected<Record, RecordError> read_record(const std::string& path);
}  // namespace binpick::daemon
