#include <CLI/CLI.hpp>
#include <chrono>
#include <cstdio>
#include <string>
#include <vector>

#include "base/clock.hpp"
#include "base/overloaded.hpp"
#include "config/config.hpp"
#include "daemon/cycle/record_codec.hpp"
#include "drivers/sweep/pivot_carrier.hpp"
#include "drivers/sweep/sweep.hpp"
#include "tools/commands.hpp"
#include "tools/device_links.hpp"
#include "tools/output.hpp"
#include "vision/cloud.hpp"
#include "vision/depth_image.hpp"
#include "vision/file.hpp"
#include "vision/fill_level.hpp"
#include "vision/registration.hpp"

/// binpick scan CELL.toml -o SCENE.ply: one sweep, saved as a cloud that `detect` reads.
namespace binpick::tools {
namespace {
constexpr Duration kReadyMax = std::chrono::seconds(45);  // a reference run and a scanner's spin-up
constexpr Duration kSweepMax = std::chrono::seconds(60);

using Cloud = std::vector<Eigen::Vector3f>;

struct ScanOrder {
  std::string cell, cloud, record;  ///< Paths; the record's may be empty.
  int supply = 0;                   ///< Id; 0: the first one.
};

/// The raw profiles, for whoever wants to register them otherwise: `binpick calibrate`.
Expected<void, std::string> save_record(const std::string& path, const config::Config& config,
                                        daemon::RecordedScan scan) {
  const auto since_1970 = std::chrono::system_clock::now().time_since_epoch();
  daemon::Record record = daemon::begun_record({config, {}}, 0, 0);
  record.origin.unix_ms = std::chrono::duration_cast<std::chrono::milliseconds>(since_1970).count();
  record.scan = std::move(scan);
  return vision::write_file(path, daemon::encode(record));
}

bool ready(DeviceLinks& devices) {
  return devices.pivot().state() == drivers::pivot::Session::State::Standing &&
         devices.scanner().state() == drivers::scanner::State::Idle;
}

/// What keeps a device from being ready, as it last said itself.
struct Troubles {
  std::string pivot = "no answer from the module", scanner = "no connection";
};

bool bring_up(DeviceLinks& devices, drivers::sweep::PivotCarrier& carrier, Troubles& troubles, TimePoint now,
              TimePoint until) {
  while (!ready(devices)) {
    if (now >= until) return false;
    now = devices.turn(now, until);
    while (auto event = devices.pivot().take_event()) {
      carrier.on(*event);
      if (const auto* failed = std::get_if<drivers::pivot::Failed>(&*event)) troubles.pivot = failed->text;
    }
    while (auto event = devices.scanner().take_event())
      if (const auto* failed = std::get_if<drivers::scanner::Failed>(&*event)) troubles.scanner = failed->text;
  }
  return true;
}

int scan(const ScanOrder& order) {
  const std::string& cell_path = order.cell;
  const auto config = config::load(cell_path);
  if (!config) {
    std::fprintf(stderr, "binpick: %s is not a good cell file; see all findings with: binpick check %s\n",
                 cell_path.c_str(), cell_path.c_str());
    return 2;
  }
  if (config->carrier == config::Carrier::Robot) {
    std::fprintf(stderr, "binpick: the robot carries the scanner of %s; let the PLC ask the daemon for a scan\n",
                 cell_path.c_str());
    return 1;
  }
  const config::Supply* supply = nullptr;
  for (const auto& candidate : config->supplies)
    if (order.supply == 0 || candidate.id == order.supply) {
      supply = &candidate;
      break;
    }
  if (supply == nullptr) {
    std::fprintf(stderr, "binpick: %s has no supply %d; name one of its [[supply]] ids\n", cell_path.c_str(),
                 order.supply);
    return 2;
  }
  for (const auto& path : {order.cloud, order.record})
    if (const auto trouble = path.empty() ? path : cannot_be_written(path); !trouble.empty()) {
      std::fprintf(stderr, "binpick: %s\n", trouble.c_str());
      return 1;
    }
  if (daemon_runs(*config)) {
    std::fprintf(stderr, "binpick: binpickd is at work on %s and holds the devices; stop it before scanning\n",
                 config->plc_line().c_str());
    return 1;
  }

  DeviceLinks devices{*config, true};
  drivers::sweep::PivotCarrier carrier{devices.pivot()};
  carrier.set_latency(config->pivot_latency);
  drivers::sweep::Sweep sweep{carrier, devices.scanner()};
  const SystemClock clock;
  TimePoint now = clock.now();
  Troubles troubles;
  if (!bring_up(devices, carrier, troubles, now, now + kReadyMax)) {
    const bool pivot = devices.pivot().state() != drivers::pivot::Session::State::Standing;
    std::fprintf(stderr, "binpick: the %s is not ready: %s; reach it with: binpick probe %s\n",
                 pivot ? "pivot" : "scanner", (pivot ? troubles.pivot : troubles.scanner).c_str(), cell_path.c_str());
    return 1;
  }

  now = clock.now();
  sweep.begin({.motion = drivers::sweep::PivotSweep{supply->sweep_start, supply->sweep_end, supply->sweep_speed_rad_s,
                                                    supply->sweep_speed_rad_s},
               .scanner_latency = config->scanner_latency},
              now);

  Cloud cloud;
  daemon::RecordedScan raw;
  std::optional<drivers::sweep::Done> done;
  std::optional<std::string> failure;
  const TimePoint until = now + kSweepMax;
  const auto on_sweep = Overloaded{
      [&](const drivers::sweep::RegisteredProfile& registered) {
        const auto T_base_scanner = vision::scanner_at(config->mount, std::get<Angle>(registered.carrier));
        vision::register_profile(registered.profile.x_mm, registered.profile.z_mm,
                                 supply->T_base_supply.inverse() * T_base_scanner, cloud);
        raw.profiles.push_back(registered);
      },
      [&](const drivers::sweep::Done& sweep_done) { done = sweep_done; },
      [&](const drivers::sweep::Failed& failed) { failure = failed.text; },
  };
  while (!done && !failure) {
    now = devices.turn(now, until);
    while (auto event = devices.pivot().take_event())
      if (const auto news = carrier.on(*event)) sweep.on_carrier(*news, now);
    while (auto event = devices.scanner().take_event()) sweep.on_scanner(*event, now);
    if (sweep.deadline() && *sweep.deadline() <= now) sweep.on_deadline(now);
    while (auto event = sweep.take_event()) std::visit(on_sweep, *event);
    if (now >= until && !done) failure = "the sweep did not come to its end";
  }
  devices.turn(now, now);  // the last words: stop
  if (failure) {
    std::fprintf(stderr, "binpick: the sweep failed: %s\n", failure->c_str());
    return 1;
  }
  raw.figures = *done;
  if (!order.record.empty())
    if (const auto saved = save_record(order.record, *config, std::move(raw)); !saved) {
      std::fprintf(stderr, "binpick: %s\n", saved.error().c_str());
      return 1;
    }
  if (const auto saved = vision::save_cloud(order.cloud, cloud); !saved) {
    std::fprintf(stderr, "binpick: %s\n", saved.error().text.c_str());
    return 1;
  }
  vision::DepthImageBuilder builder{0.02 * supply->size_mm.head<2>().maxCoeff(), -supply->size_mm.head<2>() / 2,
                                    supply->size_mm.head<2>() / 2};
  builder.add(cloud);
  const double measured = vision::fill_level(builder.image(), {supply->size_mm}, 1).measured;
  std::printf("%s: %zu points of %zu profiles over supply %u in %.2f s (%llu lost, %zu without a pose)\n",
              order.cloud.c_str(), cloud.size(), done->profiles, supply->id, in_s(done->duration),
              static_cast<unsigned long long>(done->profiles_lost), done->profiles_without_pose);
  if (measured >= vision::kMeasuredMin) return 0;
  std::fprintf(stderr,
               "binpick: only %.0f %% of supply %u was measured; clean the scanner's window, look at its mount and "
               "distance, at the sweep's angles, and for what is dark or mirrors\n",
               100 * measured, unsigned{supply->id});
  return 1;
}
}  // namespace

void add_scan(CLI::App& app, int& exit_status) {
  auto order = std::make_shared<ScanOrder>();
  auto* command = app.add_subcommand("scan", "One sweep, saved as a cloud that detect reads. The pivot moves!");
  command->add_option("CELL.toml", order->cell, "the cell file")->required();
  command->add_option("-o,--output", order->cloud, "the cloud to write (SCENE.ply)")->required();
  command->add_option("--supply", order->supply, "id of the supply; default: the first one");
  command->add_option("--record", order->record, "write the raw profiles too (SCAN.bpr)");
  command->callback([order, &exit_status] { exit_status = scan(*order); });
}
}  // namespace binpick::tools
