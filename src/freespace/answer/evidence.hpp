// SPDX-License-Identifier: LGPL-2.1-or-later
// What all stages say of each cell, added up, and how sure the mask's label is of it.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "base/quantities.hpp"
#include "coarse/grid.hpp"
#include "freespace/curve/ground_behind.hpp"
#include "freespace/holes/hole.hpp"
#include "terrainseg/frame.hpp"

namespace terrainseg {

/// Evidence adds up: appearance and the curve speak for or against the ground in every cell, what stands in
/// the open against it where it was seen. The mask's label is sure where the sum is on its side.
class Evidence {
 public:
  /// Appearance (`score`), and the curve: ground is the surer ground the farther below the boundary it lies,
  /// the rest the surer the farther above it.
  void start(const Grid& grid, const CellScores& score, const GridCurve& boundary,
             const GroundBehind& behind);

  /// What a detector has seen in the open.
  void subtract(const Detection& found);

  /// For every cell of the grid how sure its label in `mask` (2^mask_level smaller than the frame) is: 255 *
  /// (2 p - 1), where p is the share of right labels to expect; 0 where it is no better than a toss, and
  /// where the grid is ignored. `frame_confidence` is that of the whole mask, 0..255. Doubtful pixels are not
  /// traversable.
  void tell(const Grid& grid, const GrayView& mask, int mask_level, std::uint8_t frame_confidence,
            const MutablePlane& confidence);

  /// Per cell of the grid, 32 = 1 nat, positive = ground.
  std::span<const std::int16_t> sums() const { return sums_; }

 private:
  template <typename Value, typename Strength>
  void subtract_cells(const FinerCells<Value>& cells, Strength strength);

  int level_ = 0, width_ = 0, height_ = 0;
  std::vector<std::int16_t> sums_, strongest_;
  std::vector<int> ends_;            ///< of each cell's columns among finer cells
  std::vector<int> pixels_;          ///< of the mask, of each column of cells
  std::vector<std::uint8_t> labels_; ///< of a row of cells
  std::vector<std::int16_t> turned_; ///< its evidence for them
};

/// 255 * (2 p - 1) of evidence for a label, 32 = 1 nat; 0 where there is none.
std::uint8_t confidence_of(int evidence);

} // namespace terrainseg
