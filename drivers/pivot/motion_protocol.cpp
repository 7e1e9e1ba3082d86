#include <array>
#include <cstdio>

#include "base/overloaded.hpp"
#include "drivers/pivot/motion_errors.hpp"
#include "drivers/pivot/protocol.hpp"

namespace binpick::drivers::pivot {
namespace {
using namespace std::chrono_literals;
using motion::ConfigItem;
using MotionCommand = motion::Command;

/// What is asked of a module, in this order: without its unit system no number can be read.
struct Question {
  std::optional<ConfigItem> item;  ///< None: its type.
};
constexpr std::array kIdentity{
    Question{ConfigItem::UnitSystem},      Question{std::nullopt},
    Question{ConfigItem::SerialNumber},    Question{ConfigItem::PositionMin},
    Question{ConfigItem::PositionMax},     Question{ConfigItem::VelocityMax},
    Question{ConfigItem::AccelerationMax},
};
/// Frames that follow one another within a millisecond can throw a module off the bus (Pejman712/CRF); twice that.
constexpr Duration kWriteGap = 2ms;

constexpr std::uint16_t key_of(MotionCommand command, unsigned what = 0) {
  return static_cast<std::uint16_t>((static_cast<unsigned>(command) << 8) | what);
}
std::uint16_t key_of(const std::optional<ConfigItem>& item) {
  return key_of(MotionCommand::GetConfig, item ? static_cast<unsigned>(*item) : 0);
}

class MotionModule final : public ModuleProtocol {
 public:
  explicit MotionModule(const Options& options) : id_{options.module_id}, looks_only_{options.identify_only} {}

  std::vector<link::CanFilter> filters() const override {
    return {{motion::kReplyBase + id_, 0x7FF}, {motion::kErrorBase + id_, 0x7FF}, {motion::kCommandBase + id_, 0x7FF}};
  }

  std::vector<CanFrame> frames(const Ask& ask) const override {
    return frames_of(motion::kCommandBase + id_, encode(request_for(ask), units_));
  }

  std::uint16_t key(const Ask& ask) const override {
    return std::visit(Overloaded{
                          [](const motion::GetConfig& get) { return key_of(get.item); },
                          [](const motion::GetState&) { return key_of(MotionCommand::GetState); },
                          [](const motion::SetTarget& set) { return key_of(set.command); },
                          [](const motion::MovePosition&) { return key_of(MotionCommand::MovePosition); },
                          [](const motion::Plain& plain) { return key_of(plain.command); },
                      },
                      request_for(ask));
  }

  bool is_answered(const Ask&) const override { return true; }

  Heard hear(const CanFrame& frame) override {
    if (frame.extended || frame.rtr || frame.error) return Nothing{};
    const bool reply = frame.id == motion::kReplyBase + id_;
    const bool error = frame.id == motion::kErrorBase + id_;
    if (frame.id == motion::kCommandBase + id_) return is_command(frame) ? Heard{OtherMaster{}} : Heard{Nothing{}};
    if (!reply && !error) {
      if (frame.id > motion::kReplyBase && frame.id <= motion::kReplyBase + 0xFF)
        return ForeignModule{frame.id - motion::kReplyBase};
      return Nothing{};
    }
    const auto message = (reply ? replies_ : errors_).take(frame);
    if (!message) return Garbled{to_string(message.error())};
    if (!*message) return Nothing{};
    auto decoded = decode_reply(**message, units_);
    if (!decoded) {
      DecodeError error_of_message = decoded.error();
      error_of_message.id = frame.id;
      return Garbled{to_string(error_of_message)};
    }
    return heard(*decoded);
  }

  std::size_t identity_steps() const override { return kIdentity.size(); }

  void learn(std::size_t step, const Answer& answer) override {
    const auto item = kIdentity.at(step).item;
    if (step == 0) problem_.clear();
    if (answer.refused) {
      // Its name and number are nice to have; limits that are not told cannot be kept.
      if (item && *item != ConfigItem::SerialNumber)
        problem_ = "the module does not tell its limits: " + motion::info_in_words(*answer.refused);
      return;
    }
    if (const auto* type = std::get_if<motion::ModuleType>(&answer.value)) {
      module_.type = type->type;
      module_.firmware = type->firmware;
    }
    if (!item) return;
    if (const auto* word = std::get_if<std::uint32_t>(&answer.value)) {
      if (*item == ConfigItem::SerialNumber) module_.serial = *word;
      if (*item == ConfigItem::UnitSystem) learn_units(static_cast<motion::UnitSystem>(*word));
    }
    const auto* number = std::get_if<double>(&answer.value);
    if (number == nullptr) return;
    if (*item == ConfigItem::PositionMin) module_.position_min = Angle::rad(*number);
    if (*item == ConfigItem::PositionMax) module_.position_max = Angle::rad(*number);
    if (*item == ConfigItem::VelocityMax) module_.velocity_max_rad_s = *number;
    if (*item == ConfigItem::AccelerationMax) module_.acceleration_max_rad_s2 = *number;
  }

  const ModuleInfo& module() const override { return module_; }
  std::string problem() const override { return problem_; }

  bool position_has_state() const override { return true; }
  std::size_t prepare_steps() const override { return 2; }
  Setpoint setpoint(const SetpointStream& stream, TimePoint now) const override { return stream.ahead(now); }
  /// Each is answered; one that was lost is sent again for that reason.
  bool repeats_setpoints() const override { return false; }
  Duration write_gap() const override { return kWriteGap; }

 private:
  motion::Request request_for(const Ask& ask) const {
    switch (ask.what) {
      case Ask::What::Identity:
        return motion::GetConfig{kIdentity.at(ask.step).item};
      case Ask::What::State:
      case Ask::What::Position:
        break;
      case Ask::What::Halt:
        return motion::Plain{MotionCommand::FastStop};
      case Ask::What::Reset:
        return motion::Plain{MotionCommand::Acknowledge};
      case Ask::What::Home:
        return motion::Plain{MotionCommand::Reference};
      case Ask::What::Prepare:
        if (ask.step == 0) return motion::SetTarget{MotionCommand::SetTargetVelocity, ask.speed};
        return motion::SetTarget{MotionCommand::SetTargetAcceleration, ask.acceleration};
      case Ask::What::Go:
        return motion::MovePosition{ask.to.position_rad, std::nullopt, std::nullopt};
    }
    // A period of zero gives one report and ends the reports that another program may have left on. Whoever only looks
    // leaves those on.
    if (looks_only_) return motion::GetState{};
    return motion::GetState{motion::GetState::Cyclic{0, motion::report_mode::kPosition}};
  }

  void learn_units(motion::UnitSystem units) {
    units_ = units;
    if (!is_angle(units))
      problem_ = std::string("the module counts in ") + to_string(units) +
                 ", not in angles: set its unit system to degrees with the vendor's tool; is pivot.module_id right?";
  }

  /// Whether a frame to our module changes anything in it. Fragments are parts of moves and settings.
  static bool is_command(const CanFrame& frame) {
    if (frame.length < 2) return false;
    const auto command = static_cast<MotionCommand>(frame.payload[1]);
    return command != MotionCommand::GetState && command != MotionCommand::GetConfig &&
           command != MotionCommand::Acknowledge;
  }

  static Heard heard(const motion::Reply& reply) {
    const auto echo = [](MotionCommand command) { return echo_of(key_of(command)); };
    return std::visit(Overloaded{
                          [&](const motion::StateReport& report) {
                            Answer answer = reading_of(key_of(MotionCommand::GetState));
                            answer.unasked = true;
                            answer.position_rad = report.position_rad;
                            answer.state = ModuleState{
                                motion::state_word(report.state, report.error),
                                (report.state & motion::state_byte::kError) != 0 ? report.error : std::uint8_t{0}};
                            return Heard{answer};
                          },
                          [&](const motion::ConfigValue& value) {
                            Answer answer = reading_of(key_of(value.item));
                            std::visit([&answer](const auto& v) { answer.value = v; }, value.value);
                            return Heard{answer};
                          },
                          [&](const motion::ModuleType& type) {
                            Answer answer = reading_of(key_of(std::nullopt));
                            answer.value = type;
                            return Heard{answer};
                          },
                          [&](const motion::Done& done) {
                            Answer answer = echo(done.command);
                            answer.unfinished = done.command == MotionCommand::GetState;
                            return Heard{answer};
                          },
                          [&](const motion::MoveTime&) { return Heard{echo(MotionCommand::MovePosition)}; },
                          [&](const motion::Refused& refused) {
                            Answer answer = echo(static_cast<MotionCommand>(refused.command));
                            answer.refused = refused.code;
                            return Heard{answer};
                          },
                          [](const motion::Trouble&) { return Heard{StateChanged{}}; },
                          [](const motion::Info&) { return Heard{StateChanged{}}; },
                          [](const motion::Impulse& impulse) {
                            return impulse.kind == MotionCommand::MoveBlocked ? Heard{Blocked{impulse.position_rad}}
                                                                              : Heard{StateChanged{}};
                          },
                      },
                      reply);
  }

  std::uint8_t id_;
  bool looks_only_;
  motion::UnitSystem units_ = motion::UnitSystem::Degree;
  motion::Assembler replies_, errors_;
  ModuleInfo module_;
  std::string problem_;
};
}  // namespace

std::unique_ptr<ModuleProtocol> make_motion(const Options& options) { return std::make_unique<MotionModule>(options); }
}  // namespace binpick::drivers::pivot
