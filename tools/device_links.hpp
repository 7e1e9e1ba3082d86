#pragma once

#include <memory>
#include <optional>
#include <string>

#include "base/clock.hpp"
#include "config/config.hpp"
#include "drivers/link/can.hpp"
#include "drivers/link/device_link.hpp"
#include "drivers/link/loop.hpp"
#include "drivers/link/tcp.hpp"
#include "drivers/pivot/probe.hpp"
#include "drivers/scanner/any/scanner.hpp"

namespace binpick::tools {
/// Whether binpickd is at work, and holds pivot and scanner: somebody answers where the PLC connects to, or, in the
/// role of a client, the lock in cell.state_dir is held.
bool daemon_runs(const config::Config& config);

/// Pivot and scanner of a cell file on their real links, for commands that need the devices and not the daemon. The two
/// must not run at the same time (ask daemon_runs first): the scanner serves one client, the pivot obeys two masters.
class DeviceLinks {
 public:
  /// `may_move`: false keeps the pivot from its reference run.
  DeviceLinks(const config::Config& config, bool may_move);

  drivers::pivot::Session& pivot() { return pivot_.session(); }
  /// Without `may_move`: the module is there and speaks this protocol, and not the one that the cell file says.
  std::optional<drivers::pivot::Protocol> pivot_answers_in_other() const { return pivot_.answers_in_other(); }
  drivers::scanner::Scanner& scanner() { return scanner_; }
  drivers::link::Loop& loop() { return loop_; }

  /// Serves deadlines, sends what there is to send, waits for the next event or `until`, whichever is first.
  TimePoint turn(TimePoint now, TimePoint until);
  std::string scanner_trouble() const { return scanner_link_->last_error(); }

 private:
  std::unique_ptr<drivers::link::CanLink> open_pivot(const config::Config& config);

  drivers::link::Loop loop_;
  drivers::pivot::Probe pivot_;
  drivers::scanner::Scanner scanner_;
  std::unique_ptr<drivers::link::CanLink> pivot_link_;  // null: the robot carries the scanner
  std::unique_ptr<drivers::link::DeviceLink> scanner_link_;
};
}  // namespace binpick::tools
