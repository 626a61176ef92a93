// SPDX-License-Identifier: LGPL-2.1-or-later
// Loops over the cells of the grid: few enough for the cache, but their time matters beside one pass over a
// frame.
//
// No function reads or writes past its counts, whatever the alignment. All vector variants and the plain one
// give the same bits. Loops without a vector variant are auto-vectorised for each target.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace terrainseg::kernels {

/// A row of cells or pixels: three components of equal length.
using ComponentRow = std::array<const std::uint8_t*, 3>;

/// out[i] = (weights * cell i + offset) >> 16, clamped to 0..255. `out` must not overlap `in`.
extern void (*const weigh_components)(const ComponentRow& in, const std::array<std::int32_t, 3>& weights,
                                      std::int32_t offset, int count, std::uint8_t* out);

/// sums[i] += |luma[2i + 1] - luma[2i]|.
extern void (*const add_differences)(const std::uint8_t* luma, int count, std::uint16_t* sums);

/// Sums over `rows` (1 to 4) rows: of the pixels, and of the `count` - 1 differences |pixel x + 1 - pixel x|.
extern void (*const sum_rows)(const std::array<const std::uint8_t*, 4>& row, int rows, int count,
                              std::uint16_t* sums, std::uint16_t* steps);

/// out[i] = largest |columns[x + 1] - columns[x]| of the `per_cell` (1, 2 or 4) columns from i * per_cell on.
extern void (*const largest_steps)(const std::uint16_t* columns, int per_cell, int count, std::uint16_t* out);

/// Parameters of the evidence from coherence: clamp((neutral - coherence) * weight >> 8, against, in_favour)
/// * contrast / 32, at most `most`.
struct UprightRule {
  int neutral, weight, against, in_favour, most;
};

/// score[i] = score[i] * score_weight / 32, rounded down, plus the evidence; ignored cells are not changed.
extern void (*const weigh_upright)(const std::int16_t* coherence, const std::uint16_t* contrast,
                                   const std::uint8_t* ignored, const UprightRule& rule, int score_weight,
                                   int count, std::int16_t* score);

/// out[i] += sum of the `per_cell` (1, 2 or 4) columns from i * per_cell on, shifted left by `shift`; modulo
/// 2^16.
extern void (*const add_boxes)(const std::uint16_t* columns, int per_cell, int shift, int count,
                               std::uint16_t* out);

/// out[i] = min(limit, ((|dY| + 2 |dU| + 2 |dV|) * gain) >> 8) between cells i of two rows; gain is Q8, below
/// 2^20.
extern void (*const color_steps)(const ComponentRow& a, const ComponentRow& b, int gain, int limit, int count,
                                 std::uint16_t* out);

/// Parameters of the local reference.
struct FollowRule {
  int gain;         ///< gain of the exposure, Q8, below 2^16
  int free_below;   ///< distance without a penalty
  int most;         ///< largest penalty, up to 127
  int follow_below; ///< distance up to which the reference follows
};

/// Writes per cell the penalty for its weighted distance from the column's reference (Q4). Where the distance
/// is small and the cell is not ignored, moves the reference a quarter of the way to the cell.
extern void (*const follow_row)(const ComponentRow& cells, const std::uint8_t* ignored,
                                const FollowRule& rule, const std::array<std::int32_t*, 3>& reference,
                                int count, std::int8_t* penalty);

/// 1-2-1 over a row with repeated ends: (a + 2b + c) >> 2. `out` must not overlap `in`.
extern void (*const smooth_row)(const std::int32_t* in, int count, std::int32_t* out);

/// Number of columns of a strip that are searched for an edge together, and the largest number of its rows.
inline constexpr int strip_columns = 16, strip_rows = 8;

/// A strip of pixels around a curve: strip[row][component][column].
using Strip = std::array<std::array<std::array<std::uint8_t, strip_columns>, 3>, strip_rows>;

/// Per column the first row 1..rows-1 in which the colour differs most from the row above it: |dY| + 2 |dU| +
/// 2 |dV| of the differences mapped by `matrix` (Q8 after the map), rows 1..last[column]. 0 where
/// last[column] is 0.
extern void (*const strongest_edges)(const Strip& strip,
                                     const std::array<std::array<std::int32_t, 3>, 3>& matrix, int rows,
                                     const std::uint8_t* last, std::uint8_t* best);

/// out[i] = table[256 e + m] for (256 + m) 2^(e + 2) <= values[i] < (257 + m) 2^(e + 2); 0 for 0. Other
/// values are 2^10 .. 2^25 - 1. The table has octaves_of_table * 256 + 1 entries.
extern void (*const look_up_octaves)(const std::uint32_t* values, const std::int16_t* table, int count,
                                     std::int16_t* out);
inline constexpr int octaves_of_table = 15;

/// What is compared of a row of cells: luma, chromas and roughness, whose differences and sums fit 16 bits;
/// and 1 for ignored cells.
struct LookRow {
  std::array<const std::int16_t*, 4> values;
  const std::uint8_t* ignored;
};
/// Largest differences between two similar cells.
struct LookLimits {
  std::int16_t luma;       ///< relative, at most 32: 1/luma of the sum of both lumas plus `dark`
  std::int16_t chroma;     ///< sum of the differences of both chromas
  std::int16_t rough;      ///< difference of the roughness
  std::uint8_t if_ignored; ///< result where one of the cells is ignored
};
/// alike[i] = 1 where cells i of both rows are similar, otherwise 0. Lumas are 0 to 1020.
extern void (*const compare_looks)(const LookRow& a, const LookRow& b, const LookLimits& limits, int dark,
                                   int count, std::uint8_t* alike);

/// to[i] = min(to[i], from[i] + the price of the move): what steps[i] exceeds `free` by, 0 where one of the
/// two cells is ignored. Steps and `free` are below 2^15.
extern void (*const pass_distances)(const std::int32_t* from, const std::uint16_t* steps,
                                    const std::uint8_t* ignored_from, const std::uint8_t* ignored_to,
                                    int free, int count, std::int32_t* to);

/// Means over the rows up to `reach` away, as (sum * (65536 / rows, rounded) + 32768) >> 16, at most 255.
/// `sums` is working memory for `width` elements.
extern void (*const average_rows)(const std::uint8_t* in, std::ptrdiff_t stride, int width, int height,
                                  int reach, std::uint32_t* sums, std::uint8_t* out);
/// The same over the columns, in place. `sums` is working memory for 2 * (width + reach) + 1 elements.
extern void (*const average_columns)(std::uint8_t* cells, int width, int height, int reach,
                                     std::uint32_t* sums);

/// Raises penalty[i], which is not negative, to distances[i] - `free`, at most `most`; then reduces the
/// distance by 2^-shift of it.
extern void (*const raise_penalties)(std::int32_t* distances, int free, int most, int shift, int count,
                                     std::int8_t* penalty);

/// values[i] = min over k of values[k] + |places[i] - places[k]|. `places` start with 0 and do not decrease;
/// |values| and places are below 2^28.
extern void (*const spread_least)(std::int32_t* values, const std::int32_t* places, int count);

} // namespace terrainseg::kernels
