// SPDX-License-Identifier: LGPL-2.1-or-later
// Finds visible ground behind an obstacle, which one boundary per column cannot represent.
#pragma once

#include <cstdint>
#include <vector>

#include "base/quantities.hpp"
#include "coarse/grid.hpp"

namespace terrainseg {

/// Per grid column the rows first .. end - 1 above the boundary that are ground again. first = end = 0: none.
struct GroundBehind {
  GridCurve first, end;
  bool any = false;
};

class GroundBehindSearch {
 public:
  /// Searches each column above `boundary` (first ground row per column) for the rows with the largest sum of
  /// `score` (Q4, 16 * 32 = 1 nat) minus a penalty. The penalty is the colour difference from the ground to
  /// the left or right of the obstacle in the same row, because ground in one row has the same distance and
  /// similar light. Rows without ground on either side are excluded.
  void find(const Grid& grid, const CellScores& score, const GridCurve& boundary, int gain_q8,
            GroundBehind& behind);

 private:
  void compare_sideways(const Grid& grid, const GridCurve& boundary, int first_row, int end_row, int gain_q8);

  std::vector<std::uint8_t> penalty_; ///< per cell, 32 = 1 nat; `unseen` where no ground is beside it
};

} // namespace terrainseg
