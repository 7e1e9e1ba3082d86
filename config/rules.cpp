#include "config/rules.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

#include "config/wording.hpp"

namespace binpick::config {
namespace {
constexpr double kFieldOfViewEndDeg = 125;  // LMS 400: 55 … 125, 90 straight ahead
constexpr unsigned kPowerCubeIdMax = 31;
constexpr double kSweepMinDeg = 1;
constexpr double kProfilesMin = 20;

std::string rounded(double v) { return number_text(std::round(v * 1000) / 1000); }
std::string ms(std::chrono::milliseconds d) { return std::to_string(d.count()); }

std::string port_of(const std::string& endpoint) { return endpoint.substr(endpoint.rfind(':') + 1); }

/// What makes a key right instead, where the choice that it hangs on was left to its default.
std::string or_choose(const KeyFacts& facts, const CellPlaces& at) {
  const std::string condition = facts.only_for;
  const std::size_t dot = condition.find('.'), equals = condition.find(" = ");
  const std::string section = condition.substr(0, dot), name = condition.substr(dot + 1, equals - dot - 1);
  if (condition.find(',') != std::string::npos || at.given(section, name) || at.bad(section, name)) return {};
  return ", or write " + name + " = \"" + condition.substr(equals + 3) + "\" in [" + section + "]";
}

/// Keys that are for one kind of device only.
template <class Target>
void check_only_for(const Section<Target>& section, const std::string& where, const Places& places, Config config,
                    const CellPlaces& at, Findings& findings) {
  for (const auto& key : section.keys) {
    if (*key.facts.only_for == '\0') continue;
    const auto is_for_us = is_for(key.facts, config, at);
    const std::string name = std::string{section.name} + "." + key.facts.name;
    if (!is_for_us) continue;
    if (!*is_for_us && places.given(key.facts.name))
      findings.add(places.of(key.facts.name),
                   name + " is for " + key.facts.only_for + " only; remove it" + or_choose(key.facts, at));
    if (*is_for_us && key.facts.required && places.is_there && !places.given(key.facts.name) &&
        !places.bad.contains(key.facts.name) && !at.damaged_keys.contains(key.facts.name))
      report_missing(key.facts, name, where, places.header, findings);
  }
}

void check_devices(const Config& c, const CellPlaces& at, Findings& findings) {
  const bool is_sick = c.scanner_model == ScannerModel::Lms400;
  const double end_deg = c.lms400.start.in_deg() + c.lms400.range.in_deg();
  if (is_sick && end_deg > kFieldOfViewEndDeg + 1e-9) {
    const bool range_given = at.given("scanner", "range_deg");
    findings.add(at.of("scanner", range_given ? "range_deg" : "start_deg"),
                 "scanner.start_deg + scanner.range_deg = " + rounded(end_deg) +
                     " is beyond the field of view, 55 … 125; use range_deg = " +
                     rounded(kFieldOfViewEndDeg - c.lms400.start.in_deg()) + " at most");
  }
  if (c.carrier == Carrier::Pivot && c.pivot.setpoint_horizon < 2 * c.pivot.sample_period) {
    const bool horizon_given = at.given("pivot", "setpoint_horizon_ms");
    findings.add(at.of("pivot", horizon_given ? "setpoint_horizon_ms" : "sample_period_ms"),
                 "pivot.setpoint_horizon_ms = " + ms(c.pivot.setpoint_horizon) +
                     " is less than two sample periods of " + ms(c.pivot.sample_period) +
                     " ms, the pivot would halt between set-points; use at least " + ms(2 * c.pivot.sample_period));
  }
  if (!is_sick && c.manual_exposure_us && c.lps36.exposure != drivers::lps36::Exposure::Manual)
    findings.add(at.of("scanner", "manual_exposure_us"),
                 "scanner.manual_exposure_us has no effect; write exposure = \"manual\", or remove it");
  if (!is_sick && !c.manual_exposure_us && c.lps36.exposure == drivers::lps36::Exposure::Manual)
    findings.add(at.of("scanner", "exposure"),
                 "scanner.exposure = \"manual\" needs the time; add, for example: manual_exposure_us = 300");
  if (c.scanner_model == ScannerModel::Lps36 && c.manual_exposure_us && *c.manual_exposure_us < 98)
    findings.add(at.of("scanner", "manual_exposure_us"),
                 "scanner.manual_exposure_us = " + std::to_string(*c.manual_exposure_us) +
                     " is less than an LPS 36 can; use 98 … 1310");
  if (c.pivot.protocol == drivers::pivot::Protocol::PowerCube && c.pivot.module_id > kPowerCubeIdMax)
    findings.add(at.of("pivot", "module_id"),
                 "pivot.module_id = " + std::to_string(c.pivot.module_id) +
                     " is above 31, the last number of a PowerCube module; correct it, or set protocol = \"motion\"");
  if (c.pivot_can_listen_port != 0 && at.given("pivot", "can") && !c.pivot_can.starts_with("cannelloni://"))
    findings.add(at.of("pivot", "can_listen_port"),
                 "pivot.can_listen_port is for cannelloni, but pivot.can is a network interface; remove it");
}

void check_servers(const Config& c, const CellPlaces& at, Findings& findings) {
  if (const auto beat = c.plc.heartbeat_timeout; beat.count() > 0 && beat.count() < 100)
    findings.add(at.of("plc", "heartbeat_timeout_ms"),
                 "plc.heartbeat_timeout_ms = " + ms(beat) +
                     " is shorter than a PLC's cycle may be; use 0 (not watched) or at least 100");
  if (c.detection.deadline >= c.plc.detect_timeout) {
    const bool deadline_given = at.given("detection", "deadline_ms");
    findings.add(deadline_given ? at.of("detection", "deadline_ms") : at.of("plc", "detect_timeout_ms"),
                 "detection.deadline_ms = " + ms(c.detection.deadline) +
                     " is not shorter than plc.detect_timeout_ms = " + ms(c.plc.detect_timeout) +
                     "; use less, or a longer time-out");
  }
  const bool polls = c.plc.role == plc::LineRole::Client;
  if (const auto beat = c.plc.heartbeat_timeout; polls && beat.count() > 0 && beat < 2 * c.plc.poll) {
    const bool poll_given = at.given("plc", "poll_ms");
    findings.add(at.of("plc", poll_given ? "poll_ms" : "heartbeat_timeout_ms"),
                 "plc.heartbeat_timeout_ms = " + ms(beat) + " is less than two polls of " + ms(c.plc.poll) +
                     " ms, the PLC would be taken for lost between them; poll more often, or use at least " +
                     ms(2 * c.plc.poll));
  }
  if (polls && c.plc.address.empty() && !at.bad("plc", "address"))
    findings.add(at.of("plc", "role"),
                 "plc.role is \"client\", but where the PLC's Modbus server is does not stand there; write address = "
                 "\"192.168.0.10:502\" below");
  if (polls && at.given("plc", "listen"))
    findings.add(at.of("plc", "listen"),
                 "plc.listen is for the role server, but plc.role is \"client\" and nobody connects here; remove it");
  if (!polls && !c.plc.address.empty())
    findings.add(
        at.of("plc", "address"),
        "plc.address is for the role client, but plc.role is \"server\"; remove it, or write role = \"client\" "
        "and remove listen");
}

/// An address of the cell: one that it listens on, or that of a device it connects to.
struct Line {
  const char *section, *key;
  const std::string* endpoint;
  bool listens;
};

std::string host_of(const std::string& endpoint) { return endpoint.substr(0, endpoint.rfind(':')); }

bool is_any(const std::string& host) { return host.empty() || host == "0.0.0.0" || host == "[::]"; }
bool is_this_machine(const std::string& host) {
  return is_any(host) || host == "localhost" || host == "[::1]" || host.starts_with("127.");
}

/// Two sockets on one port, a device that would be ourselves, or two devices at one address.
bool clash(const Line& a, const Line& b) {
  const std::string port = port_of(*a.endpoint), host_a = host_of(*a.endpoint), host_b = host_of(*b.endpoint);
  if (port == "0" || port != port_of(*b.endpoint)) return false;
  if (a.listens && b.listens) return true;  // on two addresses of one machine it would confuse whoever reads it
  if (host_a == host_b) return true;
  return (a.listens || b.listens) && is_this_machine(host_a) && is_this_machine(host_b) &&
         (is_any(a.listens ? host_a : host_b));
}

void check_lines(const Config& c, const CellPlaces& at, Findings& findings) {
  const bool polls = c.plc.role == plc::LineRole::Client;
  const bool is_tcp = c.scanner_model == ScannerModel::Lms400;
  const std::string none;
  const std::array lines{
      polls ? Line{"plc", "address", &c.plc.address, false} : Line{"plc", "listen", &c.plc_listen, true},
      Line{"scanner", "address", is_tcp ? &c.scanner_address : &none, false},
      Line{"robot", "listen", &c.robot_listen, true},
      Line{"robot", "pose_address", c.carrier == Carrier::Robot ? &c.pose_address : &none, false},
      Line{"robot", "pose_listen", c.carrier == Carrier::Robot ? &c.pose_listen : &none, true}};
  const auto name = [](const Line& line) { return std::string{line.section} + "." + line.key; };
  for (std::size_t i = 0; i < lines.size(); ++i)
    for (std::size_t k = 0; k < i; ++k) {
      const Line &one = lines[i], &other = lines[k];
      if (one.endpoint->empty() || other.endpoint->empty() || !clash(one, other)) continue;
      if (one.listens && other.listens)
        findings.add(at.of(one.section, one.key), name(one) + " has the same port as " + name(other) + ", " +
                                                      port_of(*one.endpoint) + "; use another, such as " +
                                                      (std::string_view{one.key} == "listen" ? "5002" : "5003"));
      else
        findings.add(at.of(one.section, one.key), name(one) + " = \"" + *one.endpoint + "\" is also where " +
                                                      name(other) + " is; give each device's own address and port");
      break;
    }
}

/// Who tells where the robot is while it carries the scanner.
void check_robot_carrier(const Config& c, const CellPlaces& at, Findings& findings) {
  if (c.carrier != Carrier::Robot) return;
  if (c.robot_listen.empty() && !at.bad("robot", "listen"))
    findings.add(at.of("robot", "listen"),
                 "robot.listen is empty, but the robot carries the scanner; add, for example: listen = "
                 "\"0.0.0.0:5002\"");
  const bool is_ur = c.robot.dialect == drivers::robot::Dialect::UniversalRobots;
  if (is_ur && c.pose_address.empty() && !at.bad("robot", "pose_address"))
    findings.add(at.of("robot", "pose_address"),
                 "robot.pose_address is missing, but the robot carries the scanner; add, for example: pose_address = "
                 "\"192.168.0.20:30004\"");
  if (!is_ur && c.pose_listen.empty() && !at.bad("robot", "pose_listen"))
    findings.add(at.of("robot", "pose_listen"),
                 "robot.pose_listen is missing, but the robot carries the scanner; add, for example: pose_listen = "
                 "\"0.0.0.0:5003\"");
  if (is_ur && !c.pose_listen.empty())
    findings.add(at.of("robot", "pose_listen"),
                 "robot.pose_listen is for dialect fanuc and kawasaki; remove it, ur has pose_address");
  if (!is_ur && !c.pose_address.empty())
    findings.add(at.of("robot", "pose_address"),
                 "robot.pose_address is for dialect ur; remove it, others have pose_listen");
  const auto longest = std::min(c.plc.scan_timeout, std::chrono::milliseconds{c.robot.silence_max});
  for (std::size_t i = 0; i < c.supplies.size(); ++i)
    if (c.supplies[i].path_timeout >= longest)
      findings.add(at.supplies[i].of("path_timeout_ms"),
                   "supply.path_timeout_ms = " + ms(c.supplies[i].path_timeout) +
                       " is not less than plc.scan_timeout_ms = " + ms(c.plc.scan_timeout) +
                       " and robot.silence_max_s = " + std::to_string(c.robot.silence_max.count()) +
                       "; use less, or longer time-outs");
}

void check_sweeps(const Config& c, const CellPlaces& at, Findings& findings) {
  if (c.carrier != Carrier::Pivot) return;
  constexpr double kLeuzeFrequency_hz = 100;
  const double profiles_per_s = c.scanner_model == ScannerModel::Lms400 ? c.lms400.frequency_hz : kLeuzeFrequency_hz;
  for (std::size_t i = 0; i < c.supplies.size(); ++i) {
    const Supply& supply = c.supplies[i];
    const Places& places = at.supplies[i];
    if (!places.given("sweep_start_deg") || !places.given("sweep_end_deg")) continue;
    const double range_deg = std::abs((supply.sweep_end - supply.sweep_start).in_deg());
    const double duration_s = Angle::deg(range_deg).in_rad() / supply.sweep_speed_rad_s;
    if (range_deg < kSweepMinDeg) {
      findings.add(places.of("sweep_end_deg"), "supply.sweep_end_deg is " + rounded(range_deg) +
                                                   " deg from sweep_start_deg, that is no sweep; use at least " +
                                                   rounded(kSweepMinDeg));
      continue;
    }
    const bool speed_given = places.given("sweep_speed_deg_s");
    const Place& place = places.of(speed_given ? "sweep_speed_deg_s" : "sweep_end_deg");
    if (duration_s >= in_s(c.plc.scan_timeout)) {
      findings.add(place, "supply: the sweep takes " + rounded(duration_s) +
                              " s, not less than plc.scan_timeout_ms = " + ms(c.plc.scan_timeout) +
                              "; sweep faster, or use a longer time-out");
    } else if (duration_s * profiles_per_s < kProfilesMin) {
      findings.add(place, "supply: the sweep gives " + rounded(std::floor(duration_s * profiles_per_s)) +
                              " profiles; sweep slower or farther, " + rounded(kProfilesMin) + " are the least");
    }
  }
}

template <class Entry>
void check_ids(const std::vector<Entry>& entries, const std::vector<Places>& places, const std::string& section,
               Findings& findings) {
  for (std::size_t i = 0; i < entries.size(); ++i)
    for (std::size_t k = 0; k < i; ++k)
      if (places[i].given("id") && places[k].given("id") && entries[i].id == entries[k].id) {
        findings.add(places[i].of("id"), section + ".id = " + std::to_string(entries[i].id) + " stands also in line " +
                                             std::to_string(places[k].of("id").line) + "; give each entry its own");
        break;
      }
}
}  // namespace

std::optional<bool> is_for(const KeyFacts& facts, Config config, const CellPlaces& at) {
  const std::string condition = facts.only_for;
  if (condition.empty()) return true;
  const std::size_t dot = condition.find('.'), equals = condition.find(" = ");
  const std::string section = condition.substr(0, dot), name = condition.substr(dot + 1, equals - dot - 1);
  for (const auto& candidate : cell_sections())
    for (const auto& key : candidate.keys)
      if (section == candidate.name && name == key.facts.name) {
        if (key.facts.required && !at.given(section, name)) return std::nullopt;
        const std::string value = key.facts.choices[std::get<Chosen>(key.slot(config)).get()];
        return (", " + condition.substr(equals + 3) + ",").find(", " + value + ",") != std::string::npos;
      }
  return std::nullopt;
}

void check_rules(const Config& config, const CellPlaces& places, Findings& findings) {
  for (const auto& section : cell_sections())
    check_only_for(section, "[" + std::string{section.name} + "]", places.sections.at(section.name), config, places,
                   findings);
  for (const Places& supply : places.supplies)
    check_only_for(supply_section(), "[[supply]]", supply, config, places, findings);
  check_devices(config, places, findings);
  check_servers(config, places, findings);
  check_lines(config, places, findings);
  check_robot_carrier(config, places, findings);
  check_sweeps(config, places, findings);
  check_geometry(config, places, findings);
  check_ids(config.supplies, places.supplies, "supply", findings);
  check_ids(config.recipes, places.parts, "part", findings);
}
}  // namespace binpick::config
