#include "plc/export.hpp"

#include <CLI/CLI.hpp>
#include <array>
#include <charconv>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include "config/config.hpp"
#include "tools/commands.hpp"

/// binpick export plc --for s7|logix: the PLC's side of the handshake as sources for the maker's engineering tool.
namespace binpick::tools {
namespace {
struct Wish {
  std::string make, role, out = ".", cell, host;
};

std::optional<std::array<std::uint8_t, 4>> parse_ipv4(std::string_view text) {
  std::array<std::uint8_t, 4> out{};
  const char* at = text.data();
  const char* const end = at + text.size();
  for (std::size_t i = 0; i < out.size(); ++i) {
    const auto [next, failure] = std::from_chars(at, end, out[i]);
    if (failure != std::errc{}) return std::nullopt;
    at = next;
    if (i + 1 < out.size() && (at == end || *at++ != '.')) return std::nullopt;
  }
  return at == end ? std::optional{out} : std::nullopt;
}

/// What the cell file says that the PLC has to know. Empty: done; else the trouble.
std::string take_cell(const Wish& wish, plc::ExportOptions& options) {
  const auto cell = config::load(wish.cell);
  if (!cell) return wish.cell + " is not a good cell file; see all findings with: binpick check " + wish.cell;
  const bool s7 = cell->plc.word_order == plc::WordOrder::HighWordFirst;
  if (s7 != (wish.make == "s7"))
    return wish.cell + ": plc.word_order is \"" + (s7 ? "s7" : "logix") + "\", which a PLC programmed for " +
           wish.make + " would read wrongly; write word_order = \"" + wish.make + "\" there, or export --for " +
           (s7 ? "s7" : "logix");
  const bool polls = cell->plc.role == plc::LineRole::Client;
  if (!wish.role.empty() && (wish.role == "client") != polls)
    return wish.cell + ": plc.role is \"" + (polls ? "client" : "server") + "\"; write role = \"" + wish.role +
           "\" there, or leave --role " + wish.role + " out";
  options.role = cell->plc.role;
  const std::string_view line = cell->plc_line();
  const std::size_t colon = line.rfind(':');
  std::from_chars(line.data() + colon + 1, line.data() + line.size(), options.port);
  // What plc.address names is the PLC itself.
  const auto host = polls ? std::nullopt : parse_ipv4(line.substr(0, colon));
  if (host && *host != std::array<std::uint8_t, 4>{}) options.host = *host;
  options.base_address = cell->plc.base_address;
  options.pose_convention = cell->plc.pose_convention;
  options.answer_timeout = cell->plc.scan_timeout + cell->plc.detect_timeout + std::chrono::seconds(5);
  return {};
}

int refuse(const std::string& trouble, int status) {
  std::fprintf(stderr, "binpick export: %s\n", trouble.c_str());
  return status;
}

int export_plc(const Wish& wish) {
  plc::ExportOptions options;
  if (wish.role == "client") options.role = plc::LineRole::Client;
  if (!wish.cell.empty())
    if (const std::string trouble = take_cell(wish, options); !trouble.empty()) return refuse(trouble, 2);
  if (!wish.host.empty() && wish.make == "logix")
    return refuse(
        "--host is for s7, whose program connects by itself; leave it out, a Logix PLC has the cell "
        "controller's address in its Modbus client (docs/plc/studio-5000.md)",
        2);
  if (!wish.host.empty()) {
    const auto host = parse_ipv4(wish.host);
    if (!host)
      return refuse("--host " + wish.host + ": is no IPv4 address; give the cell controller's, like 192.168.0.20", 2);
    options.host = *host;
  }
  namespace fs = std::filesystem;
  std::error_code failure;
  fs::create_directories(wish.out, failure);
  if (failure && !fs::is_directory(wish.out))
    return refuse(wish.out + ": cannot be made: " + failure.message() + "; name a folder that you may write to", 1);
  for (const auto& file : wish.make == "s7" ? plc::export_s7(options) : plc::export_logix(options)) {
    const std::string path = (fs::path{wish.out} / file.name).string();
    std::ofstream out{path, std::ios::binary};
    out << file.content;
    if (!out.flush()) return refuse(path + ": cannot be written; check the disk and who may write to the folder", 1);
    std::printf("%s\n", path.c_str());
  }
  return 0;
}
}  // namespace

void add_export(CLI::App& app, int& exit_status) {
  auto* command = app.add_subcommand("export", "Writes what other machines' tools read.");
  command->require_subcommand(1);
  auto* plc = command->add_subcommand("plc", "Register map and handshake as sources for the PLC's engineering tool.");
  auto wish = std::make_shared<Wish>();
  plc->add_option("--for", wish->make, "s7: TIA Portal, S7-1200/1500; logix: Studio 5000")
      ->required()
      ->check(CLI::IsMember({"s7", "logix"}));
  plc->add_option("--role", wish->role,
                  "what binpickd is on the Modbus line: server, the PLC connects to it (MB_CLIENT); client, it asks a "
                  "server in the PLC (MB_SERVER). Default: plc.role of the cell file, else server")
      ->check(CLI::IsMember({"client", "server"}));
  plc->add_option("--out", wish->out, "folder, made when it is not there (default: this one)");
  plc->add_option("--cell", wish->cell,
                  "cell file: port, base address, pose convention and time-outs are taken from it");
  plc->add_option("--host", wish->host,
                  "s7: the cell controller's address as the PLC sees it (default: the cell file's, else 192.168.0.20)");
  plc->callback([wish, &exit_status] { exit_status = export_plc(*wish); });
}
}  // namespace binpick::tools
