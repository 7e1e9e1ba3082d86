#include "tests/emulators/robot/robot.hpp"

#include <algorithm>
#include <utility>

namespace binpick::emulators {
using drivers::robot::Outcome;
using drivers::robot::Reply;
using drivers::robot::Request;
using drivers::robot::Status;

Robot::Robot(const RobotOptions& options) : options_{options}, random_{options.seed} {
  if (!options_.paths.empty()) path_ = options_.paths.begin()->second;
}

Transform<frame::Base, frame::Flange> Robot::flange_at(TimePoint at) const {
  if (!path_) return {};
  const double run = path_began_ ? in_s(at - *path_began_) / in_s(path_->duration) : 0;
  const double share = std::clamp(run, 0.0, path_share_);
  const Eigen::Isometry3d &from = path_->T_base_begin.iso, &to = path_->T_base_end.iso;
  Transform<frame::Base, frame::Flange> T_base_flange;
  T_base_flange.iso.translation() = (1 - share) * from.translation() + share * to.translation();
  T_base_flange.iso.linear() =
      Eigen::Quaterniond{from.linear()}.slerp(share, Eigen::Quaterniond{to.linear()}).toRotationMatrix();
  return T_base_flange;
}

void Robot::on_connected(TimePoint now) {
  connected_ = true;
  greeted_ = false;
  waiting_ = Waiting::None;
  received_.clear();
  due_.clear();
  out_.clear();
  reopen_ = false;
  update(now);
}

void Robot::on_disconnected(TimePoint now) {
  connected_ = false;
  waiting_ = Waiting::None;
  update(now);
}

void Robot::on_bytes(ByteView bytes, TimePoint now) {
  received_ += as_text(bytes);
  update(now);
}

void Robot::on_deadline(TimePoint now) { update(now); }

std::optional<TimePoint> Robot::deadline() const {
  if (stopped_before_ != faults.emergency_stop) return now_;
  if (faults.emergency_stop || faults.silent) return std::nullopt;
  std::optional<TimePoint> next;
  if (!may_talk() && motion_ != Motion::Stopped) next = motion_until_;
  if (!connected_) return next;
  if (faults.unplugged) return now_;
  if (!due_.empty()) next = earlier(next, due_.front().at);
  if (waiting_ != Waiting::None) return earlier(next, reply_until_);
  return may_talk() ? earlier(next, next_poll_) : next;
}

Bytes Robot::take_output() { return std::exchange(out_, {}); }
bool Robot::take_reopen() { return std::exchange(reopen_, false); }

std::optional<Robot::Event> Robot::take_event() {
  if (events_.empty()) return std::nullopt;
  Event event = std::move(events_.front());
  events_.pop_front();
  return event;
}

void Robot::restart_program(TimePoint now) {
  if (is_on_scan()) {
    halt(now);
    motion_ = Motion::PathOver;
  } else if (motion_ != Motion::None && motion_ != Motion::PathOver) {
    motion_ = Motion::Retreat;
    motion_until_ = now + options_.retreat;
  }
  if (connected_) fail_link("program restarted");
  update(now);
}

void Robot::update(TimePoint now) {
  now_ = now;
  if (std::exchange(stopped_before_, faults.emergency_stop) != faults.emergency_stop) {
    if (faults.emergency_stop) {
      if (is_on_scan()) halt(now);
      if (connected_) fail_link("emergency stop: the program is stopped");
    } else {
      restart_program(now);
      return;
    }
  }
  if (faults.unplugged && connected_) fail_link("unplugged");
  if (faults.emergency_stop || faults.silent) return;
  move_on(now);
  if (!connected_) return;
  while (waiting_ != Waiting::None) {
    const auto decoded = drivers::robot::decode_reply(received_, options_.dialect);
    if (!decoded) {
      fail_link("answer not understood: " + decoded.error().text);
      return;
    }
    if (!*decoded) break;
    received_.erase(0, (*decoded)->consumed);
    on_reply((*decoded)->reply, now);
  }
  if (waiting_ != Waiting::None && now >= reply_until_) {
    fail_link("no answer");
    return;
  }
  talk(now);
  send_due(now);
}

void Robot::move_on(TimePoint now) {
  while (!may_talk() && motion_ != Motion::Stopped && now >= motion_until_) {
    if (motion_ == Motion::Approach) {
      motion_ = Motion::Grasp;
      motion_until_ += options_.grasp;
    } else if (motion_ == Motion::Grasp) {
      gripped_ = !faults.error_code && (!on_grasp || on_grasp(pick_));
      motion_ = Motion::Retreat;
      motion_until_ += options_.retreat;
    } else if (motion_ == Motion::ToPath) {
      motion_ = Motion::AtPath;
      path_began_.reset();
    } else if (motion_ == Motion::OnPath) {
      motion_ = path_share_ < 1 && !tells_of_stop ? Motion::Stopped : Motion::PathOver;
    } else {
      motion_ = Motion::None;
    }
  }
}

void Robot::talk(TimePoint now) {
  if (waiting_ != Waiting::None) return;
  if (!greeted_) return ask({Request::Kind::Hello, 0}, Waiting::Hello, now);
  if (!may_talk() || now < next_poll_) return;
  if (motion_ == Motion::AtPath) return ask({Request::Kind::Begin, scan_}, Waiting::Begin, now);
  if (motion_ == Motion::PathOver)
    return ask({path_share_ < 1 ? Request::Kind::Broken : Request::Kind::End, scan_}, Waiting::PathReport, now);
  if (!pick_open_) return ask({Request::Kind::Fetch, 0}, Waiting::Fetch, now);
  const auto id = static_cast<std::uint16_t>(pick_.pick_id + (faults.wrong_id ? 1 : 0));
  ask({gripped_ ? Request::Kind::Done : Request::Kind::Failed, std::max<std::uint16_t>(id, 1)}, Waiting::Report, now);
}

/// Between the answer that asks for a scan and the word that its path is over.
bool Robot::is_on_scan() const {
  return motion_ == Motion::ToPath || motion_ == Motion::AtPath || motion_ == Motion::OnPath ||
         motion_ == Motion::Stopped;
}

/// The arm stops where it is on its way to the path, or along it: the path is broken off.
void Robot::halt(TimePoint now) {
  if (motion_ != Motion::Stopped)
    path_share_ = path_began_ ? std::min(in_s(now - *path_began_) / in_s(path_->duration), path_share_) : 0;
  motion_ = Motion::Stopped;
}

/// The program stands at a place where it speaks with the cell.
bool Robot::may_talk() const {
  return motion_ == Motion::None || motion_ == Motion::AtPath || motion_ == Motion::PathOver;
}

void Robot::ask(const Request& request, Waiting waiting, TimePoint now) {
  waiting_ = waiting;
  reply_until_ = now + options_.reply_timeout + 2 * faults.delay;
  received_.clear();
  const std::string line = encode(request, options_.dialect);
  std::uniform_int_distribution<int> any{0, 255};
  TimePoint at = now + faults.delay;
  for (const char c : line) {
    const bool spoil = faults.garbage && c != '\n' && c != '\r';
    due_.push_back({at, static_cast<std::byte>(spoil ? any(random_) : static_cast<unsigned char>(c))});
    if (faults.split_every_byte) at += std::chrono::milliseconds(1);
  }
}

void Robot::on_reply(const Reply& reply, TimePoint now) {
  const Waiting asked = std::exchange(waiting_, Waiting::None);
  next_poll_ = now + options_.poll_period;
  if (reply.status == Status::BadRequest) return;  // a torn or spoilt line: ask again
  switch (asked) {
    case Waiting::Hello:
      greeted_ = true;
      next_poll_ = now;
      break;
    case Waiting::Begin:
      if (reply.status == Status::UnknownScan) motion_ = Motion::None;
      if (reply.status != Status::Go) break;
      motion_ = Motion::OnPath;
      path_began_ = now;
      path_share_ = std::exchange(stops_at, std::nullopt).value_or(1);
      motion_until_ = now + std::chrono::duration_cast<Duration>(path_share_ * path_->duration);
      break;
    case Waiting::PathReport:
      motion_ = Motion::None;
      events_.push_back(ScanAnswered{scan_, path_share_ < 1, reply.status});
      next_poll_ = now;
      break;
    case Waiting::Fetch:
      if (reply.status == Status::Scan && options_.paths.contains(reply.pick.part_id)) {
        scan_ = reply.pick.pick_id;
        path_ = options_.paths.at(reply.pick.part_id);
        path_share_ = 1;
        path_began_.reset();
        motion_ = Motion::ToPath;
        motion_until_ = now + options_.to_path;
        break;
      }
      if (reply.status != Status::Pick) {
        if (last_status_ != reply.status) events_.push_back(NoPickRead{reply.status});
        last_status_ = reply.status;
        break;
      }
      last_status_ = reply.status;
      pick_ = reply.pick;
      pick_open_ = true;
      gripped_ = false;
      motion_ = Motion::Approach;
      motion_until_ = now + options_.approach;
      events_.push_back(PickRead{pick_});
      break;
    case Waiting::Report:
      // Taken, or a pick that the cell no longer knows: the part is out of the bin or not, the pick is over either way.
      pick_open_ = false;
      ++(gripped_ ? done_ : failed_);
      events_.push_back(ReportAnswered{pick_.pick_id, gripped_, reply.status});
      next_poll_ = now;
      break;
    case Waiting::None:
      break;
  }
}

void Robot::fail_link(const std::string& text) {
  connected_ = false;
  waiting_ = Waiting::None;
  due_.clear();
  out_.clear();
  reopen_ = true;
  events_.push_back(Trouble{text});
}

void Robot::send_due(TimePoint now) {
  while (!due_.empty() && due_.front().at <= now && connected_) {
    const std::byte byte = due_.front().byte;
    due_.pop_front();
    send(byte);
  }
}

void Robot::send(std::byte byte) {
  if (bytes_limit_ != faults.disconnect_after_bytes) {
    bytes_limit_ = faults.disconnect_after_bytes;
    bytes_sent_ = 0;
  }
  if (bytes_limit_ && bytes_sent_ >= *bytes_limit_) {
    faults.disconnect_after_bytes.reset();
    bytes_limit_.reset();
    Bytes sent_before = std::move(out_);
    fail_link("cut by the fault disconnect_after_bytes");
    out_ = std::move(sent_before);
    return;
  }
  ++bytes_sent_;
  out_.push_back(byte);
}
}  // namespace binpick::emulators
