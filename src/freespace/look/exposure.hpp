// SPDX-License-Identifier: LGPL-2.1-or-later
// A slow gain that takes the light out of the colours: what was learned by day must not be lost in a shadow.
#pragma once

#include <array>
#include <cstdint>

#include "coarse/grid.hpp"
#include "terrainseg/terrain.hpp"

namespace terrainseg {

struct ExposureTables {
  int gain = 256;                               ///< Q8 on luma
  std::array<std::uint8_t, 256> luma{};         ///< normalised luma of each luma
  std::array<std::uint16_t, 256> chroma_gain{}; ///< Q8 on (chroma - 128), by luma: saturation, not chroma
};

/// Mean luma of the grid's lower half without ignored cells, Q8.
std::uint32_t mean_luma(const Grid& grid);

/// `mean` Q8 (0 = none yet) follows `now` by a sixteenth.
std::uint32_t follow_exposure(std::uint32_t mean, std::uint32_t now);

/// Tables that bring the mean to 110. Mean 0 = no gain.
void fill_exposure(std::uint32_t mean, ExposureTables& tables);

/// A model of normalised colours in the light that these tables take out.
TerrainModel in_this_light(const TerrainModel& learned, const ExposureTables& exposure);

} // namespace terrainseg
