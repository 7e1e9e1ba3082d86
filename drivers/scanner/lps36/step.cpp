#include "drivers/scanner/lps36/step.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>

namespace binpick::drivers::lps36 {
namespace {
/// A length as the device takes it, in tenths of a millimetre. What no word holds becomes the nearest that one does:
/// the device refuses it by its own limits.
std::uint16_t tenths(Length length) {
  using Limits = std::numeric_limits<std::int16_t>;
  const double counts =
      std::clamp(std::round(length.in_mm() / kCount_mm), double{Limits::min()}, double{Limits::max()});
  return std::bit_cast<std::uint16_t>(static_cast<std::int16_t>(counts));
}
}  // namespace

std::vector<Setting> settings_of(const Options& options) {
  const std::uint16_t is_triggered = options.trigger != Options::Trigger::FreeRunning;
  std::vector<Setting> settings{
      {true, user::kXDisabled, {0}, "the output of X telegrams"},
      {true, user::kPause, {static_cast<std::uint16_t>(std::clamp(options.pause_steps, 0, 9))}, "the pause after Z"},
      {false, task::kOperationMode, {is_triggered}, "the operation mode"},
      {false, task::kActivation, {0}, "the activation input"}};
  if (options.manual_exposure) {
    const auto tenths_us = std::clamp<std::int64_t>(10 * options.manual_exposure->count(), 0, 0xFFFF);
    settings.push_back({false, task::kManualExposure, {static_cast<std::uint16_t>(tenths_us)}, "the manual exposure"});
  }
  if (options.exposure)
    settings.push_back({false, task::kExposure, {static_cast<std::uint16_t>(*options.exposure)}, "the exposure"});
  if (const auto& field = options.field_of_view) {
    settings.push_back({false, task::kFieldX, {tenths(field->x_min), tenths(field->x_max)}, "the field of view in X"});
    settings.push_back({false, task::kFieldZ, {tenths(field->z_min), tenths(field->z_max)}, "the field of view in Z"});
  }
  return settings;
}

Telegram telegram_of(const Step& step, const Options& options, const std::vector<Setting>& settings) {
  switch (step.ask) {
    case Ask::DropOld:
      return command(Id::Disconnect);
    case Ask::Connect:
      return connect(options.hi);
    case Ask::EnterCommandMode:
    case Ask::Stop:
      return command(Id::EnterCommandMode);
    case Ask::Set: {
      const Setting& setting = settings[step.setting];
      return setting.is_user ? set_user_parameter(false, setting.id, setting.values[0])
                             : set_task_parameter(false, setting.id, setting.values);
    }
    case Ask::ReadBack: {
      const Setting& setting = settings[step.setting];
      return setting.is_user ? get_user_parameter(setting.id) : get_task_parameter(setting.id);
    }
    case Ask::Start:
      return command(Id::ExitCommandMode);
    case Ask::Check:
      break;
  }
  return command(Id::GetTask);
}

std::string words_for(const Step& step, const std::vector<Setting>& settings) {
  switch (step.ask) {
    case Ask::DropOld:
      return "the disconnect before start-up";
    case Ask::Connect:
      return "the connect";
    case Ask::EnterCommandMode:
      return "the change to command mode";
    case Ask::Set:
      return "the setting of " + settings[step.setting].what;
    case Ask::ReadBack:
      return "the reading of " + settings[step.setting].what;
    case Ask::Check:
      return "the idle check";
    case Ask::Start:
      return "the start of measuring";
    case Ask::Stop:
      return "the stop of measuring";
  }
  return "?";
}

bool is_done_already(Ask ask, Status said) {
  switch (ask) {
    case Ask::DropOld:
      return true;  // nobody was connected
    case Ask::EnterCommandMode:
    case Ask::Stop:
    case Ask::Check:  // a device that does not know the command is alive
      return said.mode() == Mode::Command;
    case Ask::Start:
      return said.mode() == Mode::Measure;
    default:
      return false;
  }
}
}  // namespace binpick::drivers::lps36
