#include "base/log.hpp"

#include <algorithm>
#include <atomic>
#include <cstdarg>
#include <cstdio>
#include <cstdlib>
#include <mutex>
#include <string>
#include <sys/stat.h>
#include <unistd.h>

namespace binpick::log {
namespace {
std::atomic<Level> threshold{Level::Info};
std::mutex sink_mutex;
std::function<void(Level, std::string_view, std::string_view)> sink;

const char* word(Level level) {
  switch (level) {
    case Level::Error:
      return "error";
    case Level::Warning:
      return "warning";
    case Level::Notice:
      return "notice";
    case Level::Info:
      return "info";
    case Level::Debug:
      return "debug";
  }
  return "?";
}

/// systemd sets JOURNAL_STREAM to device:inode of the stderr it gave us; only that stream takes "<n>" prefixes.
bool stderr_is_journal() {
  static const bool is_journal = [] {
    const char* stream = std::getenv("JOURNAL_STREAM");
    struct stat st {};
    if (stream == nullptr || fstat(STDERR_FILENO, &st) != 0) return false;
    unsigned long long device = 0;
    unsigned long long inode = 0;
    return std::sscanf(stream, "%llu:%llu", &device, &inode) == 2 && device == st.st_dev && inode == st.st_ino;
  }();
  return is_journal;
}
}  // namespace

void set_threshold(Level level) { threshold = level; }

void set_sink(std::function<void(Level, std::string_view, std::string_view)> new_sink) {
  const std::lock_guard lock{sink_mutex};
  sink = std::move(new_sink);
}

void write(Level level, const char* topic, const char* format, ...) {
  if (level > threshold) return;
  char text[2048];
  va_list args;
  va_start(args, format);
  const int n = std::vsnprintf(text, sizeof text, format, args);
  va_end(args);
  if (n < 0) return;
  std::string_view body{text, std::min<std::size_t>(static_cast<std::size_t>(n), sizeof text - 1)};
  std::replace(text, text + body.size(), '\n', ' ');
  {
    const std::lock_guard lock{sink_mutex};
    if (sink) {
      sink(level, topic, body);
      return;
    }
  }
  std::string line;
  if (stderr_is_journal()) {
    line = "<" + std::to_string(static_cast<int>(level)) + ">";
  } else {
    line = word(level);
    line += ' ';
  }
  line.append(topic).append(": ").append(body).append("\n");
  [[maybe_unused]] const auto written = ::write(STDERR_FILENO, line.data(), line.size());
}
}  // namespace binpick::log
