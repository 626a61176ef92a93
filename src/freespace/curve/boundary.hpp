// SPDX-License-Identifier: LGPL-2.1-or-later
// Finds the ground of a frame: the boundary between the ground and obstacles, one row per column of the grid,
// and the ground behind obstacles.
#pragma once

#include <cstdint>
#include <vector>

#include "base/quantities.hpp"
#include "freespace/curve/reestimation.hpp"
#include "freespace/look/connected_ground.hpp"
#include "freespace/score/cell_scorer.hpp"

namespace terrainseg {

// Prior for the ground per row, from the running mean of the horizon (the slow horizon).

/// Per row of the grid the evidence for ground, 32 = 1 nat, minus `caution`. `slow_horizon` is Q8 of the
/// height; 0 = unknown, then the middle of the picture is used. With `enabled` false the result is only the
/// caution.
void row_prior(int grid_height, std::uint32_t slow_horizon, bool enabled, int caution, RowPriors& prior);

/// The horizon for the prior: the slow horizon, but not far below `vanishing_row` (Q8 of the height; negative
/// = unknown). After a loss of ground, the boundary and the slow horizon are too low, and the prior would
/// keep the ground from being found again. The vanishing line does not depend on the ground that was found.
std::uint32_t horizon_of_prior(std::uint32_t slow_horizon, int vanishing_row);

/// Lowers the prior of the rows before `first` so far that ground hardly ever ends there.
void deny_rows_before(int first, RowPriors& prior);

/// Moves the slow horizon towards the upper end of `boundary` (rows of the grid per column) by a quarter, or
/// sets it when it is unknown. Q8 of the height, 1..255.
std::uint32_t follow_horizon(std::uint32_t slow_horizon, const GridCurve& boundary, int grid_height,
                             std::vector<std::uint16_t>& scratch);

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
  void weigh_columns(const Grid& grid, const CellScores& score, const RowPriors& prior, bool ground_behind);
  void price_steps(const Grid& grid, const ColorSteps& steps);
  int predecessor(int column, int row, int rows) const;

  std::vector<std::int32_t> utility_; ///< columns x (rows + 1), Q4
  std::vector<std::int32_t> edges_;   ///< columns x (rows + 1), Q4: value of the edges of a frame
  std::vector<std::int32_t> loss_;    ///< columns x (rows + 1): least loss of all curves that end there
  std::vector<std::int32_t> base_;    ///< per column: what was subtracted from its losses
  std::vector<std::int32_t> sums_;    ///< per column of a row: sum of the scores below minus the sum above
  std::vector<std::int32_t> stretch_; ///< per column of a row, doubled: the stretch of ground that ends here
  std::vector<std::int32_t> behind_; ///< per column of a row, doubled: the best stretch above, less its price
  std::vector<std::int32_t> place_;  ///< columns x (rows + 1): sum of the prices for passing the rows above,
                                     ///< from the column to the left
};

struct View;

class GroundTracer {
 public:
  /// Weighs the edges of a frame for trace(). `steps` are its colour steps; `before` is the boundary of the
  /// last frame, empty when there is none.
  void look(const View& view, const ColorSteps& steps, const GridCurve& before);

  /// Searches the boundary, repeats the search with this frame's appearance on both sides of it, then finds
  /// ground behind obstacles and doubtful ground. No ground is above `first_row` or far above `end`, the end
  /// of the ground plane. The frame is that of look(). Writes the boundary to `last`, updates `slow_horizon`
  /// (Q8 of the height).
  const Ground& trace(const View& view, const Scores& scores, int first_row, const FrameLine& end,
                      GridCurve& last, std::uint32_t& slow_horizon);

 private:
  void search(const View& view, const Scores& scores, const FrameLine& end, std::uint32_t& slow_horizon);

  BoundarySearch search_;
  RowPriors prior_;
  Reestimation reestimation_;
  CellScores revised_;
  GroundBehindSearch behind_search_;
  std::vector<std::uint16_t> scratch_;
  Ground ground_;
};

} // namespace terrainseg
