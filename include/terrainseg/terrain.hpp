// SPDX-License-Identifier: LGPL-2.1-or-later
// Everything that was learned, as a value that can be kept in a file and given to another Segmenter.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "terrainseg/settings.hpp"

namespace terrainseg {

/// The colour space that models live in: models of different spaces are never mixed.
struct ColorSpace {
  bool rgb = false;
  Colorimetry colorimetry;
  bool operator==(const ColorSpace&) const = default;
};

/// Colours as a Gaussian with diagonal covariance: moments of samples, a training model, a learned one
/// (paper, section 3.4).
struct Gaussian {
  std::array<std::uint16_t, 3> mean{};     ///< Q8, 8-bit units
  std::array<std::uint32_t, 3> variance{}; ///< Q8, squared 8-bit units
  std::uint64_t mass = 0;                  ///< samples in Q8; 0 = a null model
  bool operator==(const Gaussian&) const = default;
};
/// What is learned are such Gaussians.
using TerrainModel = Gaussian;

/// Ranges that learning keeps to, and that a terrain from elsewhere has to keep to.
inline constexpr std::uint16_t most_mean = 255 << 8;
inline constexpr std::uint32_t most_variance = 256u * 256 << 8;
/// 2^18 frames of the largest window: sums of all models and of a frame's training stay far below 2^64.
inline constexpr std::uint64_t most_mass = std::uint64_t{1} << 58;
inline constexpr std::uint32_t most_exposure_mean = 255 << 8;
inline constexpr std::uint32_t most_horizon = 255;
/// Of all bins of a histogram together: it is halved above 2^30, after the frame that took it there.
inline constexpr std::uint64_t most_histogram = (std::uint64_t{1} << 30) + (std::uint64_t{1} << 27);

inline constexpr int color_bins = 2048;
inline constexpr int texture_bins = 24;

/// Histograms are empty where the settings that learned them do not use them.
struct Terrain {
  ColorSpace space;
  std::vector<TerrainModel> models;            ///< at most max_models
  std::vector<std::uint32_t> negative_colors;  ///< color_bins or none: colours of the rest of the frame
  std::vector<std::uint32_t> terrain_texture;  ///< texture_bins or none
  std::vector<std::uint32_t> negative_texture; ///< texture_bins or none
  std::uint32_t exposure_mean = 0;             ///< Q8 mean luma that the exposure follows, 0 = none yet
  std::uint32_t horizon = 0;                   ///< slow horizon, Q8 of the height; 0 = none yet
  std::uint32_t generation = 0;
  bool operator==(const Terrain&) const = default;
};

/// Which field of a terrain from elsewhere (a file, a program) has a size or a value that learning and
/// scoring cannot work with, and its range; empty when it is sound.
TERRAINSEG_API std::string flaw_of(const Terrain& terrain);

} // namespace terrainseg
