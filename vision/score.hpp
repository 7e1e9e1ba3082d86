#pragma once

#include <algorithm>
#include <array>
#include <cstddef>

#include "vision/evidence.hpp"
#include "vision/verification.hpp"

/// How sure the evidence makes us.
namespace binpick::vision {
/// All clues but the last four, which other poses and the refinement tell; Clue::Company is a half.
Evidence evidence_of(const DenseTest& test);

/// What is linear in the score: the clues, bent. Calibration fits the weights of these.
inline constexpr std::size_t kTerms = 20;
std::array<double, kTerms> terms_of(const Evidence& evidence);

/// A rival that explains as much is as likely: a half then; it goes to one as the rival's evidence falls short, by the
/// share that noise makes evidence differ.
double against_rival(double rival, double scale);

/// Probability that the pose is right, as far as it shows itself: logistic in terms_of().
double score_by_itself(const Evidence& evidence);
/// Clue::Company, from the others' score_by_itself(): a supply in which nothing else looks like the part rarely holds
/// one.
class Company {
 public:
  void add(double by_itself) {
    second_ = std::max(second_, std::min(best_, by_itself));
    best_ = std::max(best_, by_itself);
    ++count_;
  }
  /// Of one that was added.
  double of(double by_itself) const { return count_ < 2 ? 0.5 : by_itself < best_ ? best_ : second_; }
  /// Of one that was not.
  double of_another() const { return count_ == 0 ? 0.5 : best_; }

 private:
  double best_ = 0, second_ = 0;
  std::size_t count_ = 0;
};
/// What is linear in the second step: 1, the logit of score_by_itself() and that of the company.
std::array<double, 3> second_terms(double by_itself, double company);

/// Probability that the pose is right: logistic in second_terms(), times against_rival(). The weights come from
/// simulated scenes (bench_scenes calibrate, which writes score_weights.inc).
double score_of(const Evidence& evidence);
}  // namespace binpick::vision
