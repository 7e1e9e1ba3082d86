#pragma once

namespace binpick::daemon {
/// Before the first thread starts: all threads share one heap, of which all that is spare can be given back. With a
/// heap of each thread (glibc's way) the C library keeps the end of each at the highest that any scan so far has
/// needed.
void share_one_heap();

/// Gives the memory that is free back to the system, or it would stay what the largest scan so far has needed. What
/// allocates at that time waits for some milliseconds, so: when nobody waits for an answer. Does nothing where the C
/// library does not know how to.
void give_back_spare_memory();
}  // namespace binpick::daemon
