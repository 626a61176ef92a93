// SPDX-License-Identifier: LGPL-2.1-or-later
// Quantises cells into colour and texture bins (the perception sub-space of the default pipeline) and smooths
// histograms of these bins.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "coarse/grid.hpp"
#include "terrainseg/terrain.hpp"

namespace terrainseg {

// A slow gain that normalises the brightness of the scene, so that ground learned by day is recognised in a
// shadow.

struct ExposureTables {
  int black = 0;                                ///< luma that is subtracted first, in grey levels
  int gain = 256;                               ///< Q8 on luma
  std::array<std::uint8_t, 256> luma{};         ///< normalised luma for each luma
  std::array<std::uint16_t, 256> chroma_gain{}; ///< Q8 gain on (chroma - 128) for each luma; normalises
                                                ///< chroma to saturation
};

/// Light of a frame in the grid's lower half without ignored cells, Q8: the mean luma, and the luma that one
/// cell of 200 is darker than. A mean of 0 is not yet known.
struct Light {
  std::uint32_t mean = 0, black = 0;
  bool operator==(const Light&) const = default;
};
Light light_of(const Grid& grid);

/// Moves a `followed` value (0 = unknown) towards `now` by a sixteenth.
std::uint32_t follow_slowly(std::uint32_t followed, std::uint32_t now);

/// Computes tables that bring black to 0 and the mean to 110. A lens that scatters light, or a range that is
/// declared wrongly, takes contrast from dark pictures: black is at most a tenth of what the mean is below
/// 112. A mean of 0 gives no gain.
void fill_exposure(const Light& light, ExposureTables& tables);

/// Converts a model of normalised colours back to the light of the current frame.
TerrainModel in_this_light(const TerrainModel& learned, const ExposureTables& exposure);

/// A colour bin has 11 bits: luma (3 bits, uppermost) and the two normalised chromas (4 bits each).
inline constexpr int luma_bin_shift = 5;
inline constexpr int chroma_bin_shift = 4;
inline constexpr int luma_bins = 256 >> luma_bin_shift, chroma_bins = 256 >> chroma_bin_shift;
static_assert(luma_bins * chroma_bins * chroma_bins == color_bins);

/// Values per cell, row by row.
struct CellBins {
  std::vector<std::uint8_t> luma, u, v; ///< normalised colour
  std::vector<std::uint16_t> color;     ///< 0..color_bins - 1
  std::vector<std::uint8_t> texture;    ///< 0..texture_bins - 1
  std::vector<std::int16_t> roughness;  ///< log2 in Q8, normalised for brightness; the texture bins quantise
                                        ///< it
  std::vector<std::uint16_t> gain;      ///< working memory of bin_cells(), as the following
  std::vector<std::uint32_t> differences;
  std::vector<std::uint8_t> around, half_around;
  std::vector<std::uint32_t> sums;
};

/// The normalised colours of all cells, for clustering.
inline Grid colors_of(const CellBins& cells, const Grid& grid) {
  return {{Plane{cells.luma.data(), grid.width}, Plane{cells.u.data(), grid.width},
           Plane{cells.v.data(), grid.width}},
          grid.width,
          grid.height,
          grid.level,
          grid.ignored};
}

/// log2 in Q8 of values from 2^10 on and below 2^25.
void log2_q8(const std::uint32_t* values, int count, std::int16_t* out);

/// The mean luma around each cell, row by row: of the columns and rows within `reach`, twice. `between` and
/// `sums` are working memory.
void mean_around(const Grid& grid, int reach, std::vector<std::uint8_t>& between,
                 std::vector<std::uint32_t>& sums, std::vector<std::uint8_t>& out);

/// `texture` is the output of TextureReader. Unless `mean` is 0 (Q8, see Light), the luma of cells with
/// brighter surroundings is reduced, because ground in a bright part of the picture is in another light.
void bin_cells(const Grid& grid, const std::vector<std::uint16_t>& texture, const ExposureTables& exposure,
               std::uint32_t mean, CellBins& cells);

/// Bins `first` to `end` - 1 of one chroma.
struct BinRange {
  int first = 0, end = chroma_bins;
  int count() const { return end - first; }
};
inline BinRange with_neighbours(const BinRange& range) {
  return {std::max(range.first - 1, 0), std::min(range.end + 1, chroma_bins)};
}
/// The bins of U from the least to the greatest of these colours. Auto-vectorised.
BinRange range_of_u(const std::vector<std::uint16_t>& colors);

/// Smooths a histogram of color_bins bins by 1-2-1 along luma and both chromas, with repeated ends. Each sum
/// is divided by 4, rounded down. Reads the bins of `u` and their neighbours; what it writes for other bins
/// is undefined. `between` is working memory. The sum of all bins must be at most (2^32 - 1) / 3. The three
/// arrays must not overlap.
void blur_colors(std::span<const std::uint32_t> in, BinRange u, std::span<std::uint32_t> between,
                 std::span<std::uint32_t> out);

} // namespace terrainseg
