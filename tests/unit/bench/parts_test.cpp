#include "bench/scenes/parts.hpp"

#include <filesystem>
#include <fstream>
#include <gtest/gtest.h>
#include <map>
#include <set>

#include "bench/scenes/classes.hpp"
#include "bench/scenes/judge.hpp"
#include "bench/scenes/piles.hpp"

namespace binpick::bench {
namespace {
using vision::ScannerClass;

TEST(SceneParts, AreClosedFitTheirClassAndHaveTheSymmetryTheyClaim) {
  const std::map<ScannerClass, std::pair<double, double>> range_mm{
      {ScannerClass::Lps36Hi, {30, 90}}, {ScannerClass::Lps36, {60, 150}}, {ScannerClass::Lms400, {150, 400}}};
  std::set<std::string> names;
  for (const ClassSetting& setting : class_settings()) {
    EXPECT_GE(part_names(setting.scanner).size(), 3U) << setting.name;
    for (const std::string& name : part_names(setting.scanner)) {
      names.insert(name);
      const ScenePart part = scene_part(setting.scanner, name);
      const vision::Mesh& mesh = part.body.mesh;
      EXPECT_GE(mesh.diameter_mm(), range_mm.at(setting.scanner).first) << name;
      EXPECT_LE(mesh.diameter_mm(), range_mm.at(setting.scanner).second) << name;
      std::map<std::pair<std::uint32_t, std::uint32_t>, int> edges;
      for (const auto& t : mesh.triangles)
        for (std::size_t k = 0; k < 3; ++k) ++edges[{t[k], t[(k + 1) % 3]}];
      for (const auto& [edge, count] : edges)
        ASSERT_EQ(count, (edges[{edge.second, edge.first}])) << name << ": an edge with one side";
      const vision::Symmetry symmetry = judged_symmetry(mesh, vision::figures_of(setting.scanner).noise_mm);
      EXPECT_EQ(symmetry.kind, part.symmetry) << setting.name << ' ' << name << ": " << to_string(symmetry);
      if (part.symmetry == vision::Symmetry::Kind::Finite) {
        EXPECT_EQ(symmetry.rotations.size(), part.order) << name;
      }
    }
  }
  EXPECT_EQ(names.size(), 8U) << "four example parts and four of the bench's own";
}

TEST(SceneParts, ConvexPiecesReachAsFarAsTheMesh) {
  for (const ClassSetting& setting : class_settings())
    for (const std::string& name : part_names(setting.scanner)) {
      const ScenePart part = scene_part(setting.scanner, name);
      Eigen::AlignedBox3f mesh, pieces;
      for (const auto& v : part.body.mesh.vertices_mm) mesh.extend(v);
      for (const auto& piece : part.body.pieces)
        for (const auto& p : piece.points_mm) pieces.extend(p);
      const auto tolerance = static_cast<float>(0.01 * part.body.mesh.diameter_mm());
      EXPECT_LT((mesh.min() - pieces.min()).cwiseAbs().maxCoeff(), tolerance) << name;
      EXPECT_LT((mesh.max() - pieces.max()).cwiseAbs().maxCoeff(), tolerance) << name;
    }
}

TEST(SceneParts, ADeepSupplyIsItsOwnAndHoldsTheSamePart) {
  const ScenePart deep = scene_part(ScannerClass::Lms400, kDeepPart),
                  usual = scene_part(ScannerClass::Lms400, "track_link");
  EXPECT_EQ(deep.body.name, usual.body.name) << "they share a knowledge base";
  EXPECT_EQ(setting_of(deep).supply_mm, Eigen::Vector3d(800, 600, 500));
  EXPECT_EQ(setting_of(usual).supply_mm, setting_of(ScannerClass::Lms400).supply_mm);
  EXPECT_EQ(deep.pile, 80);
}

TEST(SceneParts, AShaftIsToldByItsKeywayOnly) {
  const ScenePart shaft = scene_part(ScannerClass::Lps36Hi, "keyed_shaft");
  EXPECT_TRUE(shaft.tells({3.5, 0, 0}));
  EXPECT_FALSE(shaft.tells({-7, 0, 0}));
  EXPECT_FALSE(shaft.tells({5.5, 0, 25}));
  const Judge judge{shaft};
  Eigen::Isometry3d turned = Eigen::Isometry3d::Identity();
  turned.linear() = Eigen::AngleAxisd{2, Eigen::Vector3d::UnitZ()}.toRotationMatrix();
  EXPECT_GT(judge.measure(true).distance_mm(turned, Eigen::Isometry3d::Identity()), judge.threshold_mm());
  EXPECT_LT(judge.measure(false).distance_mm(turned, Eigen::Isometry3d::Identity()), 1);
  // Where the keyway is not seen, the turned one is neither right nor wrong; where it is seen, it is wrong.
  for (const bool told : {false, true}) {
    SceneLine line;
    line.truths = {{Eigen::Isometry3d::Identity(), 0.9, told}};
    line.detections.emplace_back().T_supply_object = turned;
    const Match m = match(judge.judged(line), 0);
    EXPECT_EQ(m.to_find, told ? 1 : 0);
    EXPECT_EQ(m.verdict.front(), told ? Verdict::Wrong : Verdict::Neutral);
  }
}

TEST(Splits, ShareNeitherPilesNorFillLevelsAndNameEachSceneOnce) {
  const Split &tune = *find_split("tune"), &report = *find_split("report");
  EXPECT_EQ(tune.scenes(), 40U);
  EXPECT_EQ(report.scenes(), 100U);
  EXPECT_EQ(find_split("train"), nullptr);
  std::set<std::uint64_t> piles, noises;
  std::set<double> fills;
  for (const Split* split : {&tune, &report}) {
    std::set<std::pair<std::uint64_t, double>> scenes;
    for (std::size_t k = 0; k < split->scenes(); ++k) {
      const SceneId id = split->scene(k);
      EXPECT_TRUE(scenes.insert({id.pile, id.fill}).second) << split->name << ' ' << k;
      EXPECT_TRUE(noises.insert(id.noise).second);
      if (split == &tune) piles.insert(id.pile), fills.insert(id.fill);
      if (split == &report) {
        EXPECT_FALSE(piles.contains(id.pile));
        EXPECT_FALSE(fills.contains(id.fill));
      }
    }
  }
  const Split& figure7 = *find_split("figure7");
  EXPECT_EQ(figure7.scenes(), 3000U);
  EXPECT_EQ((std::set<double>{figure7.fills.begin(), figure7.fills.end()}.size()), figure7.fills.size());
  std::set<double> of_four;
  for (std::size_t k = 0; k < 4; ++k) of_four.insert(tune.scene(k).fill);
  EXPECT_EQ(of_four.size(), 4U) << "a few scenes are a fair sample";
}

TEST(Piles, AreKeptAndReadBackAndSettledAnewWhereCutShort) {
  namespace fs = std::filesystem;
  const fs::path folder = fs::path{testing::TempDir()} / "binpick_piles";
  fs::remove_all(folder);
  ScenePart part = scene_part(ScannerClass::Lps36Hi, "nozzle");
  part.pile = 3;
  const auto settled = settled_pile(part, 5, folder.string());
  ASSERT_EQ(settled.size(), 3U);
  const auto height = [&](const ObjectPose& pose) { return (pose * part.body.mesh.centroid_mm()).z(); };
  EXPECT_LE(height(settled[0]), height(settled[1]));
  EXPECT_LE(height(settled[1]), height(settled[2]));
  const auto again = settled_pile(part, 5, folder.string());
  ASSERT_EQ(again.size(), 3U);
  for (std::size_t k = 0; k < 3; ++k) EXPECT_NEAR((again[k].iso.matrix() - settled[k].iso.matrix()).norm(), 0, 1e-6);
  const fs::path file = fs::directory_iterator { folder } -> path();
  fs::resize_file(file, fs::file_size(file) / 2);
  EXPECT_EQ(settled_pile(part, 5, folder.string()).size(), 3U);
  EXPECT_EQ(taken_down(settled, 0.34).size(), 1U);
  EXPECT_EQ(taken_down(settled, 0.01).size(), 1U) << "never empty";
  fs::remove_all(folder);
}
}  // namespace
}  // namespace binpick::bench
