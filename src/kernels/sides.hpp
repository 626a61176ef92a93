// SPDX-License-Identifier: LGPL-2.1-or-later
// The loops of the odd spots and of the stone field: compare rows of cells with the ground to their left and
// right, and around them.
//
// No function reads or writes past its counts. All vector variants and the plain one give the same bits. Most
// loops are auto-vectorised for each target.
#pragma once

#include <cstdint>

namespace terrainseg::kernels {

/// Blocks of two cells: sums[b] += cells[2 b] + cells[2 b + 1], of which only ground counts (1, otherwise 0).
/// squares[b] is the same for their squares, unless it is nullptr. Modulo 2^32.
extern void (*const add_blocks)(const std::uint8_t* cells, const std::uint8_t* ground, int blocks,
                                std::uint32_t* sums, std::uint32_t* squares);

/// out[i] = the sum of b - a from 0 to i.
extern void (*const run_differences)(const std::uint32_t* a, const std::uint32_t* b, int count,
                                     std::uint32_t* out);

/// Properties of the box around each block of a row; 0 in all = unknown.
struct BoxRow {
  std::uint32_t* cells;         ///< number of cells of both sides and the block
  std::uint32_t* inverse;       ///< 2^24 / cells
  std::uint32_t* inverse_left;  ///< 2^24 / cells of the left side
  std::uint32_t* inverse_right; ///< 2^24 / cells of the right side
  int reach;                    ///< number of blocks of each side
};

/// Computes all but the reach of a BoxRow from prefix sums of counts, in the form that compare_boxes() takes.
/// Boxes of which a side has fewer than `least` cells (1 or more) are unknown.
extern void (*const count_boxes)(const std::uint32_t* counts, std::uint32_t least, int count,
                                 const BoxRow& out);

/// Results of compare_boxes(): means in Q4, variances in Q8; 0 = unknown.
struct SideRow {
  std::int16_t *left, *right; ///< means
  std::uint32_t* variance;    ///< of the whole box, plus `floor`
};

/// `sums` and `squares` are prefix sums with count + 2 reach + 1 entries. The left side of block b is entry b
/// + reach minus entry b, the right side entry b + 2 reach + 1 minus entry b + reach + 1.
extern void (*const compare_boxes)(const std::uint32_t* sums, const std::uint32_t* squares,
                                   const BoxRow& boxes, std::uint32_t floor, int count, const SideRow& out);

/// out[2 b] = out[2 b + 1] = in[b].
extern void (*const double_each)(const std::int16_t* in, int count, std::int16_t* out);

/// The difference of each cell from both sides in the same direction, in deviations (Q4), at most 127.
/// `dark`, unless it is nullptr, is 1 where the cell is below both, otherwise 0. `inverse` is Q12, 0..2^13
/// - 1.
extern void (*const deviations)(const std::uint8_t* cells, const std::int16_t* left,
                                const std::int16_t* right, const std::int16_t* inverse, int count,
                                std::uint8_t* out, std::uint8_t* dark);

/// Deviations of a row's three components, 0..127, and which cells are ground and dark (1 or 0).
struct DeviationRow {
  const std::uint8_t *y, *u, *v, *ground, *dark;
};

/// nearest[i] = row where the ground of one of the cells i - 1 .. i + 1 is dark and y is more than `enough`.
/// `work`: count + 2 bytes.
extern void (*const note_dark)(const DeviationRow& in, int enough, std::int16_t row, int count,
                               std::uint8_t* work, std::int16_t* nearest);

/// out[i] = min(most, half of the largest deviation plus half of the sum of all three), 0 where there is no
/// ground. Luma counts a quarter where the cell is not dark and nearest[i] > reached.
extern void (*const oddness)(const DeviationRow& in, const std::int16_t* nearest, std::int16_t reached,
                             int most, int count, std::uint8_t* out);

/// sums[i] += sign * (values[i] - (ground[i] ? enough : 0)), modulo 2^16; sign is 1 or -1, ground 1 or 0,
/// values and enough 0..127.
extern void (*const add_excess)(const std::uint8_t* values, const std::uint8_t* ground, int enough, int sign,
                                int count, std::int16_t* sums);

/// Boxes of `columns` from i - reach to i + reach: there are `reach` more of them on both sides of the row.
/// Each is at most 127 (2 reach + 1) from 0, the sum over the rows of a box.
struct ColumnBoxes {
  const std::int16_t* columns;
  int reach;
  std::int16_t least; ///< smallest sum that is enough
};
/// Up to this reach the sum of a box fits 16 bits.
inline constexpr int reach_of_16_bits = 7;

/// marks[i] = 1 where values[i] is at least `least` and the sum of the box is enough, otherwise 0. Returns
/// whether there is any.
extern bool (*const mark_boxes)(const ColumnBoxes& boxes, const std::uint8_t* values, int least, int count,
                                std::uint8_t* marks);

// The stone field: rows of cells and the ground around them, from which cells that differ are excluded.

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
