// SPDX-License-Identifier: LGPL-2.1-or-later
// Distance of every cell from the training window when each move costs the colour step (the geodesic distance
// of image segmentation: P. J. Toivanen, Pattern Recognition Letters 17, 1996).
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "base/quantities.hpp"
#include "freespace/look/color_steps.hpp"

namespace terrainseg {

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
