#pragma once

namespace binpick::bench {
/// Of the sources that this program was built from; "+" and a hash of the changes where it was not committed.
extern const char* const kCommit;
}  // namespace binpick::bench
