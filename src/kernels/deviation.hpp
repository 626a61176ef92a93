// SPDX-License-Identifier: LGPL-2.1-or-later
// Rows of cells against the ground around them, that which stands out of it left out: the loops of the stone
// field.
//
// No function reads or writes past its counts. All vector variants and the plain one give the same bits: the
// loops are plain, and compilers make vectors of them for each target.
#pragma once

#include <cstdint>

namespace terrainseg::kernels {

/// Per column, of the cells that are ground (1, else 0): how many, their sum, the sum of their squared
/// distances from 128. Up to 16 rows fit.
struct ColumnMoments {
  std::uint16_t *cells, *sums;
  std::uint32_t* squares;
};
void add_moments(const std::uint8_t* luma, const std::uint8_t* ground, int count, const ColumnMoments& out);

/// Per column, of the ground that lies no farther than `reach` from `middle`: how many cells, their sum, the
/// sum of their distances. Up to 16 rows fit.
struct ColumnDeviations {
  std::uint16_t *cells, *sums, *distances;
};
void add_near(const std::uint8_t* luma, const std::uint8_t* ground, const std::uint8_t* middle,
              const std::uint8_t* reach, int count, const ColumnDeviations& out);

/// out[i] = min(127, (|luma - middle| * scale) >> 8), 0 where there is no ground; scale is at most 1024.
void deviations_from(const std::uint8_t* luma, const std::uint8_t* ground, const std::uint8_t* middle,
                     const std::uint16_t* scale, int count, std::uint8_t* out);

} // namespace terrainseg::kernels
