// SPDX-License-Identifier: LGPL-2.1-or-later
// Ground that is seen behind an obstacle: what one boundary per column cannot tell.
#pragma once

#include <cstdint>
#include <vector>

#include "base/quantities.hpp"
#include "coarse/grid.hpp"

namespace terrainseg {

/// Per grid column the rows first .. end - 1, above the boundary, that are ground again; first = end = 0:
/// none.
struct GroundBehind {
  GridCurve first, end;
  bool any = false;
};

class GroundBehindSearch {
 public:
  /// Looks above `boundary` (first ground row per column) for the rows whose `score` (Q4, 16 * 32 = 1 nat)
  /// sums up to most, less what their colour differs from the ground that lies to the left or right of the
  /// obstacle in the same row: ground of one row is equally far away and in much the same light. Rows in
  /// which neither side has ground cannot be.
  void find(const Grid& grid, const CellScores& score, const GridCurve& boundary, int gain_q8,
            GroundBehind& behind);

 private:
  void compare_sideways(const Grid& grid, const GridCurve& boundary, int first_row, int end_row, int gain_q8);

  std::vector<std::uint8_t> penalty_; ///< per cell, 32 = 1 nat; `unseen` where no ground is beside it
};

} // namespace terrainseg
