// SPDX-License-Identifier: LGPL-2.1-or-later
// Penalties of cells: difference from a reference colour that follows each column upwards, and distance from
// the training window when each move costs the colour step (the geodesic distance of image segmentation: P.
// J. Toivanen, Pattern Recognition Letters 17, 1996).
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "base/quantities.hpp"
#include "coarse/grid.hpp"
#include "freespace/look/connected_ground.hpp"

namespace terrainseg {

/// The mean Y U V (Q4) of the given cells of the grid, at least one.
std::array<int, 3> mean_color(const Grid& grid, std::span<const Cell> cells);

/// The reference follows light and perspective, but does not follow a sudden change of colour, such as the
/// base of a car. Keeps no state between frames.
class LocalReference {
 public:
  /// Writes to `penalty` the penalty of each cell, 0..24 (32 = 1 nat). `start` is the window's mean Y U V,
  /// Q4; `gain` is the exposure's, Q8.
  void climb(const Grid& grid, const std::array<int, 3>& start, int gain, CellPenalties& penalty);

 private:
  std::array<std::vector<std::int32_t>, 3> reference_, smooth_;
};

/// An obstacle is enclosed by edges at its base and its sides. A road has paths around its markings and
/// shadows, and most of them have no cost. Keeps no state between frames.
class GeodesicPenalty {
 public:
  /// Raises `penalty` (32 = 1 nat) to the value of each cell's distance from the `seeds`, 0..40. Paths go up:
  /// from a row to the same row or to the row above, to any of the eight neighbours there. A move costs the
  /// colour step (`steps`, including diagonal ones) minus the usual step among the window's cells. With every
  /// row the distance decreases by an eighth. Cells below all seeds remain unchanged.
  void raise(const Grid& grid, const ColorSteps& steps, std::span<const Cell> seeds, CellPenalties& penalty);

 private:
  std::vector<std::uint8_t> is_seed_;
  std::vector<int> here_, below_; ///< distances of two rows
};

} // namespace terrainseg
