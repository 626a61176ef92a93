// SPDX-License-Identifier: LGPL-2.1-or-later
// The learned terrain: a value that can be saved to a file and passed to another Segmenter.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "terrainseg/settings.hpp"

namespace terrainseg {

/// The colour space of the models. Models of different spaces are never mixed.
struct ColorSpace {
  bool rgb = false;        ///< true: R, G, B; false: Y, U, V
  Colorimetry colorimetry; ///< range, and for YUV the matrix
  bool operator==(const ColorSpace&) const = default;
};

/// A Gaussian colour distribution with diagonal covariance: moments of samples, a training model, or a
/// learned model (paper, section 3.4, equations (13) to (17)).
struct Gaussian {
  std::array<std::uint16_t, 3> mean{};     ///< Q8, 8-bit units
  std::array<std::uint32_t, 3> variance{}; ///< Q8, squared 8-bit units
  std::uint64_t mass = 0;                  ///< number of samples in Q8; 0 = a null model
  bool operator==(const Gaussian&) const = default;
};
/// A learned model.
using TerrainModel = Gaussian;

/// Ranges of the learned values. A terrain from a file or a program must be within them.
inline constexpr std::uint16_t most_mean = 255 << 8;
inline constexpr std::uint32_t most_variance = 256u * 256 << 8;
/// 2^18 frames of the largest window. Sums of all models and of one frame's training stay far below 2^64.
inline constexpr std::uint64_t most_mass = std::uint64_t{1} << 58;
inline constexpr std::uint32_t most_exposure_mean = 255 << 8;
inline constexpr std::uint32_t most_horizon = 255;
/// Limit for the sum of a histogram's bins. Above 2^30 the histogram is halved after the frame.
inline constexpr std::uint64_t most_histogram = (std::uint64_t{1} << 30) + (std::uint64_t{1} << 27);

inline constexpr int color_bins = 2048;
inline constexpr int texture_bins = 24;

/// The vanishing line of the ground that motion found last, for a mount that stays as it is: it is used only
/// in frames of the same size. Unknown when `height` is 0.
struct KeptLine {
  std::uint16_t width = 0, height = 0; ///< of the frames in which it was found
  std::uint32_t row_q8 = 0;            ///< Q8 rows, at most the height
  bool operator==(const KeptLine&) const = default;
};

/// Histograms are empty when the settings with which the terrain was learned do not use them.
struct Terrain {
  ColorSpace space;
  std::vector<TerrainModel> models;            ///< at most max_models
  std::vector<std::uint32_t> negative_colors;  ///< color_bins or empty: colours outside the training window
  std::vector<std::uint32_t> terrain_texture;  ///< texture_bins or empty
  std::vector<std::uint32_t> negative_texture; ///< texture_bins or empty
  std::uint32_t exposure_mean = 0; ///< running mean of the luma for the exposure, Q8; 0 = not yet known
  std::uint32_t horizon = 0;       ///< running mean of the horizon row, Q8 of the height; 0 = not yet known
  KeptLine line;
  std::uint32_t generation = 0; ///< incremented at each change of the learned models
  bool operator==(const Terrain&) const = default;
};

/// Checks a terrain from a file or a program. Returns the first invalid field and its valid range; empty when
/// the terrain is valid.
TERRAINSEG_API std::string flaw_of(const Terrain& terrain);

} // namespace terrainseg
