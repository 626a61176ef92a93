// SPDX-License-Identifier: LGPL-2.1-or-later
// The loops of the stone field: compare rows of cells with the ground around them, from which cells that
// differ are excluded.
//
// No function reads or writes past its counts. Plain loops: vectors of newer processors would save less than
// 5 % of a frame (lab/speed/plain.py).
#pragma once

#include <cstdint>

namespace terrainseg::kernels {

/// Per column, over the cells that are ground (1, otherwise 0): adds their number, their sum, and the sum of
/// their squared distances from 128. Up to 16 rows fit.
struct ColumnMoments {
  std::uint16_t *cells, *sums;
  std::uint32_t* squares;
};
void add_moments(const std::uint8_t* luma, const std::uint8_t* ground, int count, const ColumnMoments& out);

/// The same over the ground whose value differs from `middle` by at most `reach`: number, sum, and sum of the
/// distances. Up to 16 rows fit.
struct ColumnDeviations {
  std::uint16_t *cells, *sums, *distances;
};
void add_near(const std::uint8_t* luma, const std::uint8_t* ground, const std::uint8_t* middle,
              const std::uint8_t* reach, int count, const ColumnDeviations& out);

/// out[i] = min(127, (|luma - middle| * scale) >> 8), 0 where there is no ground; scale is at most 1024.
void deviations_from(const std::uint8_t* luma, const std::uint8_t* ground, const std::uint8_t* middle,
                     const std::uint16_t* scale, int count, std::uint8_t* out);

} // namespace terrainseg::kernels
