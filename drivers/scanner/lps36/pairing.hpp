#pragma once

#include <array>
#include <cstdint>
#include <deque>
#include <map>
#include <optional>
#include <vector>

#include "base/clock.hpp"
#include "drivers/scanner/lps36/codec.hpp"

namespace binpick::drivers::lps36 {
/// One scan line, in counts.
struct Line {
  std::uint16_t scan = 0;
  std::uint32_t encoder = 0;
  bool hi = false;               ///< Counts are hundredths of a millimetre, else tenths.
  std::vector<std::uint16_t> z;  ///< As many as x.
  std::vector<std::int16_t> x;
  TimePoint received_at;  ///< Of the half that came first.
};

/// Z and X telegrams joined by their scan number, handed out in the order of the scans. The network may lose, overtake
/// and repeat datagrams; the counts say what it did.
///
/// A line is waited for, and what is newer with it, until `hold` after something newer has come. Then it is lost. A
/// half that comes later still is late. A scan number that fits nothing is put aside; a second one that fits it means
/// that the sensor counts anew (it was switched off, or its number was set).
class Pairing {
 public:
  struct Counts {
    std::uint64_t lines = 0;       ///< Handed out.
    std::uint64_t lost = 0;        ///< Scans between the first and the newest line without a line of theirs.
    std::uint64_t halves = 0;      ///< Of the lost: one half had come.
    std::uint64_t overtaken = 0;   ///< Telegrams that came in time, yet after a newer one.
    std::uint64_t late = 0;        ///< Telegrams of scans that were lost already.
    std::uint64_t duplicates = 0;  ///< Telegrams that had come before.
    std::uint64_t strays = 0;      ///< Telegrams whose scan number fitted nothing.
    std::uint64_t jumps = 0;       ///< Times that the sensor began to count anew.
    friend bool operator==(const Counts&, const Counts&) = default;
  };

  explicit Pairing(Duration hold = std::chrono::milliseconds(30)) : hold_{hold} {}

  void restart();  ///< Forgets everything, counts as well.
  void add(Measured measured, TimePoint now);
  void on_deadline(TimePoint now);
  std::optional<TimePoint> deadline() const { return deadline_; }
  /// No more will come: hands out what is complete. Halves after the last whole line count as nothing: the sensor may
  /// have been stopped between Z and X.
  void flush();
  std::optional<Line> take_line();
  const Counts& counts() const { return counts_; }

 private:
  struct Waiting {
    TimePoint first_at;
    unsigned parts = 0;  // bits of what has come
    Line line;
  };
  /// What came of a scan that is done with.
  struct Done {
    std::int64_t scan = -1;
    unsigned parts = 0;
  };
  /// Scan numbers further than this from the newest fit nothing; so long a scan that is done with is remembered.
  static constexpr std::int64_t kFar = 256;
  static constexpr std::size_t kWaitingMax = 64;

  bool fits(const Measured& measured) const;
  void put_aside(Measured measured, TimePoint now);
  void accept(Measured measured, TimePoint now);
  void release(TimePoint now);
  void finish_next();
  Done& done(std::int64_t scan) { return done_[static_cast<std::size_t>(scan % kFar)]; }

  Duration hold_;
  // Scans are counted on without wrapping, from 65536 on: none is ever negative.
  std::int64_t newest_ = 0, next_ = 0, newest_telegram_ = 0;
  bool began_ = false;          // something has come
  bool handed_out_ = false;     // the first line is out, from here on scans are lost
  bool next_is_fixed_ = false;  // nothing older than next_ may come first any more
  std::map<std::int64_t, Waiting> waiting_;
  std::array<Done, kFar> done_{};
  struct Aside {
    Measured measured;
    TimePoint at;
  };
  std::optional<Aside> aside_;
  std::optional<TimePoint> deadline_;
  std::deque<Line> lines_;
  Counts counts_;
};
}  // namespace binpick::drivers::lps36
