#include "bench/scenes/must.hpp"

#include <algorithm>
#include <gtest/gtest.h>

namespace binpick::bench {
namespace {
/// A class that passes everything, and reaches no aim but the errors'.
ClassFigures good(const std::string& name) {
  PartFigures part;
  part.name = "a";
  part.ap = {0.96, {0.95, 0.96, 0.97}};
  part.first_right = {0.992, {}};
  part.t_mm = {0.05, {}};
  part.r_deg = {0.2, {}};
  part.right_half = 95;
  part.wrong_half = 1;
  part.to_find = 100;
  part.believed.assign(100, {0.97, true});
  part.normalised_errors = {0.7, 1, 1.5};
  part.time_ms = {40, 50, 100};
  part.first_ms = {20, 25, 30};
  return {name, {part, part}};
}
Evidence good_evidence() {
  Evidence evidence;
  for (const char* name : {"lps36hi", "lps36", "lms400"}) evidence.classes.push_back(good(name));
  return evidence;
}
Standing find(const Evidence& evidence, Figure figure, std::string_view where) {
  const auto all = standings(evidence);
  const auto it = std::ranges::find_if(
      all, [&](const Standing& s) { return s.demand.figure == figure && s.demand.where == where; });
  return it == all.end() ? Standing{} : *it;
}

TEST(Must, GoodFiguresPassAndWhatIsNotMeasuredDoesNot) {
  for (const Standing& s : standings(good_evidence())) {
    const bool beside = s.demand.figure >= Figure::PeerSpeed;
    EXPECT_EQ(s.here.has_value(), !beside);
    EXPECT_EQ(s.must, !beside) << static_cast<int>(s.demand.figure) << ' ' << s.demand.where;
  }
  EXPECT_FALSE(find(good_evidence(), Figure::ApMean, "lps36hi").aim);
  EXPECT_TRUE(find(good_evidence(), Figure::Error_mm, "lps36hi").aim);
}

TEST(Must, TheWorstPartCountsByItself) {
  Evidence evidence = good_evidence();
  evidence.classes[0].parts[1].ap = {0.87, {}};
  evidence.classes[0].parts[0].ap = {1, {}};
  EXPECT_FALSE(find(evidence, Figure::ApWorst, "lps36hi").must);
  EXPECT_FALSE(find(evidence, Figure::ApMean, "lps36hi").must) << ".935";
  EXPECT_TRUE(find(evidence, Figure::ApWorst, "lps36").must);
}

TEST(Must, ANormalisedErrorMayBeTooSmall) {
  Evidence evidence = good_evidence();
  for (ClassFigures& figures : evidence.classes)
    for (PartFigures& part : figures.parts) part.normalised_errors = {0.3};
  EXPECT_FALSE(find(evidence, Figure::NormalisedError, "all").must);
}

TEST(Must, TimesAreOfAllClassesTogether) {
  Evidence evidence = good_evidence();
  for (PartFigures& part : evidence.classes[2].parts) part.time_ms.assign(100, 61);
  EXPECT_FALSE(find(evidence, Figure::TimeP50, "all").must);
  EXPECT_TRUE(find(evidence, Figure::TimeP99, "all").must);
}

TEST(Must, AFigureOfNothingPassesNothing) {
  Evidence evidence = good_evidence();
  for (ClassFigures& figures : evidence.classes)
    for (PartFigures& part : figures.parts) part.first_ms.clear();
  EXPECT_FALSE(find(evidence, Figure::FirstP50, "all").must);
}

TEST(Must, PeerAndAlarms) {
  Evidence evidence = good_evidence();
  evidence.beside_peer = evidence.peer = evidence.classes;
  for (ClassFigures& figures : evidence.peer)
    for (PartFigures& part : figures.parts) {
      part.ap = {0.5, {}};
      part.time_ms = {2600};
    }
  EXPECT_TRUE(find(evidence, Figure::PeerError, "all").must) << ".04 over .5";
  EXPECT_NEAR(find(evidence, Figure::PeerSpeed, "all").here->value, 52, 1e-9);
  EXPECT_TRUE(find(evidence, Figure::PeerSpeed, "all").must);
  evidence.alarms["lps36"]["nozzle"][1].scenes = 100;
  EXPECT_TRUE(find(evidence, Figure::Alarms, "all").must);
  evidence.alarms["lps36"]["nozzle"][2].scenes_with = 1;
  EXPECT_FALSE(find(evidence, Figure::Alarms, "all").must);
}
}  // namespace
}  // namespace binpick::bench
