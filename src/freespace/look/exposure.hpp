// SPDX-License-Identifier: LGPL-2.1-or-later
// A slow gain that normalises the brightness of the scene, so that ground learned by day is recognised in a
// shadow.
#pragma once

#include <array>
#include <cstdint>

#include "coarse/grid.hpp"
#include "terrainseg/terrain.hpp"

namespace terrainseg {

struct ExposureTables {
  int gain = 256;                               ///< Q8 on luma
  std::array<std::uint8_t, 256> luma{};         ///< normalised luma for each luma
  std::array<std::uint16_t, 256> chroma_gain{}; ///< Q8 gain on (chroma - 128) for each luma; normalises
                                                ///< chroma to saturation
};

/// Mean luma of the grid's lower half without ignored cells, Q8.
std::uint32_t mean_luma(const Grid& grid);

/// Moves `mean` (Q8; 0 = unknown) towards `now` by a sixteenth.
std::uint32_t follow_exposure(std::uint32_t mean, std::uint32_t now);

/// Computes tables that bring the mean to 110. A mean of 0 gives no gain.
void fill_exposure(std::uint32_t mean, ExposureTables& tables);

/// Converts a model of normalised colours back to the light of the current frame.
TerrainModel in_this_light(const TerrainModel& learned, const ExposureTables& exposure);

} // namespace terrainseg
