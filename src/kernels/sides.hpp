// SPDX-License-Identifier: LGPL-2.1-or-later
// Rows of cells against what lies to their left and right: the loops of the odd spots.
//
// No function reads or writes past its counts. All vector variants and the plain one give the same bits: most
// loops are plain, and compilers make vectors of them for each target.
#pragma once

#include <cstdint>

namespace terrainseg::kernels {

/// Blocks of two cells: sums[b] += cells[2 b] + cells[2 b + 1], as far as they are ground (1, else 0), and
/// squares[b] likewise of their squares, unless it is nullptr; modulo 2^32.
void add_blocks(const std::uint8_t* cells, const std::uint8_t* ground, int blocks, std::uint32_t* sums,
                std::uint32_t* squares);

/// out[i] = the sum of b - a up to and with i.
void run_differences(const std::uint32_t* a, const std::uint32_t* b, int count, std::uint32_t* out);

/// What is told of a box around each block of a row; 0 in all three: nothing is known of it.
struct BoxRow {
  const std::uint32_t* cells;         ///< how many the box has, both sides and the block
  const std::uint32_t* inverse;       ///< 2^24 / cells
  const std::uint32_t* inverse_left;  ///< 2^24 / the cells of its left side
  const std::uint32_t* inverse_right; ///< likewise
  int reach;                          ///< blocks of each side
};

/// Where a BoxRow is written.
struct BoxCounts {
  std::uint32_t *cells, *inverse, *inverse_left, *inverse_right;
};

/// What a BoxRow tells, from running counts as compare_boxes() has sums: nothing where a side has fewer than
/// `least` cells, at least 1.
void count_boxes(const std::uint32_t* counts, int reach, std::uint32_t least, int count,
                 const BoxCounts& out);

/// What comes of them: means in Q4, variances in Q8; 0 where nothing is known.
struct SideRow {
  std::int16_t *left, *right; ///< means
  std::uint32_t* variance;    ///< of the whole box, and `floor`
};

/// `sums` and `squares` are running: the left side of block b is entry b + reach less entry b, its right side
/// entry b + 2 reach + 1 less entry b + reach + 1. Both have count + 2 reach + 1 entries.
void compare_boxes(const std::uint32_t* sums, const std::uint32_t* squares, const BoxRow& boxes,
                   std::uint32_t floor, int count, const SideRow& out);

/// out[2 b] = out[2 b + 1] = in[b].
void double_each(const std::int16_t* in, int count, std::int16_t* out);

/// How far each cell lies beyond both sides, in deviations (Q4): 127 at most. `dark`, where asked for, is 1
/// where it lies below both, else 0. `inverse` is Q12, 0..2^13 - 1.
void deviations(const std::uint8_t* cells, const std::int16_t* left, const std::int16_t* right,
                const std::int16_t* inverse, int count, std::uint8_t* out, std::uint8_t* dark);

/// A row of deviations of three components, 0..127, and of cells that are ground and that are dark (1 or 0).
struct DeviationRow {
  const std::uint8_t *y, *u, *v, *ground, *dark;
};

/// nearest[i] = row where the ground of one of the cells i - 1 .. i + 1 is dark and y is more than `enough`.
/// `work`: count + 2 bytes.
void note_dark(const DeviationRow& in, int enough, std::int16_t row, int count, std::uint8_t* work,
               std::int16_t* nearest);

/// out[i] = min(most, half of the largest and of all three), 0 where there is no ground. Of luma a quarter
/// counts where the cell is not dark and nearest[i] > reached.
void oddness(const DeviationRow& in, const std::int16_t* nearest, std::int16_t reached, int most, int count,
             std::uint8_t* out);

/// sums[i] += sign * (values[i] - (ground[i] ? enough : 0)); sign is 1 or -1, ground 1 or 0.
void add_excess(const std::uint8_t* values, const std::uint8_t* ground, int enough, int sign, int count,
                std::int32_t* sums);

} // namespace terrainseg::kernels
