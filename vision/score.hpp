#pragma once

#include <array>
#include <cstddef>

#include "vision/evidence.hpp"
#include "vision/verification.hpp"

/// How sure the evidence makes us.
namespace binpick::vision {
/// All clues but Clue::Looseness, which refinement tells, and those after it, which other poses do: nothing claimed, no
/// rival, half of the supply known.
Evidence evidence_of(const DenseTest& test);

/// What is linear in the score: the clues, bent. Calibration fits the weights of these.
inline constexpr std::size_t kTerms = 20;
std::array<double, kTerms> terms_of(const Evidence& evidence);

/// A rival that explains as much is as likely: a half then; it goes to one as the rival's evidence falls short, by the
/// share that noise makes evidence differ.
double against_rival(double rival, double scale);

/// Probability that the pose is right, as far as it shows itself: logistic in terms_of().
double score_by_itself(const Evidence& evidence);
/// What is linear in the second step, since a supply that is mostly something else rarely holds the part: 1, and the
/// logits of score_by_itself() and of what is known of the supply.
inline constexpr std::size_t kSecondTerms = 3;
/// Of a supply that is the part's, more than this share is known, however deep others lie (some hundred of them: more
/// than a few hundred visible ones are not all looked at).
inline constexpr float kKnownEnough = 0.4F;
std::array<double, kSecondTerms> second_terms(double by_itself, double known);

/// Probability that the pose is right: logistic in second_terms(), times against_rival(). The weights come from
/// simulated scenes (bench_scenes calibrate, which writes score_weights.inc).
double score_of(const Evidence& evidence);
}  // namespace binpick::vision
