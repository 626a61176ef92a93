// SPDX-License-Identifier: LGPL-2.1-or-later
// Stage E: scoring by the learned models (paper, section 3.5). Models are learned coarse, pixels are scored
// fine: a table over the shifted colour space maps the one to the other.
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

/// The paper gives no rule for when a score means terrain. Here: traversable when the smallest squared
/// Mahalanobis distance to a learned model is not above threshold^2 (the paper's reference [7] used 3 sigma).
class ScoreTable {
 public:
  /// `threshold_q8` in standard deviations. Null models are skipped. Distances are those of bin centres,
  /// rounded to 1/240 of the threshold. Allocates only when `bit_shift` changes.
  void build(std::span<const TerrainModel> learned, int threshold_q8, int bit_shift);

  /// 0 = at a model's mean, kernels::score_limit = at the threshold, 255 = anywhere beyond it.
  std::uint8_t score(const Color& color) const {
    return kernels::score_of(scores_, color[0], color[1], color[2]);
  }

  /// Scores of all cells, row by row.
  void score(const Grid& grid, std::vector<std::uint8_t>& scores) const;

  /// Labels rows from `first_row` down by their colours; rows above it become 0. Returns the number of
  /// traversable pixels. The mask has the size of the frame or grid.
  std::uint64_t label(const Frame& frame, int first_row, const MutablePlane& mask, Workers& workers) const;
  std::uint64_t label(const Grid& grid, int first_row, const MutablePlane& mask, Workers& workers) const;

 private:
  /// Labels rows, all above `first_row` as not traversable; `label(y)` labels row y and counts.
  template <typename Label>
  std::uint64_t label_rows(int width, int height, int first_row, const MutablePlane& mask, Workers& workers,
                           const Label& label) const;
  std::uint32_t label_row(const kernels::PixelRow& row, std::uint8_t* mask, int width) const;

  kernels::ComponentScores scores_;
  std::vector<std::uint8_t> table_, used_;
  int table_shift_ = -1;
  bool by_parts_ = false; ///< the table is not needed
};

/// How well the learned models explain the cells of the window, for the estimate's confidence: 255 minus
/// their mean score.
std::uint8_t mean_closeness(std::span<const std::uint8_t> scores, int grid_width, const Rectangle& cells);

} // namespace terrainseg
