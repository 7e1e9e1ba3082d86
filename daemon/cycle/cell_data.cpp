#include "daemon/cycle/cell_data.hpp"

#include <filesystem>
#include <map>

#include "base/log.hpp"
#include "vision/mesh.hpp"

namespace binpick::daemon {
namespace {
namespace fs = std::filesystem;

Expected<vision::KnowledgeBase, vision::KnowledgeBaseError> verified(const vision::KnowledgeBase& opened) {
  return opened.verify().map([&] { return opened; });
}

std::string file_name(const std::string& path) { return fs::path{path}.filename().string(); }

std::vector<std::string> texts(const std::vector<config::Diagnostic>& findings) {
  std::vector<std::string> lines;
  for (const auto& finding : findings) lines.push_back(to_string(finding));
  return lines;
}

/// Knowledge bases held against their part files; a mesh is read once, however many recipes share it.
class Comparison {
 public:
  /// What `trained` does not fit, and what to do; empty: it fits. The error is a mesh that cannot be read.
  Expected<std::string, vision::MeshError> trouble(const vision::KnowledgeBase& trained, const config::Recipe& recipe) {
    const std::string part = "part " + std::to_string(recipe.id), knowledge = file_name(recipe.knowledge_base);
    const std::string again = "; train it again: binpick train " + recipe.part.path + " -o " + recipe.knowledge_base;
    const auto hash = mesh_hash(recipe.part);
    const std::string &name = recipe.part.options.name, own = name + ".kb";
    if (hash && *hash != trained.mesh_hash() && trained.part_name() != name)
      return part + ": " + knowledge + " is of " + trained.part_name() + ", not of " + name +
             "; name its own: binpick train " + recipe.part.path + " -o " +
             (fs::path{recipe.knowledge_base}.parent_path() / own).string();
    if (hash && *hash != trained.mesh_hash())
      return part + ": " + knowledge + " was trained from another mesh than " + file_name(recipe.part.mesh_path) +
             again;
    if (const std::string option = vision::other_option(trained, recipe.part.options); !option.empty())
      return part + ": " + knowledge + " was trained with another value of " + option + " than that of " +
             file_name(recipe.part.path) + again;
    if (!hash) return unexpected(hash.error());
    return std::string{};
  }

 private:
  Expected<std::uint64_t, vision::MeshError> mesh_hash(const config::Part& part) {
    const auto [known, is_new] = hashes_.try_emplace({part.mesh_path, part.mesh_unit_mm}, 0);
    if (is_new)
      known->second = vision::load_mesh(part.mesh_path, part.mesh_unit_mm).map([](const vision::Mesh& mesh) {
        return vision::mesh_hash(mesh);
      });
    return known->second;
  }

  std::map<std::pair<std::string, double>, Expected<std::uint64_t, vision::MeshError>> hashes_;
};
}  // namespace

Expected<std::vector<vision::KnowledgeBase>, std::vector<config::Diagnostic>> open_knowledge_bases(
    const config::Config& config, config::MeshFile mesh) {
  std::vector<vision::KnowledgeBase> opened;
  std::vector<config::Diagnostic> findings;
  Comparison comparison;
  for (std::size_t i = 0; i < config.recipes.size(); ++i) {
    const config::Recipe& recipe = config.recipes[i];
    const std::string entry = "part[" + std::to_string(i) + "].", part = "part " + std::to_string(recipe.id) + ": ";
    const auto knowledge = vision::KnowledgeBase::open(recipe.knowledge_base).and_then(verified);
    if (!knowledge) {
      findings.push_back(
          config.finding(entry + "knowledge_base", part + knowledge.error().text + " (make it with: binpick train " +
                                                       recipe.part.path + " -o " + recipe.knowledge_base + ")"));
      continue;
    }
    opened.push_back(*knowledge);
    if (const auto trouble = comparison.trouble(*knowledge, recipe); !trouble) {
      if (mesh == config::MeshFile::Needed)
        findings.push_back(config.finding(entry + "file", part + trouble.error().text));
      else
        BINPICK_LOG(Warning, "vision", "%swhether %s was trained from its mesh cannot be told: %s", part.c_str(),
                    file_name(recipe.knowledge_base).c_str(), trouble.error().text.c_str());
    } else if (!trouble->empty()) {
      findings.push_back(config.finding(entry + "knowledge_base", *trouble));
    }
  }
  if (!findings.empty()) return unexpected(std::move(findings));
  return opened;
}

Expected<std::shared_ptr<const CellData>, std::vector<std::string>> load_cell(const std::string& path) {
  auto config = config::load(path, config::MeshFile::OfNoMatter);
  if (!config) return unexpected(texts(config.error()));
  auto knowledge_bases = open_knowledge_bases(*config, config::MeshFile::OfNoMatter);
  if (!knowledge_bases) return unexpected(texts(knowledge_bases.error()));
  auto cell = std::make_shared<CellData>();
  cell->config = std::move(*config);
  cell->knowledge_bases = std::move(*knowledge_bases);
  for (const auto& recipe : cell->config.recipes) {
    std::error_code unknown;
    if (const auto bytes = fs::file_size(recipe.knowledge_base, unknown); !unknown)
      cell->knowledge_mib += static_cast<double>(bytes) / (1 << 20);
  }
  BINPICK_LOG(Notice, "vision", "%zu knowledge base(s) mapped, %.0f MiB; pages in use are read once and shared",
              cell->knowledge_bases.size(), cell->knowledge_mib);
  return std::shared_ptr<const CellData>{std::move(cell)};
}
}  // namespace binpick::daemon
