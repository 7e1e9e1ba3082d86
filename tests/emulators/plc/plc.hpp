#pragma once

#include <array>
#include <cstdint>
#include <deque>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "base/bytes.hpp"
#include "base/clock.hpp"
#include "base/frames.hpp"
#include "plc/registers.hpp"
#include "plc/session.hpp"
#include "tests/emulators/faults.hpp"

namespace binpick::emulators {
struct PlcOptions {
  plc::WordOrder word_order = plc::WordOrder::HighWordFirst;
  plc::PoseConvention pose_convention = plc::PoseConvention::UniversalRobots;
  std::uint16_t base_address = 0;
  plc::LineRole cell_role = plc::LineRole::Server;     ///< What the cell is on the line; the PLC is the other.
  Duration poll = std::chrono::milliseconds(30);       ///< One write and one read per poll, as two MB_CLIENT jobs.
  Duration scan = std::chrono::milliseconds(10);       ///< As a server: the program runs this often.
  Duration reply_timeout = std::chrono::seconds(2);    ///< MB_CLIENT's RCV_TIMEOUT; then it connects anew.
  Duration answer_timeout = std::chrono::seconds(40);  ///< Automatic: no answer to a request for this long: abort.
  bool automatic = false;                              ///< Requests pick after pick and resets faults by itself.
  Duration pick_time{
      0};             ///< Automatic: after a pick was found, robot_clear is 0 for this long before the next request.
  Duration pause{0};  ///< Automatic: wait between an answer and the next request.
  std::uint16_t part_id = 1;
  std::uint16_t supply_id = 1;
};

/// The result block as a PLC program decodes it.
struct PlcResult {
  std::uint16_t sequence = 0;
  plc::ResultCode code = plc::ResultCode::None;
  std::uint16_t pick_id = 0;
  std::uint16_t part_id = 0;
  std::uint16_t supply_id = 0;
  std::uint16_t objects_left = 0;
  std::uint16_t fill_level_percent = 0;
  float score = 0;
  std::array<float, 6> approach{};  ///< As in the registers, in the configured convention.
  std::array<float, 6> grasp{};
  std::array<float, 3> retreat{};
  Transform<frame::Base, frame::Tcp> T_base_approach;  ///< The same as transforms, millimetres.
  Transform<frame::Base, frame::Tcp> T_base_grasp;
  Transform<frame::Base, frame::Tcp> T_base_retreat;  ///< Turned as at the grasp.
  plc::CycleFigures figures;
};

/// A PLC with a handshake program of its own. As a Modbus/TCP client: one request in flight, transaction numbers, write
/// block and read block in turn, like MB_CLIENT. As a server: one connection, the map in its holding registers, all of
/// them writable, functions 3, 6 and 16, like MB_SERVER. Encodes and decodes Modbus by itself; it shares only the
/// register map. Faults: unplugged and silent say nothing; garbage corrupts what it sends; wrong_id sends protocol id
/// 7, as a server another transaction; error_code puts the PLC into STOP (connected, reading, heartbeat still), as a
/// server it is the exception that everything is answered with; delay, split_every_byte, disconnect_after_bytes as they
/// say.
class Plc {
 public:
  explicit Plc(const PlcOptions& options = {});

  void on_connected(TimePoint now);
  void on_bytes(ByteView bytes, TimePoint now);
  void on_disconnected(TimePoint now);
  void on_deadline(TimePoint now);
  std::optional<TimePoint> deadline() const;
  Bytes take_output();
  bool take_reopen();  ///< True once when the connection must be closed.

  /// The program's hand: a request with the next number. It is dropped when acknowledged, and the result acknowledged
  /// once read, unless held.
  void raise_request() { raise_request(options_.part_id, options_.supply_id); }
  void raise_request(std::uint16_t part_id, std::uint16_t supply_id);
  void repeat_request();  ///< Raises the last request again with the same number.
  void drop_request();    ///< By hand; its answer is not waited for.
  void raise_abort();     ///< Dropped by itself when acknowledged.
  void raise_reset();     ///< Likewise.
  void set_robot_clear(bool clear) { robot_clear_ = clear; }
  void set_new_scan(bool wanted) { new_scan_ = wanted; }  ///< With every request while it is set.
  void set_automatic(bool automatic) { options_.automatic = automatic; }
  void set_next(std::uint16_t part_id, std::uint16_t supply_id) {
    options_.part_id = part_id, options_.supply_id = supply_id;
  }
  void restart();             ///< Power cycle: the program forgets everything.
  bool hold_request = false;  ///< Do not drop the request by itself.
  bool hold_ack = false;      ///< Do not acknowledge the result by itself.
  Faults faults;

  bool is_server() const { return options_.cell_role == plc::LineRole::Client; }
  bool connected() const { return connected_; }
  bool idle() const { return step_ == Step::Idle; }  ///< No request is under way.
  std::uint16_t sequence() const { return sequence_; }
  /// What was last read from the cell. Before the first read: all zero.
  plc::State cell_state() const { return static_cast<plc::State>(word(plc::at("cell_state"))); }
  bool ready() const { return bit(plc::status::kReady); }
  bool busy() const { return bit(plc::status::kBusy); }
  bool acknowledged() const { return bit(plc::status::kAck); }
  bool result_valid() const { return bit(plc::status::kResultValid); }
  bool scan_done() const { return bit(plc::status::kScanDone); }
  bool fault() const { return bit(plc::status::kFault); }
  bool alarm_active() const { return bit(plc::status::kAlarm); }
  std::uint16_t not_ready() const { return word(plc::at("not_ready")); }
  std::uint16_t boot_count() const { return word(plc::at("boot_count")); }
  std::uint16_t ack_sequence() const { return word(plc::at("ack_sequence")); }
  plc::Alarm first_alarm() const { return static_cast<plc::Alarm>(word(plc::at("first_alarm"))); }
  plc::Alarm last_alarm() const { return static_cast<plc::Alarm>(word(plc::at("last_alarm"))); }
  std::vector<plc::Alarm> alarms() const;                                   ///< The list as it stands.
  const std::set<plc::Alarm>& alarms_seen() const { return alarms_seen_; }  ///< All that were ever read.
  void forget_alarms_seen() { alarms_seen_.clear(); }
  const std::optional<PlcResult>& last_result() const { return last_result_; }
  std::optional<PlcResult> take_result();  ///< Each answer once, oldest first.
  unsigned results_read() const { return results_read_; }
  unsigned torn_reads() const { return torn_reads_; }
  /// Empty when map version, length and test values are as expected; else what is wrong.
  const std::string& map_problem() const { return map_problem_; }
  std::uint16_t word(std::uint16_t offset) const { return image_[offset]; }

 private:
  enum class Job { None, Write, Read };
  enum class Step { Idle, Raised, Waiting, Acknowledging };
  struct Sending {
    TimePoint at;
    Bytes bytes;
  };

  bool bit(std::uint16_t mask) const { return (word(plc::at("status")) & mask) != 0; }
  std::array<std::uint16_t, plc::kRequestLength> request_words() const;
  void scan(TimePoint now);
  void serve(ByteView adu, TimePoint now);
  Bytes answer(std::uint8_t function, ByteView content);
  void heard_alarms();
  void start_job(Job job, TimePoint now);
  void send(Bytes bytes, TimePoint now);
  void on_reply(ByteView pdu, TimePoint now);
  void program(TimePoint now);
  void automatic(TimePoint now);
  bool may_raise() const;
  void start_request(std::uint16_t part_id, std::uint16_t supply_id);
  void check_map();
  PlcResult decode_result() const;
  float f32(std::uint16_t offset) const;
  std::uint32_t u32(std::uint16_t offset) const;
  void reopen() { reopen_ = true; }

  PlcOptions options_;
  bool connected_ = false, reopen_ = false;
  TimePoint now_{};
  std::optional<TimePoint> next_poll_, reply_due_;
  Job job_ = Job::None;
  std::uint16_t transaction_ = 0;
  Bytes received_;
  std::deque<Sending> sending_;
  std::size_t sent_bytes_ = 0;
  std::array<std::uint16_t, plc::kMapLength> image_{};
  std::string map_problem_;

  // The program.
  Step step_ = Step::Idle;
  std::uint16_t heartbeat_ = 0, sequence_ = 0, part_id_ = 0, supply_id_ = 0, result_ack_ = 0;
  bool request_ = false, abort_ = false, reset_ = false, robot_clear_ = true, picking_ = false;
  bool new_scan_ = false;
  bool read_once_ = false, shown_zero_ = false;
  bool again_ = false;  // the last request, once it may be raised
  bool told_ = false;   // as a server: the cell has written its blocks
  std::uint16_t known_boot_ = 0;
  std::optional<std::pair<std::uint16_t, std::uint16_t>> wanted_;  // part, supply: raised once the block was read
  TimePoint step_since_{}, next_request_{}, next_reset_{};
  std::optional<PlcResult> last_result_;
  std::deque<PlcResult> untaken_;
  std::set<plc::Alarm> alarms_seen_;
  unsigned results_read_ = 0, torn_reads_ = 0;
};
}  // namespace binpick::emulators
