#pragma once

#include <array>
#include <cstddef>

#include "vision/evidence.hpp"
#include "vision/verification.hpp"

/// How sure the evidence makes us.
namespace binpick::vision {
/// All clues but the last three, which other poses and the refinement tell.
Evidence evidence_of(const DenseTest& test);

/// What is linear in the score: the clues, bent. Calibration fits the weights of these.
inline constexpr std::size_t kTerms = 17;
std::array<double, kTerms> terms_of(const Evidence& evidence);

/// A rival that explains as much is as likely: a half then; it goes to one as the rival's evidence falls short, by the
/// share that noise makes evidence differ.
double against_rival(double rival, double scale);

/// Probability that the pose is right: logistic in terms_of(), times against_rival(). The weights come from simulated
/// scenes (bench_scenes calibrate, which writes score_weights.inc).
double score_of(const Evidence& evidence);
}  // namespace binpick::vision
