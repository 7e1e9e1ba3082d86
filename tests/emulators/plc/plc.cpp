#include "tests/emulators/plc/plc.hpp"

#include <algorithm>

#include "base/rotation.hpp"

namespace binpick::emulators {
namespace {
constexpr std::uint8_t kReadHolding = 3, kWriteMultiple = 16;
constexpr std::size_t kUntakenMax = 1000;

Transform<frame::Base, frame::Tcp> to_transform(const std::array<float, 6>& words, plc::PoseConvention convention) {
  const Eigen::Vector3d angles{words[3], words[4], words[5]};
  Transform<frame::Base, frame::Tcp> T;
  T.iso.translation() = Eigen::Vector3d{words[0], words[1], words[2]};
  switch (convention) {
    case plc::PoseConvention::UniversalRobots:
      T.iso.translation() *= 1e3;
      T.iso.linear() = from_rotation_vector(angles);
      break;
    case plc::PoseConvention::Fanuc:
      T.iso.linear() = from_wpr_deg(angles);
      break;
    case plc::PoseConvention::Kawasaki:
      T.iso.linear() = from_oat_deg(angles);
      break;
  }
  return T;
}
}  // namespace

Plc::Plc(const PlcOptions& options) : options_{options} {}

void Plc::on_connected(TimePoint now) {
  now_ = now;
  connected_ = true;
  reopen_ = false;
  received_.clear();
  sending_.clear();
  job_ = Job::None;
  reply_due_.reset();
  if (!is_server()) start_job(Job::Read, now);  // the first look is at what the cell remembers
}

void Plc::on_disconnected(TimePoint now) {
  now_ = now;
  connected_ = false;
  reopen_ = false;
  sending_.clear();
  job_ = Job::None;
  reply_due_.reset();
  next_poll_.reset();
}

void Plc::restart() {
  step_ = Step::Idle;
  sequence_ = part_id_ = supply_id_ = result_ack_ = heartbeat_ = 0;
  request_ = abort_ = reset_ = picking_ = read_once_ = told_ = shown_zero_ = false;
  wanted_.reset();
  again_ = false;
  image_ = {};
  reopen();
}

std::array<std::uint16_t, plc::kRequestLength> Plc::request_words() const {
  std::uint16_t control = 0;
  const auto set = [&](bool on, std::uint16_t mask) {
    control = static_cast<std::uint16_t>(control | (on ? mask : 0));
  };
  set(request_, plc::control::kRequest);
  set(abort_, plc::control::kAbort);
  set(reset_, plc::control::kReset);
  set(robot_clear_ && !picking_, plc::control::kRobotClear);
  set(request_ && new_scan_, plc::control::kNewScan);
  return {heartbeat_, sequence_, part_id_, supply_id_, result_ack_, 0, 0, control};
}

void Plc::start_job(Job job, TimePoint now) {
  job_ = job;
  ++transaction_;
  Bytes frame;
  const std::uint16_t protocol = faults.wrong_id ? 7 : 0;
  append_be<std::uint16_t>(frame, transaction_);
  append_be<std::uint16_t>(frame, protocol);
  if (job == Job::Read) {
    append_be<std::uint16_t>(frame, 6);
    frame.push_back(std::byte{0xFF});
    frame.push_back(std::byte{kReadHolding});
    append_be<std::uint16_t>(frame, static_cast<std::uint16_t>(options_.base_address + plc::kStatusFirst));
    append_be<std::uint16_t>(frame, plc::kStatusLength + plc::kResultLength);
  } else {
    if (!faults.error_code) ++heartbeat_;
    append_be<std::uint16_t>(frame, 7 + 2 * plc::kRequestLength);
    frame.push_back(std::byte{0xFF});
    frame.push_back(std::byte{kWriteMultiple});
    append_be<std::uint16_t>(frame, static_cast<std::uint16_t>(options_.base_address + plc::kRequestFirst));
    append_be<std::uint16_t>(frame, plc::kRequestLength);
    frame.push_back(std::byte{2 * plc::kRequestLength});
    for (const std::uint16_t value : request_words()) append_be(frame, value);
  }
  reply_due_ = now + options_.reply_timeout + faults.delay;
  send(std::move(frame), now);
}

void Plc::send(Bytes bytes, TimePoint now) {
  if (faults.silent || faults.unplugged) return;
  if (faults.garbage)
    for (std::size_t i = 0; i < bytes.size(); ++i) bytes[i] ^= static_cast<std::byte>(0x5A + i);
  sending_.push_back({now + faults.delay, std::move(bytes)});
}

Bytes Plc::take_output() {
  Bytes out;
  while (!sending_.empty() && sending_.front().at <= now_) {
    auto& bytes = sending_.front().bytes;
    if (faults.split_every_byte) {
      out.push_back(bytes.front());
      bytes.erase(bytes.begin());
      if (bytes.empty()) sending_.pop_front();
      break;
    }
    append(out, bytes);
    sending_.pop_front();
  }
  if (faults.disconnect_after_bytes && !out.empty()) {
    if (sent_bytes_ + out.size() >= *faults.disconnect_after_bytes) {
      out.resize(*faults.disconnect_after_bytes - std::min(sent_bytes_, *faults.disconnect_after_bytes));
      faults.disconnect_after_bytes.reset();
      sent_bytes_ = 0;
      sending_.clear();
      reopen();
    } else {
      sent_bytes_ += out.size();
    }
  }
  return out;
}

bool Plc::take_reopen() { return std::exchange(reopen_, false); }

std::optional<TimePoint> Plc::deadline() const {
  if (!connected_ && !is_server()) return std::nullopt;
  // A server's program runs whether anybody listens or not.
  std::optional<TimePoint> at = earlier(is_server() ? next_poll_.value_or(now_) : next_poll_, reply_due_);
  if (!sending_.empty()) at = earlier(at, std::max(sending_.front().at, now_));
  return at;
}

void Plc::on_deadline(TimePoint now) {
  now_ = now;
  if (is_server()) return scan(now);
  if (!connected_) return;
  if (reply_due_ && now >= *reply_due_) {
    reply_due_.reset();
    next_poll_.reset();
    job_ = Job::None;
    reopen();
    return;
  }
  if (next_poll_ && now >= *next_poll_ && job_ == Job::None) {
    next_poll_.reset();
    if (!faults.error_code) program(now);
    start_job(Job::Write, now);
  }
}

void Plc::on_bytes(ByteView bytes, TimePoint now) {
  now_ = now;
  if (faults.unplugged) return;
  append(received_, bytes);
  while (received_.size() >= 7) {
    const std::size_t frame_bytes = 6 + std::size_t{read_be<std::uint16_t>(received_, 4)};
    const bool foreign = read_be<std::uint16_t>(received_, 2) != 0 || frame_bytes < 8 || frame_bytes > 260;
    if (foreign) {
      received_.clear();
      reopen();
      return;
    }
    if (received_.size() < frame_bytes) return;
    const Bytes frame(received_.begin(), received_.begin() + static_cast<std::ptrdiff_t>(frame_bytes));
    received_.erase(received_.begin(), received_.begin() + static_cast<std::ptrdiff_t>(frame_bytes));
    if (is_server()) {
      serve(frame, now);
      continue;
    }
    // MB_CLIENT ignores an answer under another transaction number until its time-out.
    if (job_ == Job::None || read_be<std::uint16_t>(frame, 0) != transaction_) continue;
    on_reply(ByteView{frame}.subspan(7), now);
  }
}

void Plc::on_reply(ByteView pdu, TimePoint now) {
  const Job job = std::exchange(job_, Job::None);
  reply_due_.reset();
  const auto function = std::to_integer<std::uint8_t>(pdu[0]);
  if (job == Job::Write && function == kWriteMultiple && pdu.size() == 5) {
    if (read_once_ && !request_) shown_zero_ = true;
    start_job(Job::Read, now);
    return;
  }
  constexpr std::size_t kWords = plc::kStatusLength + plc::kResultLength;
  if (job == Job::Read && function == kReadHolding && pdu.size() == 2 + 2 * kWords) {
    for (std::size_t i = 0; i < kWords; ++i) image_[plc::kStatusFirst + i] = read_be<std::uint16_t>(pdu, 2 + 2 * i);
    heard_alarms();
    if (!read_once_) check_map();
    if (!faults.error_code) program(now);
    read_once_ = true;
  }
  // An exception answer (a second writer, most often) is tried again at the next poll.
  next_poll_ = now + options_.poll;
}

void Plc::heard_alarms() {
  for (const auto alarm : alarms()) alarms_seen_.insert(alarm);
  if (last_alarm() != plc::Alarm::None) alarms_seen_.insert(last_alarm());
}

void Plc::check_map() {
  map_problem_.clear();
  if (word(plc::at("map_version")) != plc::kMapVersion)
    map_problem_ = "map version differs";
  else if (word(plc::at("map_length")) != plc::kMapLength)
    map_problem_ = "map length differs";
  else if (f32(plc::at("test_f32")) != 123456.0F || u32(plc::at("test_u32")) != 0x01020304)
    map_problem_ = "word order differs";
}

std::uint32_t Plc::u32(std::uint16_t offset) const {
  return plc::u32_from_words(word(offset), word(static_cast<std::uint16_t>(offset + 1)), options_.word_order);
}
float Plc::f32(std::uint16_t offset) const { return std::bit_cast<float>(u32(offset)); }

std::vector<plc::Alarm> Plc::alarms() const {
  std::vector<plc::Alarm> out;
  for (std::uint16_t i = 0; i < plc::kAlarmListLength; ++i)
    if (const auto code = word(static_cast<std::uint16_t>(plc::at("alarm_1") + i)); code != 0)
      out.push_back(static_cast<plc::Alarm>(code));
  return out;
}

PlcResult Plc::decode_result() const {
  PlcResult r;
  r.sequence = word(plc::at("result_sequence"));
  r.code = static_cast<plc::ResultCode>(word(plc::at("result_code")));
  r.pick_id = word(plc::at("pick_id"));
  r.part_id = word(plc::at("result_part_id"));
  r.supply_id = word(plc::at("result_supply_id"));
  r.objects_left = word(plc::at("objects_left"));
  r.fill_level_percent = word(plc::at("fill_level"));
  r.score = f32(plc::at("score"));
  for (std::uint16_t i = 0; i < 6; ++i) {
    r.approach[i] = f32(static_cast<std::uint16_t>(plc::at("approach_x") + 2 * i));
    r.grasp[i] = f32(static_cast<std::uint16_t>(plc::at("grasp_x") + 2 * i));
  }
  for (std::uint16_t i = 0; i < 3; ++i) r.retreat[i] = f32(static_cast<std::uint16_t>(plc::at("retreat_x") + 2 * i));
  r.T_base_approach = to_transform(r.approach, options_.pose_convention);
  r.T_base_grasp = to_transform(r.grasp, options_.pose_convention);
  r.T_base_retreat = to_transform({r.retreat[0], r.retreat[1], r.retreat[2], r.grasp[3], r.grasp[4], r.grasp[5]},
                                  options_.pose_convention);
  r.figures = {word(plc::at("sweep_ms")), word(plc::at("profiles")), u32(plc::at("points")), u32(plc::at("hypotheses")),
               word(plc::at("detection_ms"))};
  return r;
}

void Plc::raise_request(std::uint16_t part_id, std::uint16_t supply_id) {
  if (may_raise()) {
    start_request(part_id, supply_id);
  } else {
    wanted_ = std::pair{part_id,
                        supply_id};  // the number depends on what the cell remembers, and request must be shown 0 first
  }
}

void Plc::start_request(std::uint16_t part_id, std::uint16_t supply_id) {
  wanted_.reset();
  do sequence_ = static_cast<std::uint16_t>(sequence_ + 1);
  while (sequence_ == 0 || sequence_ == ack_sequence());
  part_id_ = part_id;
  supply_id_ = supply_id;
  result_ack_ = 0;
  request_ = true;
  step_ = Step::Raised;
  step_since_ = now_;
}

bool Plc::may_raise() const {
  // While ack stands, whoever reads the registers now and then may not have seen the last request fall.
  return read_once_ && shown_zero_ && !(is_server() && acknowledged());
}

void Plc::repeat_request() {
  again_ = !may_raise();
  if (again_) return;
  result_ack_ = 0;
  request_ = true;
  step_ = Step::Raised;
  step_since_ = now_;
}

void Plc::drop_request() {
  request_ = false;
  step_ = Step::Idle;
}
void Plc::raise_abort() { abort_ = true; }
void Plc::raise_reset() { reset_ = true; }

void Plc::program(TimePoint now) {
  if (!read_once_ || boot_count() != known_boot_) {
    // The cell (or this PLC) has just started: what was asked before is void; all control bits are shown 0 once.
    known_boot_ = boot_count();
    if (sequence_ == 0) sequence_ = ack_sequence();
    step_ = Step::Idle;
    request_ = abort_ = reset_ = false;
    result_ack_ = 0;
    shown_zero_ = false;
    return;
  }
  if (!shown_zero_) return;  // a request that stands when the two meet is refused
  if (wanted_ && may_raise()) start_request(wanted_->first, wanted_->second);
  if (again_) repeat_request();
  if (abort_ && bit(plc::status::kAbortAck)) {
    abort_ = false;
    request_ = false;
    step_ = Step::Idle;
  }
  if (reset_ && bit(plc::status::kResetAck)) reset_ = false;

  const bool head_is_ours = word(plc::at("result_sequence")) == sequence_;
  const bool tail_is_ours = word(plc::at("result_sequence_tail")) == sequence_;
  switch (step_) {
    case Step::Idle:
      break;
    case Step::Raised:
      if (!acknowledged() || ack_sequence() != sequence_) break;
      step_ = Step::Waiting;
      [[fallthrough]];
    case Step::Waiting:
      if (!hold_request) request_ = false;
      if (result_valid() && head_is_ours != tail_is_ours) ++torn_reads_;
      if (!result_valid() || !head_is_ours || !tail_is_ours) {
        if (fault()) step_ = Step::Idle;
        break;
      }
      last_result_ = decode_result();
      ++results_read_;
      if (untaken_.size() < kUntakenMax) untaken_.push_back(*last_result_);
      next_request_ = now + options_.pause;
      if (options_.automatic && last_result_->code == plc::ResultCode::PickFound && options_.pick_time.count() > 0) {
        picking_ = true;
        next_request_ = now + options_.pick_time;
      }
      step_ = Step::Acknowledging;
      [[fallthrough]];
    case Step::Acknowledging:
      if (!hold_request) request_ = false;
      if (!hold_ack) result_ack_ = sequence_;
      if (!(result_valid() && head_is_ours)) step_ = Step::Idle;
      break;
  }
  if (options_.automatic) automatic(now);
}

void Plc::automatic(TimePoint now) {
  if (picking_ && now >= next_request_) picking_ = false;
  const bool old_alarms = first_alarm() != plc::Alarm::None && !alarm_active();
  if ((fault() || old_alarms) && !reset_ && !bit(plc::status::kResetAck) && now >= next_reset_) {
    reset_ = true;
    next_reset_ = now + std::chrono::milliseconds(500);
  }
  if (step_ != Step::Idle) {
    if (now - step_since_ >= options_.answer_timeout) abort_ = true;
    return;
  }
  // An answer to what this program asked before it was restarted: nobody waits for it.
  if (result_valid()) result_ack_ = word(plc::at("result_sequence"));
  if (ready() && may_raise() && !fault() && !abort_ && !picking_ && now >= next_request_)
    start_request(options_.part_id, options_.supply_id);
}

std::optional<PlcResult> Plc::take_result() {
  if (untaken_.empty()) return std::nullopt;
  auto result = std::move(untaken_.front());
  untaken_.pop_front();
  return result;
}
}  // namespace binpick::emulators
