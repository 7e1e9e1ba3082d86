#include "daemon/cycle/cell_data.hpp"

#include <filesystem>

#include "base/log.hpp"

namespace binpick::daemon {
namespace {
Expected<vision::KnowledgeBase, vision::KnowledgeBaseError> verified(const vision::KnowledgeBase& opened) {
  return opened.verify().map([&] { return opened; });
}
}  // namespace

Expected<std::shared_ptr<const CellData>, std::vector<std::string>> load_cell(const std::string& path) {
  auto config = config::load(path);
  std::vector<std::string> findings;
  if (!config) {
    for (const auto& diagnostic : config.error()) findings.push_back(to_string(diagnostic));
    return unexpected(std::move(findings));
  }
  auto cell = std::make_shared<CellData>();
  cell->config = std::move(*config);
  for (const auto& recipe : cell->config.recipes) {
    const auto knowledge = vision::KnowledgeBase::open(recipe.knowledge_base).and_then(verified);
    if (!knowledge) {
      findings.push_back(path + ": part " + std::to_string(recipe.id) + ": " + knowledge.error().text +
                         " (make it with: binpick train " + recipe.part.path + " -o " + recipe.knowledge_base + ")");
      continue;
    }
    cell->knowledge_bases.push_back(*knowledge);
    std::error_code unknown;
    if (const auto bytes = std::filesystem::file_size(recipe.knowledge_base, unknown); !unknown)
      cell->knowledge_mib += static_cast<double>(bytes) / (1 << 20);
  }
  if (!findings.empty()) return unexpected(std::move(findings));
  BINPICK_LOG(Notice, "vision", "%zu knowledge base(s) mapped, %.0f MiB; pages in use are read once and shared",
              cell->knowledge_bases.size(), cell->knowledge_mib);
  return std::shared_ptr<const CellData>{std::move(cell)};
}
}  // namespace binpick::daemon
