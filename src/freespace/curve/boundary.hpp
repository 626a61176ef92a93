// SPDX-License-Identifier: LGPL-2.1-or-later
// Finds the boundary between the ground and obstacles: one row per column of the grid.
#pragma once

#include <cstdint>
#include <vector>

#include "base/quantities.hpp"
#include "freespace/look/color_steps.hpp"

namespace terrainseg {

class BoundarySearch {
 public:
  /// Prepares the searches in one frame from its colour steps, the exposure's gain (Q8), and the last frame's
  /// curve `before` (rows of the grid; empty = none).
  void look(const Grid& grid, const ColorSteps& steps, int gain_q8, const GridCurve& before);

  /// Raises the price of a curve without an edge, until the next look(). `edgeless` is 1 per cell (row r,
  /// column j) where a curve at row r of column j would cross no edge.
  void price_edgeless(const Grid& grid, const std::vector<std::uint8_t>& edgeless);

  /// Finds the curve. `score` is Q4 (16 * 32 = 1 nat) per cell, positive for ground; `prior` (32 = 1 nat) per
  /// row. Row r of a column means that cells r and below are ground; 0 = all cells, grid.height = none.
  /// Maximises over all curves the sum of (score + prior) below minus above, plus the value of the edges at
  /// the curve, minus a price for every row of difference between neighbouring columns (lower at upright
  /// edges) and for leaving the last frame's rows. With `ground_behind` a column may have one more stretch of
  /// ground above the curve, separated by an obstacle's height, at a price. Exact, by dynamic programming
  /// over the columns.
  void find(const Grid& grid, const CellScores& score, const RowPriors& prior, bool ground_behind,
            GridCurve& boundary);

 private:
  void weigh_edges(const Grid& grid, const ColorSteps& steps, int gain_q8, const GridCurve& before);
  void weigh_columns(const Grid& grid, const CellScores& score, const RowPriors& prior);
  void add_ground_behind(const Grid& grid, const CellScores& score, const RowPriors& prior);
  void price_steps(const Grid& grid, const ColorSteps& steps);

  std::vector<std::int32_t> utility_; ///< columns x (rows + 1), Q4
  std::vector<std::int32_t> edges_;   ///< columns x (rows + 1), Q4: value of the edges of a frame
  std::vector<std::int32_t> best_;    ///< best value of all curves that end at a row
  std::vector<std::int32_t> sums_;    ///< per column of a row: sum of the scores below minus the sum above
  std::vector<std::int32_t> stretch_; ///< per column of a row, doubled: the stretch of ground that ends here
  std::vector<std::int32_t> behind_;  ///< per column of a row, doubled: the best stretch above
  std::vector<std::int16_t> price_;   ///< columns x rows: price for passing a row from the column to the left
  std::vector<std::uint16_t> came_from_;
};

} // namespace terrainseg
