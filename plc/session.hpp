#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "base/bytes.hpp"
#include "base/clock.hpp"
#include "base/frames.hpp"
#include "plc/alarms.hpp"
#include "plc/handshake.hpp"
#include "plc/result_codes.hpp"
#include "plc/words.hpp"

/// The PLC's side of the cell: Modbus server, register image and pick handshake, without a socket.
namespace binpick::plc {
enum class PoseConvention {
  UniversalRobots,
  Fanuc,
  Kawasaki
};  ///< m + rotation vector; mm + W P R deg; mm + O A T deg.

struct Options {
  WordOrder word_order = WordOrder::HighWordFirst;
  PoseConvention pose_convention = PoseConvention::UniversalRobots;
  std::uint16_t base_address = 0;  ///< Modbus address (0-based) of register 0 of the map.
  std::vector<std::string> allow;  ///< Peer addresses that may connect; loopback always may.
  std::size_t connections_max = 8;
  std::chrono::milliseconds heartbeat_timeout{
      3000};  ///< PLC's heartbeat word unchanged for this long: alarm. 0: not watched.
  std::chrono::milliseconds scan_timeout{15000};
  std::chrono::milliseconds detect_timeout{5000};
  std::vector<std::uint16_t> part_ids;  ///< Recipes that exist; another id is a result code.
  std::vector<std::uint16_t> supply_ids;
};

using ConnectionId = std::uint32_t;

struct PickRequest {
  std::uint16_t sequence = 0;  ///< 1 … 65535.
  std::uint16_t part_id = 0;
  std::uint16_t supply_id = 0;
};

/// How the cycle went, in numbers; they stand in the result block for whoever wants to draw them.
struct CycleFigures {
  std::uint16_t sweep_ms = 0;
  std::uint16_t profiles = 0;
  std::uint32_t points = 0;
  std::uint32_t hypotheses = 0;
  std::uint16_t detection_ms = 0;
};

struct PickResult {
  ResultCode code = ResultCode::None;
  std::uint16_t pick_id = 0;
  std::uint16_t part_id = 0;
  std::uint16_t objects_left = 0;  ///< Found and not yet picked, this one not counted.
  std::uint16_t fill_level_percent = 0;
  double score = 0;  ///< 0 … 1.
  Transform<frame::Base, frame::Tcp> T_base_approach;
  Transform<frame::Base, frame::Tcp> T_base_grasp;
  CycleFigures figures;
};

/// Bits of the not-ready word: why `ready` is 0.
enum class NotReady : std::uint16_t {
  Pivot = 1 << 0,
  Scanner = 1 << 1,
  Robot = 1 << 2,
  Vision = 1 << 3,
  Configuration = 1 << 4,
  Alarm = 1 << 5,
  CycleRunning = 1 << 6,
  ResultPending = 1 << 7,
  Starting = 1 << 8,
  Stopping = 1 << 9,
};

struct RequestAccepted {
  PickRequest request;
};                          ///< Start a cycle for it.
struct CycleAborted {};     ///< Abort by the PLC: stop what moves, forget the cycle.
struct AnswerWithdrawn {};  ///< Abort by the PLC, no cycle running: what was answered last is not wanted any more.
struct CycleTimedOut {};    ///< The handshake's own deadline passed: same, and a fault stands.
struct ResetRaised {};      ///< The PLC wants to go on after a fault: try the devices again.
struct ResultAcknowledged {
  std::uint16_t sequence;
};
struct RobotClearChanged {
  bool clear;
};
struct PlcLost {};  ///< No connection, or its heartbeat stopped.
struct PlcBack {};
using Event = std::variant<RequestAccepted, CycleAborted, AnswerWithdrawn, CycleTimedOut, ResetRaised,
                           ResultAcknowledged, RobotClearChanged, PlcLost, PlcBack>;

/// Everything the PLC can see or say. Pure but for a private socket pair through which libmodbus answers.
class Session {
 public:
  /// `boot_count` differs from that of the last start: the PLC sees the restart.
  Session(const Options& options, std::uint16_t boot_count);
  ~Session();
  Session(Session&&) noexcept;
  Session& operator=(Session&&) noexcept;

  // The Modbus world, one call per connection event (drivers/link/tcp.hpp, TcpServer).
  bool on_accept(ConnectionId id, const std::string& address, std::uint16_t port, TimePoint now);
  void on_bytes(ConnectionId id, ByteView bytes, TimePoint now);
  void on_closed(ConnectionId id, TimePoint now);
  Bytes take_output(ConnectionId id);
  bool wants_close(ConnectionId id) const;

  void on_deadline(TimePoint now);
  std::optional<TimePoint> deadline() const;
  std::optional<Event> take_event();

  // The cell's world.
  void set_not_ready(std::uint16_t device_reasons, TimePoint now);  ///< NotReady bits of devices; 0: all there.
  bool robot_clear() const;
  void on_scan_done(TimePoint now);                       ///< Robot may enter; detection runs.
  void publish(const PickResult& result, TimePoint now);  ///< Ends the cycle with its result.
  void fault(Alarm alarm, TimePoint now);                 ///< Ends the cycle, if one runs, with a fault; needs a reset.
  void raise(Alarm alarm, TimePoint now);                 ///< An alarm that does not stop the cell.
  void clear(Alarm alarm, TimePoint now);                 ///< Its cause has gone.
  void reconfigure(const Options& options, TimePoint now);  ///< Between cycles: ids, allow-list, time-outs.

  State state() const;
  std::uint16_t register_at(std::uint16_t offset) const;  ///< Word of the map, for tests and records.

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};
}  // namespace binpick::plc
