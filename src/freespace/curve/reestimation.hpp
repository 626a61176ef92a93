// SPDX-License-Identifier: LGPL-2.1-or-later
// Appearance of one frame's ground and of the rest, separated by a first boundary: the iteration of C.
// Rother, V. Kolmogorov, A. Blake, "GrabCut", ACM Transactions on Graphics 23, 2004, with histograms and one
// step. The terrain is learned only from the training window of this and earlier frames. Light that is new in
// this frame, and ground that was never in the window, can be learned only from the frame itself.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "base/quantities.hpp"
#include "coarse/grid.hpp"
#include "freespace/look/color_bins.hpp"

namespace terrainseg {

class Reestimation {
 public:
  /// Computes `revised` = `score` (Q4, 16 * 32 = 1 nat) plus the evidence of each cell's colour and texture,
  /// from their frequencies below and above `boundary` (first ground row per column): at most three eighths
  /// of a nat each. Above the boundary's upper tenth there is no evidence for ground. A `penalty` (32 = 1
  /// nat) limits the evidence of colour for ground. Returns false without a result when either side has too
  /// few cells. Keeps no state between frames.
  bool revise(const Grid& grid, const CellBins& cells, const GridCurve& boundary,
              const CellPenalties& penalty, const CellScores& score, CellScores& revised);

 private:
  /// Histograms of one side. Of colours the bins beside u_ are cleared too; others are undefined.
  struct Side {
    std::array<std::uint32_t, color_bins> color, blurred;
    std::array<std::uint32_t, texture_bins> texture;
    std::uint32_t cells;
  };
  void count(const Grid& grid, const CellBins& cells, const GridCurve& boundary);
  void compare();

  Side ground_{}, rest_{};
  BinRange u_; ///< the bins of U that occur in the frame
  std::array<std::uint32_t, color_bins> between_{};
  std::array<std::int16_t, color_bins> color_{};     ///< Q4, positive for ground
  std::array<std::int16_t, texture_bins> texture_{}; ///< Q4, positive for ground
  std::vector<std::uint16_t> scratch_;
};

// Finds visible ground behind an obstacle, which one boundary per column cannot represent.

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
  /// similar light. Rows without ground on either side are excluded, and so is what neither ground nor other
  /// ground behind obstacles joins from the side: it cannot be reached.
  void find(const Grid& grid, const CellScores& score, const GridCurve& boundary, int gain_q8,
            GroundBehind& behind);

 private:
  void compare_sideways(const Grid& grid, const GridCurve& boundary, int first_row, int end_row, int gain_q8);
  void drop_closed(const GridCurve& boundary, GroundBehind& behind);

  std::vector<std::uint8_t> penalty_; ///< per cell, 32 = 1 nat; `unseen` where no ground is beside it
  std::vector<std::uint8_t> open_;    ///< per column 1 where its stretch can be reached
};

/// The ground of one frame, in rows of the grid: the boundary, the first row of ground that is not doubtful,
/// and the visible ground behind obstacles.
struct Ground {
  GridCurve boundary, safe;
  GroundBehind behind;
};

} // namespace terrainseg
