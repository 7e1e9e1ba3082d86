#include "tests/emulators/robot/rtde_device.hpp"

#include "base/overloaded.hpp"
#include "base/rotation.hpp"

namespace binpick::emulators {
using namespace drivers::rtde;

namespace {
std::array<double, 6> pose_of(const Eigen::Isometry3d& T) {
  const Eigen::Vector3d p_m = 1e-3 * T.translation(), v_rad = to_rotation_vector(T.linear());
  return {p_m.x(), p_m.y(), p_m.z(), v_rad.x(), v_rad.y(), v_rad.z()};
}

std::optional<Field> field_named(const std::string& name) {
  for (const Field field :
       {Field::Timestamp, Field::TcpPose, Field::TcpOffset, Field::RobotMode, Field::SafetyMode, Field::RuntimeState})
    if (words_of(field).name == name) return field;
  return std::nullopt;
}
}  // namespace

RtdeDevice::RtdeDevice(FlangeMotion motion, const Options& options)
    : T_flange_tcp{options.T_flange_tcp},
      motion_{std::move(motion)},
      options_{options},
      clock_{options.clock},
      line_{options.delay_min, options.delay_max, options.seed} {}

void RtdeDevice::on_connected(TimePoint now) {
  now_ = now;
  wants_close_ = false;
  received_.clear();
  line_.clear();
  next_beat_.reset();
  recipe_.clear();
  bytes_sent_ = 0;
  if (options_.greets) answer(TextMessage{"welcome", "controller", 3}, now);
}

void RtdeDevice::on_disconnected(TimePoint now) {
  now_ = now;
  next_beat_.reset();
  line_.clear();
}

void RtdeDevice::restart(TimePoint now) {
  clock_.first_s = 0;
  clock_.started = now;
  cut();
}

void RtdeDevice::on_bytes(ByteView bytes, TimePoint now) {
  now_ = now;
  append(received_, bytes);
  while (true) {
    const auto decoded = decode_request(received_);
    if (!decoded) return cut();
    if (!*decoded) return;
    received_.erase(received_.begin(), received_.begin() + static_cast<std::ptrdiff_t>((*decoded)->consumed));
    on_request((*decoded)->message, now);
  }
}

void RtdeDevice::on_request(const Request& request, TimePoint now) {
  std::visit(Overloaded{[&](const RequestVersion& r) {
                          answer(VersionAnswer{accepts_version && r.version == kProtocolVersion}, now);
                        },
                        [&](const GetControllerVersion&) { answer(options_.version, now); },
                        [&](const SetupOutputs& r) {
                          asked_ = r;
                          recipe_.clear();
                          OutputsAnswer outputs{1, {}};
                          for (const std::string& name : r.names) {
                            const auto field = field_named(name);
                            std::string type = field ? std::string(words_of(*field).type) : "NOT_FOUND";
                            if (const auto other = types.find(name); other != types.end()) type = other->second;
                            if (type == "NOT_FOUND" || type == "IN_USE") outputs.recipe = 0;
                            if (field) recipe_.push_back(*field);
                            outputs.types.push_back(type);
                          }
                          if (outputs.recipe == 0) recipe_.clear();
                          answer(outputs, now);
                        },
                        [&](const Start&) {
                          const bool yes = accepts_start && !recipe_.empty();
                          answer(StartAnswer{yes}, now);
                          if (yes) next_beat_ = now;
                        },
                        [&](const Pause&) {
                          answer(PauseAnswer{true}, now);
                          next_beat_.reset();
                        }},
             request);
}

void RtdeDevice::answer(const Reply& reply, TimePoint now) { line_.send(encode(reply), now, faults); }

void RtdeDevice::send_sample(TimePoint now) {
  if (!time_stands_still) stamp_ = clock_.at(now);
  Sample sample{
      stamp_,       pose_of((motion_(now) * T_flange_tcp).iso), pose_of(T_flange_tcp.iso), robot_mode, safety_mode,
      runtime_state};
  answer(Values{1, encode_sample(recipe_, sample)}, now);
}

void RtdeDevice::on_deadline(TimePoint now) {
  now_ = now;
  while (next_beat_ && *next_beat_ <= now) {
    send_sample(*next_beat_);
    *next_beat_ += from_s(1 / asked_->frequency_hz);
  }
}

std::optional<TimePoint> RtdeDevice::deadline() const { return earlier(next_beat_, line_.deadline()); }

Bytes RtdeDevice::take_output() {
  if (wants_close()) return {};
  Bytes out = line_.take(now_, faults);
  bytes_sent_ += out.size();
  if (faults.disconnect_after_bytes && bytes_sent_ >= *faults.disconnect_after_bytes) {
    out.resize(out.size() - (bytes_sent_ - *faults.disconnect_after_bytes));
    faults.disconnect_after_bytes.reset();
    cut();
  }
  return out;
}
}  // namespace binpick::emulators
