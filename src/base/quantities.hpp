// SPDX-License-Identifier: LGPL-2.1-or-later
// Distinct types for different units, such as rows of the grid and rows of the frame, or scores and
// penalties. The vectors do not convert to each other.
#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

namespace terrainseg {

template <typename Value, typename Meaning> class Quantities : public std::vector<Value> {
 public:
  using std::vector<Value>::vector;
};

/// A curve: per column the first row of the ground. GridCurve: columns and rows of the grid (0..grid.height).
using GridCurve = Quantities<std::uint16_t, struct RowsOfTheGrid>;
/// MaskCurve: columns and rows of the mask (0..height of the mask).
using MaskCurve = Quantities<std::uint16_t, struct RowsOfTheMask>;
/// FrameCurve: columns of the mask and rows of the frame (0..height of the frame).
using FrameCurve = Quantities<std::uint16_t, struct RowsOfTheFrame>;

/// Score per cell, row by row: evidence for ground in Q4 of 1/32 nat (16 * 32 = 1 nat).
using CellScores = Quantities<std::int16_t, struct ScoreOfACell>;
/// Penalty per cell, row by row: evidence against ground, 32 = 1 nat, not negative.
using CellPenalties = Quantities<std::int8_t, struct PenaltyOfACell>;
/// Prior per row of the grid: evidence for ground, 32 = 1 nat.
using RowPriors = Quantities<std::int16_t, struct PriorOfARow>;

/// A horizontal line across the frame, such as the vanishing line of the ground plane, with conversions
/// between its units.
struct FrameLine {
  /// Where the line comes from, in order of increasing reliability.
  enum class Source : std::uint8_t { none, lines, hint, motion, pose, setting };
  Source source = Source::none;
  std::int32_t row_q8 = 0; ///< Q8 rows from the top of the frame; may lie outside the frame

  bool known() const { return source != Source::none; }
  /// Limits the line to the frame: unknown when it lies above the frame, the frame's end when it lies below.
  FrameLine within(int frame_height) const {
    return known() && row_q8 >= 0 ? FrameLine{source, std::min(row_q8, frame_height << 8)} : FrameLine{};
  }
  FrameLine lower_by(std::int32_t rows_q8) const { return {source, row_q8 + rows_q8}; }

  /// For the metadata: Q16 rows; -1 when unknown or outside the frame.
  std::int32_t row_q16(int frame_height) const {
    return known() && row_q8 >= 0 && row_q8 < frame_height << 8 ? row_q8 << 8 : -1;
  }
  /// Q8 of the frame's height; -1 when unknown.
  int part_of_height_q8(int frame_height) const { return known() ? row_q8 / frame_height : -1; }
  /// The row `rows_above` rows of the frame above the line, as a row of a pyramid level; 0 when unknown.
  int row_of_level(int level, int rows_above) const {
    return known() ? std::max(((row_q8 >> 8) - rows_above + (1 << level) - 1) >> level, 0) : 0;
  }
  /// Q8 pixels of a pyramid level.
  int row_q8_of_level(int level) const { return row_q8 >> level; }
};

} // namespace terrainseg
