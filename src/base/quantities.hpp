// SPDX-License-Identifier: LGPL-2.1-or-later
// Vectors with distinct types for different units, such as rows of the grid and rows of the frame, or scores
// and penalties. They do not convert to each other.
#pragma once

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

} // namespace terrainseg
