// SPDX-License-Identifier: LGPL-2.1-or-later
// Stage E: scores from the learned models (paper, section 3.5). Models are learned from coarse cells, pixels
// are scored at full resolution through a table over the shifted colour space.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "coarse/grid.hpp"
#include "kernels/score_table.hpp"
#include "terrainseg/frame.hpp"
#include "terrainseg/terrain.hpp"

namespace terrainseg {

class Workers;

/// The paper does not define which scores mean terrain. Here a colour is traversable when its smallest
/// squared Mahalanobis distance to a learned model is at most threshold^2. The paper's reference [7] used 3
/// sigma.
class ScoreTable {
 public:
  /// `threshold_q8` is in standard deviations, Q8. Null models are skipped. Distances are computed at bin
  /// centres and rounded to 1/240 of the threshold. Allocates only when `bit_shift` changes.
  void build(std::span<const TerrainModel> learned, int threshold_q8, int bit_shift);

  /// 0 = at the mean of a model, kernels::score_limit = at the threshold, 255 = beyond the threshold.
  std::uint8_t score(const Color& color) const {
    return kernels::score_of(scores_, color[0], color[1], color[2]);
  }

  /// Computes the scores of all cells, row by row.
  void score(const Grid& grid, std::vector<std::uint8_t>& scores) const;

  /// Labels the rows from `first_row` down by colour and sets the rows above to 0. Returns the number of
  /// traversable pixels. The mask has the size of the frame or grid.
  std::uint64_t label(const Frame& frame, int first_row, const MutablePlane& mask, Workers& workers) const;
  std::uint64_t label(const Grid& grid, int first_row, const MutablePlane& mask, Workers& workers) const;

 private:
  /// Sets the rows above `first_row` to not traversable. For the others, `label(y)` labels row y and returns
  /// its number of traversable pixels.
  template <typename Label>
  std::uint64_t label_rows(int width, int height, int first_row, const MutablePlane& mask, Workers& workers,
                           const Label& label) const;
  std::uint32_t label_row(const kernels::PixelRow& row, std::uint8_t* mask, int width) const;

  kernels::ComponentScores scores_;
  std::vector<std::uint8_t> table_, used_;
  int table_shift_ = -1;
  bool by_parts_ = false; ///< the whole table is not needed
};

/// How well the learned models explain the window's cells, for the estimate's confidence: 255 minus the mean
/// score of these cells.
std::uint8_t mean_closeness(std::span<const std::uint8_t> scores, int grid_width, const Rectangle& cells);

} // namespace terrainseg
