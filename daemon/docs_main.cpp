#include <cstdio>

#include "daemon/sequence_docs.hpp"

/// Writes docs/cell-sequence.md to stdout.
int main() { std::fputs(binpick::daemon::sequence_markdown().c_str(), stdout); }
