#include "bench/scenes/memory.hpp"

#include <array>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <spawn.h>
#include <stdexcept>
#include <sys/wait.h>
#include <unistd.h>

#include "vision/knowledge_base_impl.hpp"

namespace binpick::bench {
namespace {
namespace fs = std::filesystem;
using Json = nlohmann::json;

constexpr double kMib = 1024.0 * 1024.0;

/// A line of /proc/self/status.
double status_mib(const std::string& key) {
  std::ifstream in{"/proc/self/status"};
  for (std::string line; std::getline(in, line);)
    if (line.starts_with(key + ":")) return std::stod(line.substr(key.size() + 1)) / 1024;
  throw std::runtime_error{"/proc/self/status has no " + key};
}

vision::KnowledgeBase opened(const std::string& file) {
  auto base = vision::KnowledgeBase::open(file);
  if (!base) throw std::runtime_error{base.error().text};
  return std::move(*base);
}

void run_self(const std::string& request_file) {
  std::string program = fs::read_symlink("/proc/self/exe"), command = "memory", argument = request_file;
  const std::array<char*, 4> arguments{program.data(), command.data(), argument.data(), nullptr};
  pid_t child = 0;
  int status = 0;
  if (posix_spawn(&child, program.c_str(), nullptr, nullptr, arguments.data(), environ) != 0 ||
      waitpid(child, &status, 0) != child || status != 0)
    throw std::runtime_error{program + " memory " + request_file + " failed"};
}
}  // namespace

std::map<std::string, double> memory_mib(const Scene& scene, const std::string& base_file,
                                         const vision::DetectorOptions& options, const std::string& folder) {
  const std::string request_file = folder + "/memory-" + std::to_string(getpid());
  const std::string points_file = request_file + ".points";
  {
    std::ofstream points{points_file, std::ios::binary};
    points.write(reinterpret_cast<const char*>(scene.points.data()),
                 static_cast<std::streamsize>(scene.points.size() * sizeof(Eigen::Vector3f)));
    const Json request{{"base", base_file},
                       {"points", points_file},
                       {"supply_mm", {scene.supply_mm.x(), scene.supply_mm.y(), scene.supply_mm.z()}},
                       {"votes", options.search == vision::Search::Votes},
                       {"threads", options.threads}};
    std::ofstream{request_file} << request << '\n';
  }
  run_self(request_file);
  Json answer;
  std::ifstream{request_file} >> answer;
  fs::remove(request_file);
  fs::remove(points_file);

  const vision::KnowledgeBase base = opened(base_file);
  const vision::KnowledgeBase::Impl& part = base.impl();
  std::size_t views = 0;
  for (const vision::View& view : part.views)
    views += sizeof(vision::View) + view.anchors_object_mm.size_bytes() + view.surface.size_bytes() +
             view.edges_mm.size_bytes();
  return {
      {"file", static_cast<double>(fs::file_size(base_file)) / kMib},
      {"views", static_cast<double>(views) / kMib},
      {"votes", static_cast<double>(part.votes.size_bytes() + part.offsets.size() * sizeof(part.offsets[0])) / kMib},
      {"working", answer.at("working")},
      {"peak", answer.at("peak")}};
}

void measure_memory(const std::string& request_file) {
  Json request;
  if (!(std::ifstream{request_file} >> request)) throw std::runtime_error{request_file + ": no request"};
  const auto s = request.at("supply_mm").get<std::array<double, 3>>();
  const vision::SupplyBox supply{{s[0], s[1], s[2]}};
  const vision::KnowledgeBase base = opened(request.at("base"));
  if (const auto whole = base.verify(); !whole) throw std::runtime_error{whole.error().text};
  const std::string points_file = request.at("points");
  std::vector<Eigen::Vector3f> points(fs::file_size(points_file) / sizeof(Eigen::Vector3f));
  std::ifstream{points_file, std::ios::binary}.read(
      reinterpret_cast<char*>(points.data()), static_cast<std::streamsize>(points.size() * sizeof(Eigen::Vector3f)));
  vision::DetectorOptions options;
  options.search = request.at("votes") ? vision::Search::Votes : vision::Search::Exhaustive;
  options.threads = request.at("threads");
  const double before = status_mib("VmRSS");
  vision::detect(depth_image_of(points, base, supply), supply, base, options);
  const double peak = status_mib("VmHWM");
  request["working"] = peak - before;
  request["peak"] = peak;
  std::ofstream{request_file} << request << '\n';
}
}  // namespace binpick::bench
