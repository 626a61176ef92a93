// SPDX-License-Identifier: LGPL-2.1-or-later
// Sums the evidence of all stages for each cell and converts it to the confidence of the mask's labels.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "base/quantities.hpp"
#include "coarse/grid.hpp"
#include "freespace/curve/reestimation.hpp"
#include "freespace/holes/hole.hpp"
#include "terrainseg/frame.hpp"

namespace terrainseg {

// Confidence of an estimate.

/// Confidence of the mask, 0..255. It measures how far the scores (Q4) of the ground exceed those of the
/// rest, in the whole picture and in the rows next to the boundary. It decreases with the number of rows that
/// the boundary jumps, because a curve that follows many obstacles is uncertain. On five labelled sequences
/// its rank correlation with the frame's error is negative in each.
std::uint8_t mask_confidence(const Grid& grid, const CellScores& score, const GridCurve& boundary,
                             const GroundBehind& behind);

/// Confidence of the horizon, 0..255: the mask's confidence, reduced by the `spread` between two of the
/// boundary's uppermost percentiles, in rows of the frame.
std::uint8_t horizon_confidence(std::uint8_t mask_confidence, int spread, int frame_height);

/// Evidence is additive. Appearance and the distance from the curve count for or against ground in every
/// cell; detected obstacles count against it in their cells. A label has high confidence when the sum agrees
/// with it.
class Evidence {
 public:
  /// Starts with the appearance (`score`) and the position: evidence for ground increases below the boundary,
  /// evidence against it increases above.
  void start(const Grid& grid, const CellScores& score, const GridCurve& boundary,
             const GroundBehind& behind);

  /// Subtracts the evidence of a detector.
  void subtract(const Detection& found);

  /// Writes for every cell of the grid the confidence of its label in `mask` (2^mask_level smaller than the
  /// frame): 255 * (2 p - 1), where p is the expected share of correct labels. It is 0 where the label is no
  /// better than chance and in ignored cells. `frame_confidence` is that of the whole mask, 0..255. Doubtful
  /// pixels count as not traversable.
  void tell(const Grid& grid, const GrayView& mask, int mask_level, std::uint8_t frame_confidence,
            const MutablePlane& confidence);

  /// Evidence per cell of the grid, 32 = 1 nat, positive for ground.
  std::span<const std::int16_t> sums() const { return sums_; }

 private:
  template <typename Value, typename Strength>
  void subtract_cells(const FinerCells<Value>& cells, Strength strength);

  int level_ = 0, width_ = 0, height_ = 0;
  std::vector<std::int16_t> sums_, strongest_;
  std::vector<int> ends_;            ///< for each cell the end of its columns among the finer cells
  std::vector<int> pixels_;          ///< for each column of cells its column in the mask
  std::vector<std::uint8_t> labels_; ///< labels of a row of cells
  std::vector<std::int16_t> turned_; ///< evidence for these labels
};

/// Converts evidence for a label (32 = 1 nat) to 255 * (2 p - 1); 0 for evidence of 0 or less.
std::uint8_t confidence_of(int evidence);

} // namespace terrainseg
