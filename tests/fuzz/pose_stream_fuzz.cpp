#include <algorithm>
#include <cstddef>
#include <cstdint>

#include "base/check.hpp"
#include "base/log.hpp"
#include "drivers/robot/pose_stream.hpp"

/// Lines as a robot's background program, or anybody else, might send them: to the codec first, then to a session. The
/// first byte names the dialect; a row of pieces follows, each with a byte that says how long it is and what passes.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace binpick;
  using namespace binpick::drivers::robot;
  log::set_threshold(log::Level::Error);
  if (size == 0) return 0;
  constexpr Dialect kDialects[] = {Dialect::UniversalRobots, Dialect::Fanuc, Dialect::Kawasaki};
  const Dialect dialect = kDialects[*data++ % 3];
  --size;
  const std::string_view text{reinterpret_cast<const char*>(data), size};
  if (const auto line = decode_pose_line(text, dialect)) {
    // What was read can be said again, and is read the same (a time is written in tenths).
    PoseLine said = *line;
    said.time_ms = std::min(said.time_ms, kPoseTimeWrap_ms - 1);
    std::string again = encode(said, dialect);
    again.resize(again.size() - 2);
    const auto second = decode_pose_line(again, dialect);
    BINPICK_CHECK(second.has_value() && second->sequence == line->sequence);
    BINPICK_CHECK((second->T_base_sent.translation() - line->T_base_sent.translation()).norm() < 0.01);
  }

  PoseStream stream{{.dialect = dialect}};
  TimePoint now{std::chrono::hours(1)};
  stream.on_connected(now);
  PoseLine line;
  while (size > 0) {
    const std::uint8_t step = data[0];
    const std::size_t length = std::min<std::size_t>(size - 1, step & 0x3F);
    now += std::chrono::milliseconds(step >> 2);
    if (step == 0x40) stream.on_disconnected(now);
    if (step == 0x41) stream.on_connected(now);
    if (step == 0x42)  // many good lines, so that the clock settles
      for (int i = 0; i < 64; ++i) {
        now += std::chrono::milliseconds(100);
        line.time_ms += 100;
        line.sequence = static_cast<std::uint16_t>((line.sequence + 1) % kPoseSequences);
        if (line.time_ms < kPoseTimeWrap_ms) stream.on_bytes(as_bytes(encode(line, dialect)), now);
      }
    stream.on_bytes(std::as_bytes(std::span{data + 1, length}), now);
    data += 1 + length;
    size -= 1 + length;
    if (stream.deadline() && *stream.deadline() <= now) stream.on_deadline(now);
    BINPICK_CHECK(!stream.deadline() || *stream.deadline() > now);
    while (const auto event = stream.take_event())
      if (const auto* got = std::get_if<PoseSample>(&*event))
        BINPICK_CHECK(got->T_base_flange.iso.matrix().allFinite() && got->at <= now + std::chrono::microseconds(1));
    BINPICK_CHECK(stream.take_output().empty());
    if (stream.take_reopen() || stream.state() == PoseState::Offline) stream.on_connected(now);
  }
  return 0;
}
