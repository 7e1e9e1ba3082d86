#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "drivers/scanner/lps36/codec.hpp"
#include "drivers/scanner/lps36/session.hpp"

/// What a session asks of the device, one thing after the other, each with the words for a message.
namespace binpick::drivers::lps36 {
struct Setting {
  bool is_user = false;  ///< A user parameter, else one of the active inspection task.
  std::uint16_t id = 0;
  std::vector<std::uint16_t> values;
  std::string what;  ///< "the exposure".
};
/// Each is set, then read back: two answers to the same kind of command cannot be told apart, an answer that names the
/// parameter can.
std::vector<Setting> settings_of(const Options& options);

enum class Ask { DropOld, Connect, EnterCommandMode, Set, ReadBack, Check, Start, Stop };
struct Step {
  Ask ask = Ask::Check;
  std::size_t setting = 0;  ///< Of Set and ReadBack.
};
Telegram telegram_of(const Step& step, const Options& options, const std::vector<Setting>& settings);
std::string words_for(const Step& step, const std::vector<Setting>& settings);
/// A refusal may also mean that the device has done already what it is asked for: its first answer was lost. `said` is
/// the refusal's status.
bool is_done_already(Ask ask, Status said);
}  // namespace binpick::drivers::lps36
