// SPDX-License-Identifier: LGPL-2.1-or-later
// Arrays that say what their numbers mean: a curve in rows of the grid is not one in rows of the frame, a
// score is not a penalty. Each is a vector that converts to none of the others.
#pragma once

#include <cstdint>
#include <vector>

namespace terrainseg {

template <typename Value, typename Meaning> class Quantities : public std::vector<Value> {
 public:
  using std::vector<Value>::vector;
};

/// A curve, one row a column: ground begins there. Columns and rows of the grid (0..grid.height) ...
using GridCurve = Quantities<std::uint16_t, struct RowsOfTheGrid>;
/// ... columns and rows of the mask (0..its height) ...
using MaskCurve = Quantities<std::uint16_t, struct RowsOfTheMask>;
/// ... columns of the mask and rows of the frame (0..its height).
using FrameCurve = Quantities<std::uint16_t, struct RowsOfTheFrame>;

/// What speaks for the ground in each cell, in Q4 of the unit below: 16 * 32 = 1 nat. Row by row.
using CellScores = Quantities<std::int16_t, struct ScoreOfACell>;
/// What speaks against it, 32 = 1 nat, 0 or more. Row by row.
using CellPenalties = Quantities<std::int8_t, struct PenaltyOfACell>;
/// What speaks for the ground in each row of the grid, 32 = 1 nat.
using RowPriors = Quantities<std::int16_t, struct PriorOfARow>;

} // namespace terrainseg
