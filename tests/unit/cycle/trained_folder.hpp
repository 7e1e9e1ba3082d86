#pragma once

#include "tests/unit/config/cell_files.hpp"
#include "tests/unit/vision/shapes.hpp"
#include "vision/knowledge_base.hpp"

namespace binpick::daemon {
/// The example cell with a block for its part, and a coarse knowledge base of it.
class TrainedFolder : public config::CellFolder {
 public:
  TrainedFolder() {
    edit_part("seed = 1", "rotations = 40");
    give_mesh(vision::shapes::box(200, 120, 50));
    train();
  }
  void give_mesh(const vision::Mesh& mesh) const { wrote(vision::save_stl(mesh, path("track_link.stl")).has_value()); }
  void train() const {
    write("track_link.toml", part);
    const auto read = config::load_part(path("track_link.toml")).value();
    const auto mesh = vision::load_mesh(read.mesh_path, read.mesh_unit_mm).value();
    const auto base = vision::train(mesh, read.options, {}, nullptr, 1).value();
    wrote(base.save(path("track_link.kb")).has_value());
  }
  void save() const {
    write("cell.toml", cell);
    write("track_link.toml", part);
  }

 private:
  static void wrote(bool done) {
    if (!done) throw std::runtime_error("the temporary folder cannot be written");
  }
};
}  // namespace binpick::daemon
