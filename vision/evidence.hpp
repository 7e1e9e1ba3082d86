#pragma once

#include <array>
#include <cstddef>
#include <string_view>

/// What speaks for and against a pose, in numbers that a person can read.
namespace binpick::vision {
enum class Clue : std::size_t {
  Visible,       ///< Share of the silhouette, less the holes, that is the top surface there.
  Contradicted,  ///< Share of what is visible that one sees through, away from the model's edges.
  Border,        ///< The same beside the model's edges.
  Missing,       ///< Share of the silhouette, less the holes, that was not measured.
  Holes,         ///< Share of the silhouette between the points of one surface: how sparse the scan is there.
  Unseen,        ///< Share of the silhouette, less the holes, that was not measured although nothing hides it.
  Ends,          ///< Length of the measured surface's ends within the part's, over four times the root of its pixels.
  Edges,         ///< Share of the model's depth edges found where they can be told.
  EdgeLength,    ///< How many can be told, over four times the root of the silhouette's pixels.
  Normals,       ///< Share of explained pixels with the model's normal.
  Curvature,     ///< Correlation of the curvatures.
  Fit,           ///< How well explained pixels fit: 2/3 by chance, 1 at best.
  Size,          ///< Decimal logarithm of the explained pixels.
  Looseness,     ///< Decimal logarithm of the pose's standard deviation, as displacement in part diameters.
  Claimed,       ///< Share of the explained pixels that better poses explain.
  Rival,         ///< Evidence of the best other pose of the same place over its own.
  Extent,        ///< Share of the supply's visible content that it explains, and no better pose.
  Known,         ///< Share of the supply's visible content that poses explain, each as far as it is believed.
};
inline constexpr std::array<std::string_view, 18> kClueNames{"visible", "contradicted", "contradicted at edges",
                                                             "missing", "holes",        "unseen",
                                                             "ends",    "edges",        "edge length",
                                                             "normals", "curvature",    "fit",
                                                             "size",    "looseness",    "claimed",
                                                             "rival",   "extent",       "known"};

struct Evidence {
  std::array<float, kClueNames.size()> clues{};
  float& operator[](Clue clue) { return clues[static_cast<std::size_t>(clue)]; }
  float operator[](Clue clue) const { return clues[static_cast<std::size_t>(clue)]; }
};
}  // namespace binpick::vision
