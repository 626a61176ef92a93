// SPDX-License-Identifier: LGPL-2.1-or-later
// Cells as table indices: the perception sub-space of the default pipeline.
#pragma once

#include <cstdint>
#include <vector>

#include "coarse.hpp"
#include "exposure.hpp"
#include "terrainseg/terrain.hpp"

namespace terrainseg {

/// Bins of luma (3 bits) and of the two normalised chromas (4 bits each): 11 bits, luma on top.
inline constexpr int luma_bin_shift = 5;
inline constexpr int chroma_bin_shift = 4;
static_assert((256 >> luma_bin_shift) * (256 >> chroma_bin_shift) * (256 >> chroma_bin_shift) == color_bins);

struct CellIndices {
  std::vector<std::uint8_t> luma, u, v; ///< normalised colour
  std::vector<std::uint16_t> color;     ///< 0..color_bins - 1
  std::vector<std::uint8_t> texture;    ///< 0..texture_bins - 1
};

/// `texture` as TextureReader gives it.
void index_cells(const CoarseGrid& grid, const std::vector<std::uint16_t>& texture,
                 const ExposureTables& exposure, CellIndices& indices);

} // namespace terrainseg
