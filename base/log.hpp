#pragma once

#include <functional>
#include <string_view>

namespace binpick::log {
/// Numbers are syslog's, written as "<4>" when stderr is the journal, as a word otherwise.
enum class Level { Error = 3, Warning = 4, Notice = 5, Info = 6, Debug = 7 };

/// One line, one write(2): "info plc: request raised, cycle=118". Checked like printf by the compiler. Thread-safe.
/// A line break in the text is written as a space: one event is one line.
[[gnu::format(printf, 3, 4)]] void write(Level level, const char* topic, const char* format, ...);
/// Lines below this urgency are dropped. Default: Info.
void set_threshold(Level level);
/// Sends lines to `sink` instead of stderr (tests); an empty function restores stderr.
void set_sink(std::function<void(Level, std::string_view topic, std::string_view text)> sink);
}  // namespace binpick::log

#define BINPICK_LOG(level, topic, ...) ::binpick::log::write(::binpick::log::Level::level, topic, __VA_ARGS__)
