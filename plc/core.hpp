#pragma once

#include <array>
#include <cstdint>
#include <deque>
#include <optional>
#include <span>

#include "base/clock.hpp"
#include "plc/alarm_list.hpp"
#include "plc/events.hpp"
#include "plc/handshake.hpp"
#include "plc/options.hpp"
#include "plc/register_image.hpp"
#include "plc/watch.hpp"

namespace binpick::plc {
/// The pick handshake on the words of the map, whoever carries them between the PLC and us: a Modbus server of ours
/// (plc/modbus_server.hpp) or one of the PLC's (plc/modbus_client.hpp). No line, no bytes.
class Core {
 public:
  /// `words` are the map's, from offset 0 on; they outlive this.
  Core(const Options& options, std::uint16_t boot_count, std::span<std::uint16_t> words);

  // The carrier of the words.
  void begin(TimePoint now);  ///< First of all; again: nothing.
  void set_connected(bool connected, TimePoint now);
  /// The PLC wrote `count` words from offset `first` on; they stand in the map.
  void on_written(std::uint16_t first, std::uint16_t count, TimePoint now);
  /// `request` is 0, before anything else of the PLC is believed.
  void on_request_seen_low() { armed_ = seen_low_ = true; }
  /// Whoever wrote the request block is gone; its levels fall.
  void on_writer_gone(TimePoint now);
  void on_second_writer(bool there, TimePoint now);

  void on_deadline(TimePoint now);
  std::optional<TimePoint> deadline() const;
  std::optional<Event> take_event();

  // The cell, as in plc/session.hpp.
  void set_not_ready(std::uint16_t device_reasons, TimePoint now);
  bool robot_clear() const;
  void on_scan_done(TimePoint now);
  void publish(const PickResult& result, TimePoint now);
  void fault(Alarm alarm, TimePoint now);
  void raise(Alarm alarm, TimePoint now);
  void clear(Alarm alarm, TimePoint now);
  void reconfigure(const Options& options, TimePoint now);

  State state() const { return handshake_.state(); }
  std::uint16_t word(std::uint16_t offset) const { return image_.word(offset); }

 private:
  /// An answer as the result block shows it.
  struct Answer {
    PickRequest request;
    PickResult result;
  };

  // What the PLC wrote.
  void on_beat(TimePoint now);
  void on_request_level(TimePoint now);
  Signal classify(const PickRequest& request);
  bool raised(std::uint16_t bit) const { return (word(at("control")) & bit) != 0; }
  PickRequest request_in_words() const {
    return {word(at("sequence")), word(at("part_id")), word(at("supply_id")), raised(control::kNewScan)};
  }

  // The handshake.
  void apply(Signal signal, TimePoint now);
  void settle(TimePoint now);
  void acknowledge(std::uint16_t sequence) { ack_ = true, ack_sequence_ = sequence; }
  void show(const Answer& answer);
  void clear_result();
  void end_cycle(ResultCode code);
  void log_refusal();
  void lose_plc();
  void refresh();

  Options options_;
  std::uint16_t boot_count_;
  Handshake handshake_;
  Watch watch_;
  RegisterImage image_;
  AlarmList alarms_;
  std::deque<Event> events_;

  std::array<std::uint16_t, kRequestLength> seen_{};  // request block as last looked at
  bool armed_ = false;                                // request was seen 0 since it was last answered
  bool seen_low_ = false;                             // request was seen 0 since the start
  bool standing_answered_ = false;
  bool ack_ = false, abort_ack_ = false, reset_ack_ = false, scan_done_ = false;
  std::uint16_t ack_sequence_ = 0;
  PickRequest asked_;                              // the request being answered
  std::array<std::uint16_t, 3> logged_refusal_{};  // code, part, supply
  ResultCode refusal_ = ResultCode::None;          // why Refuse
  PickRequest accepted_;                           // the last one accepted; sequence 0: none
  std::optional<Answer> stored_;                   // its answer, once there is one
  std::optional<PickResult> published_;            // on its way into PublishResult
  Alarm fault_alarm_ = Alarm::None;                // on its way into RaiseFault
  std::optional<std::uint16_t> shown_sequence_;    // the result block is valid for it

  std::uint16_t device_reasons_ = 0;
  bool starting_ = true;
  std::uint16_t heartbeat_ = 0, picks_total_ = 0, cycles_total_ = 0;
  std::optional<TimePoint> next_heartbeat_;  // nullopt: no time was given yet
};
}  // namespace binpick::plc
