#pragma once

#include <memory>
#include <string>
#include <vector>

#include "base/expected.hpp"
#include "config/config.hpp"
#include "vision/knowledge_base.hpp"

namespace binpick::daemon {
/// Everything the cell works from and never changes: the cell file and the knowledge bases of its recipes. A reload
/// makes a new one and exchanges it between two cycles.
struct CellData {
  config::Config config;
  std::vector<vision::KnowledgeBase> knowledge_bases;  ///< One per recipe, same order.
  double knowledge_mib = 0;                            ///< Of their files, all mapped.
};

/// Opens the knowledge base of each recipe, verifies it, and holds it against the part file and its mesh: a pose found
/// with that of another part, or of yesterday's mesh, would be a wrong one. With MeshFile::OfNoMatter a mesh that
/// cannot be read is a line in the log only.
Expected<std::vector<vision::KnowledgeBase>, std::vector<config::Diagnostic>> open_knowledge_bases(
    const config::Config& config, config::MeshFile mesh);

/// Reads the cell file, its part files and knowledge bases. A daemon that has been trained needs no mesh: it goes on
/// where that file is gone. The error is every finding as a text to print.
Expected<std::shared_ptr<const CellData>, std::vector<std::string>> load_cell(const std::string& path);
}  // namespace binpick::daemon
