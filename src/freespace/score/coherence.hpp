// SPDX-License-Identifier: LGPL-2.1-or-later
// Evidence of upright things: their luma steps keep their sign over some cells of height.
#pragma once

#include <cstdint>
#include <vector>

#include "base/color_transform.hpp"
#include "base/quantities.hpp"
#include "coarse/grid.hpp"
#include "coarse/pyramid.hpp"

namespace terrainseg {

/// Texture of the ground changes from row to row, its steps cancel out when rows are added up. The edges of
/// what stands on it are upright and add up. Colour cannot tell a wall of the ground's colour from the
/// ground, this can.
class UprightCoherence {
 public:
  /// Measures a frame, with the luma two levels finer than the grid. `rgb`: the pyramid holds R, G, B.
  void look(const Pyramid& pyramid, const Grid& grid, const ColorTransform& transform, bool rgb);

  /// Of each cell in Q8: log2 of the largest step of the added rows less that of the mean step, in the mean
  /// over 3 x 5 cells. High for upright things.
  const std::vector<std::int16_t>& coherence() const { return average_; }

  /// Lowers the weight of `score` (Q4) and adds what coherence says, which is little without contrast.
  void weigh(const Grid& grid, CellScores& score) const;

 private:
  void add_rows(const Pyramid& pyramid, const Grid& grid, const ColorTransform& transform, bool rgb);
  void compare(const Grid& grid);
  void average(const Grid& grid);

  int level_ = 0;
  std::size_t width_ = 0; ///< of that level
  std::vector<std::uint8_t> luma_;
  std::vector<std::uint16_t> sums_, steps_; ///< of the rows of a cell: luma, and absolute differences
  std::vector<std::uint16_t> column_sums_, column_most_, column_all_; ///< of the rows that are added
  std::vector<std::int16_t> coherence_, down_, average_;
  std::vector<std::uint16_t> contrast_; ///< up to where it counts in full
};

} // namespace terrainseg
