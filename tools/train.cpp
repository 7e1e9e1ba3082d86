#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <cctype>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <string>
#include <string_view>
#include <unistd.h>

#include "config/config.hpp"
#include "tools/commands.hpp"
#include "tools/output.hpp"
#include "vision/knowledge_base.hpp"
#include "vision/mesh.hpp"

namespace binpick::tools {
namespace {
constexpr std::array<std::string_view, 3> kMeshEndings{".stl", ".obj", ".ply"};

struct TrainOrder {
  std::string part;
  std::string output;
  int threads = 0;
};

/// A bar of 40 places on stderr, drawn anew only when it changed.
class ProgressBar {
 public:
  void show(double fraction) {
    const int percent = static_cast<int>(100 * std::clamp(fraction, 0.0, 1.0));
    if (!on_terminal_ || percent == shown_) return;
    shown_ = percent;
    const std::string filled(static_cast<std::size_t>(percent * 2 / 5), '#');
    std::fprintf(stderr, "\rtraining [%-40s] %3d %%", filled.c_str(), percent);
    std::fflush(stderr);
  }
  void clear() const {
    if (on_terminal_ && shown_ >= 0) std::fprintf(stderr, "\r%60s\r", "");
  }

 private:
  bool on_terminal_ = ::isatty(STDERR_FILENO) == 1;
  int shown_ = -1;
};

int failed(int status, const std::string& text) {
  std::fprintf(stderr, "binpick train: %s\n", text.c_str());
  return status;
}

/// Several findings of a part file in one line: the first of them, and how many more there are.
std::string first_of(const std::vector<config::Diagnostic>& findings) {
  const config::Diagnostic& first = findings.front();
  std::string text = first.file;
  if (first.line > 0) text += ":" + std::to_string(first.line) + ":" + std::to_string(first.column);
  text += ": " + first.message;
  if (findings.size() > 1) text += " (and " + std::to_string(findings.size() - 1) + " more findings)";
  return text;
}

/// A part file names its mesh; a mesh in its place would only give riddles about TOML.
bool is_mesh(std::string path) {
  std::transform(path.begin(), path.end(), path.begin(), [](unsigned char c) { return std::tolower(c); });
  return std::any_of(kMeshEndings.begin(), kMeshEndings.end(),
                     [&](std::string_view ending) { return path.ends_with(ending); });
}

int run(const TrainOrder& order) {
  if (is_mesh(order.part))
    return failed(2, order.part + ": is a mesh, not a part file; write a PART.toml with mesh = \"" +
                         std::filesystem::path{order.part}.filename().string() + "\" beside it");
  const auto part = config::load_part(order.part);
  if (!part) return failed(2, part.error().empty() ? order.part + ": cannot be read" : first_of(part.error()));
  const auto mesh = vision::load_mesh(part->mesh_path, part->mesh_unit_mm);
  if (!mesh) return failed(2, mesh.error().text);
  if (const auto trouble = cannot_be_written(order.output); !trouble.empty()) return failed(1, trouble);
  ProgressBar bar;
  vision::TrainingSummary summary;
  const auto base = vision::train(
      *mesh, part->options, [&](vision::TrainingProgress p) { bar.show(p.fraction); }, &summary, order.threads);
  bar.clear();
  if (!base) return failed(2, base.error().text);
  if (const auto saved = base->save(order.output); !saved) return failed(1, saved.error().text);
  std::printf("%s: %s\n  mesh       %zu triangles, %zu rendered\n", base->part_name().c_str(), order.output.c_str(),
              summary.triangles, summary.triangles_rendered);
  if (summary.resting_poses > 0) std::printf("  resting    %zu poses\n", summary.resting_poses);
  std::printf("  symmetry   %s\n  rotations  %d\n  votes      %llu\n  size       %.1f MiB\n  time       %.1f s\n",
              to_string(summary.symmetry).c_str(), summary.rotations, static_cast<unsigned long long>(summary.votes),
              summary.mib, summary.seconds);
  return 0;
}
}  // namespace

void add_train(CLI::App& app, int& exit_status) {
  auto* command = app.add_subcommand("train", "Builds a part's knowledge base from its mesh.");
  auto order = std::make_shared<TrainOrder>();
  command->add_option("PART.toml", order->part, "the part file; it names the mesh")->required();
  command->add_option("-o,--output", order->output, "the knowledge base to write (PART.kb)")->required();
  command->add_option("--threads", order->threads, "threads; 0: one for each core")->check(CLI::Range(0, 64));
  command->callback([order, &exit_status] { exit_status = run(*order); });
}
}  // namespace binpick::tools
