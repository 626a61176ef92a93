// SPDX-License-Identifier: LGPL-2.1-or-later
// The curve between the ground and what stands on it: one row per column of the grid.
#pragma once

#include <cstdint>
#include <vector>

#include "base/quantities.hpp"
#include "freespace/look/color_steps.hpp"

namespace terrainseg {

class BoundarySearch {
 public:
  /// Takes in a frame's picture for the searches that follow: its colour steps, the exposure's gain, and the
  /// rows `before` of the last frame's curve (empty = none).
  void look(const Grid& grid, const ColorSteps& steps, int gain_q8, const GridCurve& before);

  /// Makes a curve dearer that crosses no edge, until the next look(): `edgeless` is 1 per cell (row r,
  /// column j) where a curve at row r of column j would cross none.
  void price_edgeless(const Grid& grid, const std::vector<std::uint8_t>& edgeless);

  /// `score` is Q4 (16 * 32 = 1 nat) per cell, positive for ground; `prior` (32 = 1 nat) per row. Row r of a
  /// column means: cells r and below are ground; 0 = all of it, grid.height = none. Maximises, over all
  /// curves, the sum of (score + prior) below minus above plus the colour edge at the curve, less a price for
  /// every row that neighbours differ by (cheap where the picture has an upright edge there) and for leaving
  /// the last frame's rows. With `ground_behind` a column may hold one
  /// more stretch of ground above the curve, an obstacle's height away from it, for a price. Exact, by
  /// dynamic programming over the columns.
  void find(const Grid& grid, const CellScores& score, const RowPriors& prior, bool ground_behind,
            GridCurve& boundary);

 private:
  void weigh_edges(const Grid& grid, const ColorSteps& steps, int gain_q8, const GridCurve& before);
  void weigh_columns(const Grid& grid, const CellScores& score, const RowPriors& prior);
  void add_ground_behind(const Grid& grid, const CellScores& score, const RowPriors& prior);
  void price_steps(const Grid& grid, const ColorSteps& steps);

  std::vector<std::int32_t> utility_; ///< columns x (rows + 1), Q4
  std::vector<std::int32_t> edges_;   ///< likewise, of a frame's picture
  std::vector<std::int32_t> best_;    ///< of all curves that end here
  std::vector<std::int32_t> sums_;    ///< of a row's columns: what is below minus what is above
  std::vector<std::int32_t> stretch_; ///< of a row's columns: the stretch of ground that ends here ...
  std::vector<std::int32_t> behind_;  ///< ... and the best one above, both doubled
  std::vector<std::int16_t> price_;   ///< columns x rows: of passing a row on the way from the column before
  std::vector<std::uint16_t> came_from_;
};

} // namespace terrainseg
