#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "drivers/pivot/motion_codec.hpp"
#include "drivers/pivot/session.hpp"
#include "drivers/pivot/setpoints.hpp"
#include "drivers/pivot/state_word.hpp"

/// What the session wants of a module and what it hears from it, whatever the module speaks. Two protocols are behind
/// it: PowerCube (powercube_protocol.cpp) and the Motion Protocol (motion_protocol.cpp).
namespace binpick::drivers::pivot {
struct Ask {
  enum class What {
    Identity,  ///< The `step`-th question of who it is.
    State,
    Position,
    Halt,   ///< Stops at once; the module then needs a Reset.
    Reset,  ///< Clears error and halt; it moves nothing.
    Home,
    Prepare,  ///< The `step`-th setting before a move, where a module has such.
    Go,
  } what = What::State;
  std::size_t step = 0;
  Setpoint to{};                       ///< Go.
  double speed = 0, acceleration = 0;  ///< Prepare.
};

struct Answer {
  std::uint16_t key = 0;  ///< Equal to that of the ask it answers; of a refusal the first byte alone.
  bool reads = false;     ///< It carries what was read; else it is an echo.
  bool unfinished =
      false;             ///< The module has heard; what was asked may come as another message, or must be asked again.
  bool unasked = false;  ///< It may come periodically, on behalf of somebody else.
  std::optional<double> position_rad;
  std::optional<std::uint8_t> shorts;  ///< Short state, where it comes without the whole one.
  std::optional<ModuleState> state;
  std::optional<std::uint8_t> refused;                                            ///< The module's reason.
  std::variant<std::monostate, double, std::uint32_t, motion::ModuleType> value;  ///< Of an identity step.
};
inline Answer echo_of(std::uint16_t key) {
  Answer answer;
  answer.key = key;
  return answer;
}
inline Answer reading_of(std::uint16_t key) {
  Answer answer = echo_of(key);
  answer.reads = true;
  return answer;
}
struct Nothing {};       ///< Not for us, or no news.
struct StateChanged {};  ///< The module spoke by itself: ask for its state.
struct Garbled {
  std::string text;
};
struct ForeignModule {
  unsigned id = 0;
};                      ///< Another module answers somebody.
struct OtherMaster {};  ///< Somebody else commands our module.
struct Blocked {
  double position_rad = 0;
};  ///< The module says that its axis cannot go on.
using Heard = std::variant<Nothing, Answer, StateChanged, Garbled, ForeignModule, OtherMaster, Blocked>;

class ModuleProtocol {
 public:
  virtual ~ModuleProtocol() = default;

  virtual std::vector<link::CanFilter> filters() const = 0;
  virtual std::vector<CanFrame> frames(const Ask& ask) const = 0;
  virtual std::uint16_t key(const Ask& ask) const = 0;
  virtual bool is_answered(const Ask& ask) const = 0;
  virtual Heard hear(const CanFrame& frame) = 0;

  virtual std::size_t identity_steps() const = 0;
  virtual void learn(std::size_t step, const Answer& answer) = 0;
  virtual const ModuleInfo& module() const = 0;
  /// Why the module that was identified cannot be used; empty when it can.
  virtual std::string problem() const = 0;

  /// Whether the answer to Position says all that State would.
  virtual bool position_has_state() const = 0;
  virtual std::size_t prepare_steps() const = 0;
  virtual Setpoint setpoint(const SetpointStream& stream, TimePoint now) const = 0;
  /// Whether a set-point like the one before is sent again.
  virtual bool repeats_setpoints() const = 0;

  virtual Duration write_gap() const { return Duration{0}; }                 ///< Least time between two frames of ours.
  virtual std::optional<CanFrame> watchdog() const { return std::nullopt; }  ///< To be sent periodically.
};

std::unique_ptr<ModuleProtocol> make_protocol(const Options& options);
std::unique_ptr<ModuleProtocol> make_powercube(const Options& options);
std::unique_ptr<ModuleProtocol> make_motion(const Options& options);
}  // namespace binpick::drivers::pivot
