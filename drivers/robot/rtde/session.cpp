#include "drivers/robot/rtde/session.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <utility>
#include <vector>

#include "base/log.hpp"
#include "base/rotation.hpp"
#include "drivers/robot/pose_intake.hpp"
#include "drivers/robot/rtde/codec.hpp"

namespace binpick::drivers::rtde {
namespace {
using robot::PoseFailed;
using robot::PoseState;
using Why = PoseFailed::Why;

const std::vector<Field> kRecipe{Field::Timestamp, Field::TcpPose,    Field::TcpOffset,
                                 Field::RobotMode, Field::SafetyMode, Field::RuntimeState};
const std::vector<Field> kRecipeWithoutOffset{Field::Timestamp, Field::TcpPose, Field::RobotMode, Field::SafetyMode,
                                              Field::RuntimeState};
constexpr double kFrequency_hz = 500, kFrequencyCb3_hz = 125;
/// A controller that has a lot to say is heard so often.
constexpr int kTextsLoggedMax = 8;

enum class Step { Version, ControllerVersion, Outputs, Start, Data };

// robot_mode, safety_mode and runtime_state: UniversalRobots/Universal_Robots_Client_Library,
// include/ur_client_library/ur/datatypes.h; runtime_state: "Real-Time Data Exchange (RTDE)", universal-robots.com.
constexpr std::int32_t kIdle = 5, kBackdrive = 6, kRunning = 7;

/// With the brakes released or not, the encoders are read and the pose is that of the arm.
bool has_power(const Sample& sample) { return sample.robot_mode >= kIdle && sample.robot_mode <= kRunning; }

std::string trouble_of(const Sample& sample) {
  switch (sample.safety_mode) {
    case 1:  // normal
    case 2:  // reduced
      break;
    case 3:
      return "protective stop";
    case 4:
      return "recovery mode";
    case 5:
    case 12:
      return "safeguard stop";
    case 6:
    case 7:
      return "emergency stop";
    case 8:
      return "safety violation";
    case 9:
      return "safety fault";
    default:
      return "safety mode " + std::to_string(sample.safety_mode);
  }
  if (!has_power(sample)) return "the arm has no power (robot mode " + std::to_string(sample.robot_mode) + ")";
  if (sample.robot_mode == kIdle) return "the brakes are on";
  if (sample.robot_mode == kBackdrive) return "the arm is in backdrive";
  if (sample.runtime_state != 2) return "no program runs (runtime state " + std::to_string(sample.runtime_state) + ")";
  return {};
}

Eigen::Isometry3d transform_of(const std::array<double, 6>& pose) {
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  T.translation() = 1e3 * Eigen::Vector3d{pose[0], pose[1], pose[2]};
  T.linear() = from_rotation_vector({pose[3], pose[4], pose[5]});
  return T;
}

const char* words_for(Step step) {
  switch (step) {
    case Step::Version:
      return "the request for protocol version 2";
    case Step::ControllerVersion:
      return "the request for its version";
    case Step::Outputs:
      return "the list of outputs";
    case Step::Start:
      return "the start";
    case Step::Data:
      return "the start with data";
  }
  return "?";
}
}  // namespace

struct Session::Impl {
  explicit Impl(const Options& o) : options{o} {}

  Options options;
  robot::PoseIntake intake;
  Step step = Step::Version;
  bool reopen = false;
  std::vector<Field> recipe;
  std::uint8_t recipe_id = 0;
  ControllerVersion version;
  Bytes received, output;
  TimePoint waiting_until;
  Duration silence_max{0};
  bool has_values = false;  // of this connection
  int texts_logged = 0;
  std::string trouble;

  bool is_online() const { return intake.state() != PoseState::Offline; }

  void reset() {
    received.clear();
    output.clear();
    trouble.clear();
  }

  void fail(Why why, const std::string& text) {
    reset();
    reopen = why != Why::LinkLost;
    intake.fail(why, "pose source (RTDE): " + text);
  }

  void ask(Step next, const Request& request, TimePoint now) {
    step = next;
    append(output, encode(request));
    waiting_until = now + options.reply_timeout;
  }

  void ask_for_outputs(const std::vector<Field>& fields, TimePoint now) {
    recipe = fields;
    const double most_hz = version.major >= 5 ? kFrequency_hz : kFrequencyCb3_hz;
    SetupOutputs setup{std::clamp(options.frequency_hz.value_or(most_hz), 1.0, most_hz), {}};
    silence_max = std::max<Duration>(options.silence_max, from_s(3 / setup.frequency_hz));
    for (const Field field : fields) setup.names.emplace_back(words_of(field).name);
    ask(Step::Outputs, setup, now);
  }

  std::string version_text() const {
    return std::to_string(version.major) + "." + std::to_string(version.minor) + "." + std::to_string(version.bugfix);
  }

  void on(const VersionAnswer& answer, TimePoint now) {
    if (!expect(Step::Version)) return;
    if (!answer.accepted)
      return fail(Why::Refused, "the controller does not speak protocol version 2; update its software");
    ask(Step::ControllerVersion, GetControllerVersion{}, now);
  }

  void on(const ControllerVersion& answer, TimePoint now) {
    if (!expect(Step::ControllerVersion)) return;
    version = answer;
    ask_for_outputs(kRecipe, now);
  }

  void on(const OutputsAnswer& answer, TimePoint now) {
    if (!expect(Step::Outputs)) return;
    if (answer.types.size() != recipe.size())
      return fail(Why::BadTelegram, "asked for " + std::to_string(recipe.size()) + " outputs, the controller answers " +
                                        std::to_string(answer.types.size()) +
                                        " types; check that nothing else sits between cell and controller");
    std::string wrong;
    bool only_offset_is_missing = true;
    for (std::size_t i = 0; i < recipe.size(); ++i) {
      const FieldWords words = words_of(recipe[i]);
      if (answer.types[i] == words.type) continue;
      wrong += (wrong.empty() ? "" : ", ") + std::string(words.name) + " is " + answer.types[i] + " instead of " +
               std::string(words.type);
      only_offset_is_missing &= recipe[i] == Field::TcpOffset && answer.types[i] == "NOT_FOUND";
    }
    if (!wrong.empty() && only_offset_is_missing) {
      if (options.T_flange_tcp) return ask_for_outputs(kRecipeWithoutOffset, now);
      return fail(Why::Refused, "controller software " + version_text() +
                                    " does not tell its tcp offset (known from 3.12 and 5.5.1 on); update it, or give "
                                    "the tcp's pose in the flange in the cell file");
    }
    if (!wrong.empty() || answer.recipe == 0)
      return fail(Why::Refused, "controller software " + version_text() + " refuses the outputs" +
                                    (wrong.empty() ? "" : ": " + wrong) +
                                    "; update it, or end other programs that use RTDE");
    recipe_id = answer.recipe;
    ask(Step::Start, Start{}, now);
  }

  void on(const StartAnswer& answer, TimePoint now) {
    if (!expect(Step::Start)) return;
    if (!answer.accepted)
      return fail(Why::Refused, "the controller refuses to start; restart it, or end other programs that use RTDE");
    step = Step::Data;
    waiting_until = now + options.reply_timeout;
  }

  void on(const PauseAnswer&, TimePoint) {
    fail(Why::BadTelegram, "the controller paused though nobody asked for it; check which other program uses RTDE");
  }

  void on(const TextMessage& message, TimePoint) {
    if (++texts_logged <= kTextsLoggedMax)
      BINPICK_LOG(Notice, "robot", "the controller says: %s", message.text.c_str());
  }

  void on(const Values& values, TimePoint now) {
    if (!expect(Step::Data)) return;
    if (values.recipe != recipe_id)
      return fail(Why::BadTelegram, "data of recipe " + std::to_string(values.recipe) + ", asked for recipe " +
                                        std::to_string(recipe_id) + "; the connection is opened anew");
    const auto sample = decode_sample(recipe, values.values);
    if (!sample)
      return fail(Why::BadTelegram, to_string(sample.error()) +
                                        "; the connection is opened anew. If it stays, compare the controller's "
                                        "software version with the manual page");
    waiting_until = now + silence_max;
    has_values = true;
    const std::string said = trouble_of(*sample);
    if (said != trouble) BINPICK_LOG(Notice, "robot", "%s", said.empty() ? "the arm is ready to move" : said.c_str());
    trouble = said;
    std::optional<Transform<frame::Base, frame::Flange>> T_base_flange;
    if (has_power(*sample)) {
      const Transform<frame::Base, frame::Tcp> T_base_tcp{transform_of(sample->tcp_pose)};
      const auto T_flange_tcp = sample->tcp_offset
                                    ? Transform<frame::Flange, frame::Tcp>{transform_of(*sample->tcp_offset)}
                                    : options.T_flange_tcp.value_or(Transform<frame::Flange, frame::Tcp>{});
      T_base_flange = T_base_tcp * T_flange_tcp.inverse();
    }
    intake.on_pose(sample->timestamp_s, T_base_flange, now);
    if (!is_online()) {  // its clock stands still, or jumped
      reset();
      reopen = true;
    }
  }

  /// False, and the connection is given up: it is another step's turn.
  bool expect(Step wanted) {
    if (step == wanted) return true;
    fail(Why::BadTelegram, std::string("an answer that belongs to another step, while ") + words_for(step) +
                               " is under way; check that port 30004 is the controller's RTDE port");
    return false;
  }

  void on_bytes(ByteView bytes, TimePoint now) {
    append(received, bytes);
    std::size_t at = 0;
    while (is_online()) {
      const auto decoded = decode_reply(ByteView{received}.subspan(at));
      if (!decoded)
        return fail(Why::BadTelegram, to_string(decoded.error()) +
                                          "; check that address and port (30004) are those of the controller's RTDE");
      if (!*decoded) break;
      at += (*decoded)->consumed;
      std::visit([&](const auto& message) { on(message, now); }, (*decoded)->message);
    }
    if (is_online()) received.erase(received.begin(), received.begin() + static_cast<std::ptrdiff_t>(at));
  }
};

Session::Session(const Options& options) : impl_{std::make_shared<Impl>(options)} {}

void Session::on_connected(TimePoint now) {
  impl_->reset();
  impl_->reopen = false;
  impl_->texts_logged = 0;
  impl_->has_values = false;
  impl_->intake.begin();
  impl_->ask(Step::Version, RequestVersion{}, now);
}

void Session::on_bytes(ByteView bytes, TimePoint now) {
  if (impl_->is_online()) impl_->on_bytes(bytes, now);
}

void Session::on_disconnected(TimePoint) {
  if (impl_->is_online())
    impl_->fail(Why::LinkLost, "the connection was closed; check the network and that the controller is on");
}

void Session::on_deadline(TimePoint now) {
  const auto due = deadline();
  if (!due || now < *due) return;
  if (impl_->has_values)
    return impl_->fail(Why::Silent, "no pose for " + std::to_string(std::lround(in_ms(impl_->silence_max))) +
                                        " ms; check the network and that the controller is on");
  impl_->fail(Why::NoReply, std::string("no answer to ") + words_for(impl_->step) + " within " +
                                std::to_string(impl_->options.reply_timeout.count()) +
                                " ms; check that the address is the controller's and that RTDE is enabled on it");
}

std::optional<TimePoint> Session::deadline() const {
  return impl_->is_online() ? std::optional{impl_->waiting_until} : std::nullopt;
}

Bytes Session::take_output() { return std::exchange(impl_->output, {}); }
std::optional<robot::PoseEvent> Session::take_event() { return impl_->intake.take_event(); }
bool Session::take_reopen() { return std::exchange(impl_->reopen, false); }
robot::PoseState Session::state() const { return impl_->intake.state(); }
std::optional<Duration> Session::uncertainty() const { return impl_->intake.clock().uncertainty(); }
std::string Session::controller() const {
  return impl_->version.major == 0 ? "" : "controller software " + impl_->version_text();
}
std::string Session::trouble() const { return impl_->trouble; }
}  // namespace binpick::drivers::rtde
