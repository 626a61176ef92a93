// SPDX-License-Identifier: LGPL-2.1-or-later
// Colour bins: cells as table indices, the perception sub-space of the default pipeline, and histograms over
// it.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "coarse/grid.hpp"
#include "freespace/look/exposure.hpp"
#include "terrainseg/terrain.hpp"

namespace terrainseg {

/// Bins of luma (3 bits) and of the two normalised chromas (4 bits each): 11 bits, luma on top.
inline constexpr int luma_bin_shift = 5;
inline constexpr int chroma_bin_shift = 4;
inline constexpr int luma_bins = 256 >> luma_bin_shift, chroma_bins = 256 >> chroma_bin_shift;
static_assert(luma_bins * chroma_bins * chroma_bins == color_bins);

/// A row-by-row grid of cells.
struct CellBins {
  std::vector<std::uint8_t> luma, u, v; ///< normalised colour
  std::vector<std::uint16_t> color;     ///< 0..color_bins - 1
  std::vector<std::uint8_t> texture;    ///< 0..texture_bins - 1
  std::vector<std::int16_t> roughness;  ///< log2 in Q8, freed of the light: what the texture's bins part
  std::vector<std::uint32_t> gain, differences; ///< memory of bin_cells()
};

/// The normalised colours of all cells, to be clustered.
inline Grid colors_of(const CellBins& cells, const Grid& grid) {
  return {{Plane{cells.luma.data(), grid.width}, Plane{cells.u.data(), grid.width},
           Plane{cells.v.data(), grid.width}},
          grid.width,
          grid.height,
          grid.level,
          grid.ignored};
}

/// `texture` as TextureReader gives it.
void bin_cells(const Grid& grid, const std::vector<std::uint16_t>& texture, const ExposureTables& exposure,
               CellBins& cells);

/// Smooths a histogram of color_bins bins by 1-2-1 along luma and both chromas, the ends repeated; each sum
/// is divided by 4, rounded down. `between` holds one of the steps. All bins together may hold (2^32 - 1) / 3
/// at most; the three may not overlap.
void blur_colors(std::span<const std::uint32_t> in, std::span<std::uint32_t> between,
                 std::span<std::uint32_t> out);

} // namespace terrainseg
