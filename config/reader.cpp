#include "config/reader.hpp"

#include <arpa/inet.h>
#include <cmath>
#include <cstdio>
#include <numbers>
#include <unordered_map>

#include "base/check.hpp"
#include "base/overloaded.hpp"
#include "base/rotation.hpp"
#include "config/wording.hpp"

namespace binpick::config {
namespace {
/// Texts longer than this are no name, path or address.
constexpr std::size_t kTextMax = 1024;
/// Beyond this a translation is not in a cell.
constexpr double kTranslationMaxMm = 20'000;

std::string quoted(std::string_view text) {
  return "\"" + printable(text.substr(0, 60)) + (text.size() > 60 ? "…" : "") + "\"";
}

/// A value as it is named in a finding.
std::string shown(const Value& value) {
  switch (value.kind) {
    case Value::Kind::Flag:
      return value.flag ? "true" : "false";
    case Value::Kind::Integer:
      return std::to_string(value.integer);
    case Value::Kind::Number:
      return number_text(value.number);
    case Value::Kind::Text:
      return quoted(value.text);
    case Value::Kind::Date:
      return "a date";
    case Value::Kind::List:
      return "a list";
    case Value::Kind::Table:
      return "a table";
  }
  return "?";
}

/// One value on its way: where it comes from and where complaints go.
struct Reading {
  const Value& value;
  const KeyFacts& facts;
  const std::string& name;
  Findings& findings;

  bool complain(const std::string& message) const {
    findings.add(value.place, message);
    return false;
  }
  bool wrong_type(const std::string& wanted) const {
    return complain(name + " = " + shown(value) + " is not " + wanted + "; write it as " + name_only() + " = " +
                    example_text(facts));
  }
  std::string name_only() const { return facts.name; }
};

bool in_range(const Reading& r, const Value& value, const std::string& name) {
  if (!std::isfinite(value.number)) {
    r.findings.add(value.place, name + " = " + number_text(value.number) + " is not a finite number; give one within " +
                                    range_text(r.facts));
    return false;
  }
  if (value.number >= r.facts.min && value.number <= r.facts.max) return true;
  const bool low = value.number < r.facts.min;
  r.findings.add(value.place, name + " = " + shown(value) + " is outside " + range_text(r.facts) + "; use at " +
                                  (low ? "least " + number_text(r.facts.min) : "most " + number_text(r.facts.max)));
  return false;
}

bool is_number(const Value& value) { return value.kind == Value::Kind::Integer || value.kind == Value::Kind::Number; }

bool read_number(const Reading& r, double& out) {
  if (!is_number(r.value)) return r.wrong_type("a number");
  if (!in_range(r, r.value, r.name)) return false;
  out = r.value.number;
  return true;
}

bool read_integer(const Reading& r, std::int64_t& out) {
  if (r.value.kind != Value::Kind::Integer) return r.wrong_type("a whole number");
  if (!in_range(r, r.value, r.name)) return false;
  out = r.value.integer;
  return true;
}

bool read_vector(const Reading& r, const Value& list, const std::string& name, double min, double max,
                 Eigen::Vector3d& out) {
  if (list.kind != Value::Kind::List || list.items.size() != 3) {
    const std::string what =
        list.kind == Value::Kind::List ? "a list of " + std::to_string(list.items.size()) : shown(list);
    r.findings.add(list.place, name + " is " + what + "; give three numbers, [x, y, z]");
    return false;
  }
  KeyFacts limits = r.facts;
  limits.min = min;
  limits.max = max;
  const Reading each{list, limits, name, r.findings};
  bool good = true;
  for (std::size_t i = 0; i < 3; ++i) {
    const Value& item = list.items[i];
    const std::string item_name = name + "[" + std::to_string(i) + "]";
    if (!is_number(item)) {
      r.findings.add(item.place, item_name + " = " + shown(item) + " is not a number; give three numbers, [x, y, z]");
      good = false;
    } else {
      good = in_range(each, item, item_name) && good;
      out[static_cast<Eigen::Index>(i)] = item.number;
    }
  }
  return good;
}

bool read_transform(const Reading& r, Eigen::Isometry3d& out) {
  if (r.value.kind != Value::Kind::Table) return r.wrong_type("a transform");
  bool good = true;
  for (const auto& member : r.value.members)
    if (member.key != "xyz_mm" && member.key != "rpy_deg") {
      report_unknown(member, r.name, {"xyz_mm", "rpy_deg"}, r.findings);
      good = false;
    }
  Eigen::Vector3d xyz_mm = Eigen::Vector3d::Zero();
  Eigen::Vector3d rpy_deg = Eigen::Vector3d::Zero();
  const auto part = [&](const char* key, const char* meaning, double limit, Eigen::Vector3d& to) {
    if (const Member* member = r.value.find(key))
      return read_vector(r, member->value, r.name + "." + key, -limit, limit, to);
    r.findings.add(r.value.place, r.name + " has no " + key + "; add " + key + " = " + meaning);
    return false;
  };
  good = part("xyz_mm", "[x, y, z]", kTranslationMaxMm, xyz_mm) && good;
  good = part("rpy_deg", "[W, P, R], turns about x, then y, then z", 360, rpy_deg) && good;
  if (!good) return false;
  for (const double angle : rpy_deg)
    if (const double quarters = angle / (std::numbers::pi / 2);
        std::abs(quarters) > 0.5 && std::abs(quarters) < 2.5 && std::abs(quarters - std::round(quarters)) < 2e-4) {
      r.findings.add(r.value.find("rpy_deg")->value.place, r.name + ".rpy_deg: " + number_text(angle) +
                                                               " looks like radians; write " +
                                                               number_text(90 * std::round(quarters)));
      return false;
    }
  out = Eigen::Isometry3d::Identity();
  out.linear() = from_wpr_deg(rpy_deg);
  out.translation() = xyz_mm;
  return true;
}

bool is_address(const std::string& text) {
  in6_addr any{};
  return inet_pton(AF_INET, text.c_str(), &any) == 1 || inet_pton(AF_INET6, text.c_str(), &any) == 1;
}

/// Empty when `text` is host:port or [v6]:port, else what is wrong with it.
std::string endpoint_problem(const std::string& text) {
  const auto colon = text.rfind(':');
  if (colon == std::string::npos) return "has no port; write it as host:port";
  const std::string host = text.substr(0, colon);
  const std::string port = text.substr(colon + 1);
  const bool digits = !port.empty() && port.size() <= 5 && port.find_first_not_of("0123456789") == std::string::npos;
  if (!digits || std::stoi(port) > 65535) return "has the port " + quoted(port) + "; give a number of 1 … 65535";
  if (host.empty()) return "has no host; write it as host:port";
  if (host.front() == '[') {
    if (host.back() != ']' || !is_address(host.substr(1, host.size() - 2)))
      return "has no IPv6 address in its brackets; write it as [address]:port";
    return {};
  }
  if (host.find(':') != std::string::npos)
    return "has a host with colons; put an IPv6 address in brackets, [address]:port";
  if (host.find_first_not_of("0123456789.") == std::string::npos && !is_address(host))
    return "has no valid IPv4 address; it has four numbers of 0 … 255";
  if (host.size() > 253 ||
      host.find_first_not_of("abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789.-_") != std::string::npos)
    return "has no valid host name; use letters, digits, '-' and '.'";
  return {};
}

std::string can_problem(const std::string& text) {
  constexpr std::string_view kScheme = "cannelloni://";
  if (text.starts_with(kScheme)) {
    const std::string endpoint = text.substr(kScheme.size());
    const std::string problem = endpoint_problem(endpoint);
    const bool port_zero = problem.empty() && std::stoi(endpoint.substr(endpoint.rfind(':') + 1)) == 0;
    return port_zero ? "has the port 0; give the port of the bridge, 1 … 65535" : problem;
  }
  if (text.find("://") != std::string::npos) return "has an unknown scheme; use cannelloni://HOST:PORT";
  // IFNAMSIZ is 16 with the final zero.
  if (text.empty() || text.size() > 15 || text.find_first_of(" /:\t") != std::string::npos)
    return "is no network interface; use can0 or cannelloni://HOST:PORT";
  return {};
}

bool read_text(const Reading& r, std::string& out) {
  if (r.value.kind != Value::Kind::Text) return r.wrong_type(r.facts.type == Type::Path ? "a path" : "a text");
  const std::string& text = r.value.text;
  if (text.size() > kTextMax)
    return r.complain(r.name + " has " + std::to_string(text.size()) + " bytes; use at most " +
                      std::to_string(kTextMax));
  if (text.find('\0') != std::string::npos || (r.facts.type != Type::Text && printable(text) != text))
    return r.complain(r.name + " = " + quoted(text) + " has a control character in it; remove it");
  if (text.empty() && r.facts.required)
    return r.complain(r.name + " is empty; write it as " + r.name_only() + " = " + example_text(r.facts));
  std::string problem;
  // An endpoint whose default is empty may be left empty.
  if (r.facts.type == Type::Endpoint && !text.empty()) problem = endpoint_problem(text);
  if (r.facts.type == Type::Endpoint && text.empty() && std::string_view{r.facts.default_value} != "\"\"")
    problem = "has no host and port; write it as host:port";
  if (r.facts.type == Type::CanBus) problem = can_problem(text);
  if (!problem.empty()) return r.complain(r.name + " = " + quoted(text) + " " + problem);
  out = text;
  return true;
}

bool read_choice(const Reading& r, std::size_t& out) {
  if (r.value.kind != Value::Kind::Text) return r.wrong_type("a text");
  std::vector<std::string> words(r.facts.choices.begin(), r.facts.choices.end());
  const auto it = std::find(words.begin(), words.end(), r.value.text);
  if (it != words.end()) {
    out = static_cast<std::size_t>(it - words.begin());
    return true;
  }
  const std::string near = nearest(r.value.text, words);
  const std::string remedy = !near.empty()       ? "did you mean \"" + near + "\"?"
                             : words.size() == 1 ? "use \"" + words.front() + "\""
                                                 : "use one of them";
  return r.complain(r.name + " = " + quoted(r.value.text) + " is not " + (words.size() == 1 ? "" : "one of ") +
                    choices_text(r.facts) + "; " + remedy);
}

bool read_addresses(const Reading& r, std::vector<std::string>& out) {
  if (r.value.kind != Value::Kind::List) return r.wrong_type("a list of addresses");
  bool good = true;
  out.clear();
  for (const auto& item : r.value.items) {
    if (item.kind == Value::Kind::Text && is_address(item.text)) {
      out.push_back(item.text);
      continue;
    }
    r.findings.add(item.place, r.name + ": " + shown(item) + " is no IP address; write each as \"192.168.0.10\"");
    good = false;
  }
  return good;
}

template <class T>
T* slot_as(const Slot& slot) {
  T* const* target = std::get_if<T*>(&slot);
  return target == nullptr ? nullptr : *target;
}

void store(std::int64_t v, const Slot& slot) {
  std::visit(Overloaded{
                 [&](int* t) { *t = static_cast<int>(v); },
                 [&](std::uint8_t* t) { *t = static_cast<std::uint8_t>(v); },
                 [&](std::uint16_t* t) { *t = static_cast<std::uint16_t>(v); },
                 [&](std::size_t* t) { *t = static_cast<std::size_t>(v); },
                 [&](std::optional<int>* t) { *t = static_cast<int>(v); },
                 [&](std::chrono::milliseconds* t) { *t = std::chrono::milliseconds{v}; },
                 [&](std::chrono::seconds* t) { *t = std::chrono::seconds{v}; },
                 [](const auto&) { BINPICK_CHECK(!"a slot that takes no whole number"); },
             },
             slot);
}

void store(double v, const Slot& slot) {
  std::visit(Overloaded{
                 [&](double* t) { *t = v; },
                 [&](std::optional<double>* t) { *t = v; },
                 [&](Angle* t) { *t = Angle::deg(v); },
                 [&](InRadians t) { *t.rad = Angle::deg(v).in_rad(); },
                 [&](InRadiansIfGiven t) { *t.rad = Angle::deg(v).in_rad(); },
                 [&](Duration* t) { *t = from_s(v * 1e-3); },
                 [](const auto&) { BINPICK_CHECK(!"a slot that takes no number"); },
             },
             slot);
}
}  // namespace

bool read_value(const Value& value, const KeyFacts& facts, const std::string& name, const Slot& slot,
                Findings& findings) {
  const Reading r{value, facts, name, findings};
  switch (facts.type) {
    case Type::Flag: {
      if (value.kind != Value::Kind::Flag) return r.wrong_type("a flag");
      *slot_as<bool>(slot) = value.flag;
      return true;
    }
    case Type::Integer: {
      std::int64_t v = 0;
      if (!read_integer(r, v)) return false;
      store(v, slot);
      return true;
    }
    case Type::Number: {
      double v = 0;
      if (!read_number(r, v)) return false;
      store(v, slot);
      return true;
    }
    case Type::Choice: {
      std::size_t v = 0;
      if (!read_choice(r, v)) return false;
      std::get<Chosen>(slot).set(v);
      return true;
    }
    case Type::Text:
    case Type::Endpoint:
    case Type::CanBus:
    case Type::Path:
      return read_text(r, *slot_as<std::string>(slot));
    case Type::Addresses:
      return read_addresses(r, *slot_as<std::vector<std::string>>(slot));
    case Type::Vector:
      return read_vector(r, value, name, facts.min, facts.max, *slot_as<Eigen::Vector3d>(slot));
    case Type::Transform:
      return read_transform(r, *slot_as<Eigen::Isometry3d>(slot));
  }
  return false;
}

void set_default(const KeyFacts& facts, const Slot& slot) {
  if (facts.default_value == nullptr) return;
  // Each literal is parsed once; the table's texts are constants, so their addresses tell them apart.
  thread_local std::unordered_map<const char*, Value> parsed;
  auto known = parsed.find(facts.default_value);
  if (known == parsed.end()) {
    Document document = parse("key table", std::string{"default = "} + facts.default_value + "\n");
    BINPICK_CHECK(document.usable && document.root.members.size() == 1);
    known = parsed.emplace(facts.default_value, std::move(document.root.members.front().value)).first;
  }
  Findings findings{"key table", {}};
  const bool good = read_value(known->second, facts, facts.name, slot, findings);
  BINPICK_CHECK(good);
}

void report_unknown(const Member& member, const std::string& where, const std::vector<std::string>& names,
                    Findings& findings) {
  const std::string near = nearest(member.key, names);
  std::string remedy;
  if (!near.empty()) {
    remedy = "did you mean \"" + near + "\"?";
  } else if (names.size() <= 6) {
    for (const auto& name : names) remedy += (remedy.empty() ? "there are: " : ", ") + name;
  } else {
    remedy = "remove it, or look the name up in docs/configuration.md";
  }
  findings.add(member.key_place, "unknown key " + quoted(member.key) + " in " + where + "; " + remedy);
}

void report_missing(const KeyFacts& facts, const std::string& name, const std::string& where, const Place& header,
                    Findings& findings) {
  findings.add(header,
               name + " is missing in " + where + "; add, for example: " + facts.name + " = " + example_text(facts));
}

std::string text_of(const Slot& slot) {
  const auto number = [](double v) {
    char text[40];
    std::snprintf(text, sizeof text, "%.17g", v);
    return std::string{text};
  };
  const auto matrix = [&](const auto& m) {
    std::string text;
    for (Eigen::Index i = 0; i < m.size(); ++i) text += number(m.data()[i]) + " ";
    return text;
  };
  return std::visit(Overloaded{
                        [](bool* t) { return std::to_string(*t); },
                        [](int* t) { return std::to_string(*t); },
                        [](std::uint8_t* t) { return std::to_string(*t); },
                        [](std::uint16_t* t) { return std::to_string(*t); },
                        [](std::size_t* t) { return std::to_string(*t); },
                        [&](double* t) { return number(*t); },
                        [](std::optional<int>* t) { return *t ? std::to_string(**t) : "-"; },
                        [&](std::optional<double>* t) { return *t ? number(**t) : "-"; },
                        [](std::string* t) { return *t; },
                        [](std::vector<std::string>* t) {
                          std::string all;
                          for (const auto& text : *t) all += text + " ";
                          return all;
                        },
                        [&](Angle* t) { return number(t->in_rad()); },
                        [&](InRadians t) { return number(*t.rad); },
                        [&](InRadiansIfGiven t) { return *t.rad ? number(**t.rad) : "-"; },
                        [](std::chrono::milliseconds* t) { return std::to_string(t->count()); },
                        [](std::chrono::seconds* t) { return std::to_string(t->count()); },
                        [](Duration* t) { return std::to_string(t->count()); },
                        [&](Eigen::Vector3d* t) { return matrix(*t); },
                        [&](Eigen::Isometry3d* t) { return matrix(t->matrix()); },
                        [](const Chosen& t) { return std::to_string(t.get()); },
                    },
                    slot);
}
}  // namespace binpick::config
