// SPDX-License-Identifier: LGPL-2.1-or-later
// Evidence of upright objects: their luma steps keep their sign over some cells of height.
#pragma once

#include <cstdint>
#include <vector>

#include "base/color_transform.hpp"
#include "base/quantities.hpp"
#include "coarse/grid.hpp"
#include "coarse/pyramid.hpp"

namespace terrainseg {

/// The ground's texture changes from row to row, so its steps cancel when rows are summed. Edges of obstacles
/// are upright and add up. This separates a wall of the ground's colour from the ground, which colour cannot.
class UprightCoherence {
 public:
  /// Measures a frame from the luma two levels finer than the grid. `rgb`: the pyramid holds R, G, B.
  void look(const Pyramid& pyramid, const Grid& grid, const ColorTransform& transform, bool rgb);

  /// Per cell in Q8: log2 of the largest step of the summed rows minus that of the mean step, averaged over 3
  /// x 5 cells. High for upright objects.
  const std::vector<std::int16_t>& coherence() const { return average_; }

  /// Reduces the weight of `score` (Q4) and adds the evidence of coherence, which is small at low contrast.
  void weigh(const Grid& grid, CellScores& score) const;

 private:
  void add_rows(const Pyramid& pyramid, const Grid& grid, const ColorTransform& transform, bool rgb);
  void compare(const Grid& grid);
  void average(const Grid& grid);

  int level_ = 0;
  std::size_t width_ = 0; ///< width of that finer level
  std::vector<std::uint8_t> luma_;
  std::vector<std::uint16_t> sums_, steps_; ///< of the rows of a cell: luma, and absolute differences
  std::vector<std::uint16_t> column_sums_, column_steps_, most_; ///< of the summed rows
  std::vector<std::uint32_t> values_; ///< of a row of cells: what both logarithms are of
  std::vector<std::int16_t> logs_, coherence_, down_, average_;
  std::vector<std::uint16_t> contrast_; ///< limited to full_contrast
};

} // namespace terrainseg
