#include <array>

#include "base/overloaded.hpp"
#include "drivers/pivot/protocol.hpp"

namespace binpick::drivers::pivot {
namespace {
constexpr std::array kIdentity{Parameter::Firmware,    Parameter::SerialNumber,   Parameter::Config,
                               Parameter::Setup,       Parameter::PositionMin,    Parameter::PositionMax,
                               Parameter::VelocityMax, Parameter::AccelerationMax};

constexpr std::uint16_t key_of(Command command, unsigned what = 0) {
  return static_cast<std::uint16_t>((static_cast<unsigned>(command) << 8) | what);
}

class PowerCube final : public ModuleProtocol {
 public:
  explicit PowerCube(const Options& options) : id_{options.module_id} {}

  std::vector<link::CanFilter> filters() const override {
    return {{kReplyBase + id_, 0x7FF}, {kStateBase + id_, 0x7FF}, {kSetBase + id_, 0x7FF}};
  }

  std::vector<CanFrame> frames(const Ask& ask) const override {
    std::vector<CanFrame> frames{encode(id_, request_for(ask))};
    if (ask.what == Ask::What::Go && (config_ & config_bit::kSynchronousMotion) != 0)
      frames.push_back(encode(id_, Request{Broadcast{Command::StartMotion}}));
    return frames;
  }

  std::uint16_t key(const Ask& ask) const override {
    return std::visit(
        Overloaded{
            [](const Get& get) { return key_of(Command::GetParameter, static_cast<unsigned>(get.parameter)); },
            [](const Set& set) { return key_of(Command::SetParameter, static_cast<unsigned>(set.parameter)); },
            [](const Plain& plain) { return key_of(plain.command); },
            [](const Move& move) { return key_of(Command::SetMotion, static_cast<unsigned>(move.motion)); },
            [](const Broadcast& broadcast) { return key_of(broadcast.command); },
        },
        request_for(ask));
  }

  bool is_answered(const Ask& ask) const override {
    const bool read =
        ask.what == Ask::What::Identity || ask.what == Ask::What::State || ask.what == Ask::What::Position;
    return read || (config_ & config_bit::kSuppressAcknowledge) == 0;
  }

  Heard hear(const CanFrame& frame) override {
    const auto reply = decode_reply(id_, frame);
    if (reply) return heard(*reply);
    if (reply.error().kind != DecodeError::Kind::NotOurs) return Garbled{to_string(reply.error())};
    if (frame.extended || frame.rtr) return Nothing{};
    if (frame.id > kReplyBase && frame.id <= kReplyBase + kModuleIdMax) return ForeignModule{frame.id - kReplyBase};
    if (const auto request = decode_request(id_, frame); frame.id == kSetBase + id_ && request) return OtherMaster{};
    return Nothing{};
  }

  std::size_t identity_steps() const override { return kIdentity.size(); }

  void learn(std::size_t step, const Answer& answer) override {
    const auto* number = std::get_if<double>(&answer.value);
    const auto* word = std::get_if<std::uint32_t>(&answer.value);
    const auto angle = [&] { return number != nullptr ? *number : 0; };
    switch (kIdentity.at(step)) {
      case Parameter::Firmware:
        module_.firmware = static_cast<std::uint16_t>(word != nullptr ? *word : 0);
        break;
      case Parameter::SerialNumber:
        module_.serial = word != nullptr ? *word : 0;
        break;
      case Parameter::Config:
        config_ = word != nullptr ? *word : 0;
        break;
      case Parameter::PositionMin:
        module_.position_min = Angle::rad(angle());
        break;
      case Parameter::PositionMax:
        module_.position_max = Angle::rad(angle());
        break;
      case Parameter::VelocityMax:
        module_.velocity_max_rad_s = angle();
        break;
      case Parameter::AccelerationMax:
        module_.acceleration_max_rad_s2 = angle();
        break;
      default:
        break;
    }
  }

  const ModuleInfo& module() const override { return module_; }

  std::string problem() const override {
    if ((config_ & config_bit::kLinear) != 0)
      return "the module is a linear axis, not a pivot: is pivot.module_id right?";
    return {};
  }

  bool position_has_state() const override { return has_position_and_state(module_.firmware); }
  std::size_t prepare_steps() const override { return 0; }
  Setpoint setpoint(const SetpointStream& stream, TimePoint now) const override { return stream.at(now); }
  bool repeats_setpoints() const override { return true; }

  std::optional<CanFrame> watchdog() const override {
    if ((config_ & config_bit::kWatchdog) == 0) return std::nullopt;
    return encode(id_, Request{Broadcast{Command::Watchdog}});
  }

 private:
  Request request_for(const Ask& ask) const {
    switch (ask.what) {
      case Ask::What::Identity:
        return Get{kIdentity.at(ask.step)};
      case Ask::What::State:
      case Ask::What::Prepare:  // it has none
        break;
      case Ask::What::Position:
        return Get{position_has_state() ? Parameter::PositionAndState : Parameter::Position};
      case Ask::What::Halt:
        return Plain{Command::Halt};
      case Ask::What::Reset:
        return Plain{Command::Reset};
      case Ask::What::Home:
        return Plain{Command::Home};
      case Ask::What::Go:
        return Move{Motion::Step, static_cast<float>(ask.to.position_rad), ask.to.time_ms};
    }
    return Get{Parameter::StateWord};
  }

  static Answer of(const Value& value) {
    Answer answer = reading_of(key_of(Command::GetParameter, static_cast<unsigned>(value.parameter)));
    std::visit(Overloaded{
                   [&](float number) { answer.value = static_cast<double>(number); },
                   [&](std::uint32_t word) { answer.value = word; },
                   [&](std::uint16_t word) { answer.value = std::uint32_t{word}; },
                   [&](const PositionReport& report) {
                     answer.position_rad = static_cast<double>(report.position_rad);
                     answer.shorts = report.short_state;
                   },
               },
               value.value);
    if (value.parameter == Parameter::Position) answer.position_rad = static_cast<double>(std::get<float>(value.value));
    if (value.parameter == Parameter::StateWord) answer.state = ModuleState{std::get<std::uint32_t>(value.value), 0};
    return answer;
  }

  static Heard heard(const Reply& reply) {
    const auto echo = [](std::uint16_t key) { return Heard{echo_of(key)}; };
    return std::visit(Overloaded{
                          [](const Value& value) { return Heard{of(value)}; },
                          [&](const SetDone& done) {
                            return echo(key_of(Command::SetParameter, static_cast<unsigned>(done.parameter)));
                          },
                          [&](const PlainDone& done) { return echo(key_of(done.command)); },
                          [&](const MoveAccepted& accepted) {
                            return echo(key_of(Command::SetMotion, static_cast<unsigned>(accepted.motion)));
                          },
                          [](const StateNews&) { return Heard{StateChanged{}}; },
                      },
                      reply);
  }

  std::uint8_t id_;
  ModuleInfo module_;
  std::uint32_t config_ = 0;
};
}  // namespace

std::unique_ptr<ModuleProtocol> make_powercube(const Options& options) { return std::make_unique<PowerCube>(options); }
}  // namespace binpick::drivers::pivot
