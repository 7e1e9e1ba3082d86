#pragma once

namespace binpick {
/// Logs what failed and where, and aborts: for our own errors only, never for input. systemd restarts us, the PLC sees
/// the heartbeat stop, and what moves stops by its own means.
[[noreturn]] void check_failed(const char* condition, const char* file, int line);
}  // namespace binpick

#define BINPICK_CHECK(condition) \
  (static_cast<bool>(condition) ? void(0) : ::binpick::check_failed(#condition, __FILE__, __LINE__))
