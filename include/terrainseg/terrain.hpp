// SPDX-License-Identifier: LGPL-2.1-or-later
// Everything that was learned, as a value that can be kept in a file and given to another Segmenter.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "terrainseg/settings.hpp"

namespace terrainseg {

/// The colour space that models live in: models of different spaces are never mixed.
struct ColorSpace {
  bool rgb = false;
  Colorimetry colorimetry;
  bool operator==(const ColorSpace&) const = default;
};

/// One learned Gaussian with diagonal covariance (paper, section 3.4).
struct TerrainModel {
  std::array<std::uint16_t, 3> mean{};     ///< Q8, 8-bit units
  std::array<std::uint32_t, 3> variance{}; ///< Q8, squared 8-bit units
  std::uint64_t mass = 0;                  ///< samples in Q8; 0 = a null model
  bool operator==(const TerrainModel&) const = default;
};

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

} // namespace terrainseg
