// SPDX-License-Identifier: LGPL-2.1-or-later
// How far every cell lies from the training window when the way is paid in colour steps (the geodesic
// distance of image segmentation: P. J. Toivanen, Pattern Recognition Letters 17, 1996).
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "base/quantities.hpp"
#include "freespace/look/color_steps.hpp"

namespace terrainseg {

/// An obstacle is enclosed by edges: its base, its sides. A road has ways around its markings and shadows,
/// and most of them cost nothing. No state between frames.
class GeodesicPenalty {
 public:
  /// Raises `penalty` (32 = 1 nat) to what each cell's distance from the `seeds` is worth, 0..40. The ways
  /// climb: from a row to the same row or to the one above it, to any of the eight neighbours there. A step
  /// costs what it differs in colour (`steps`, the slanting ones too) beyond what the cells of the
  /// window differ among themselves; an eighth of the distance is forgiven with every row. Cells below all
  /// seeds are left as they are.
  void raise(const Grid& grid, const ColorSteps& steps, std::span<const Cell> seeds, CellPenalties& penalty);

 private:
  std::vector<std::uint8_t> is_seed_;
  std::vector<int> here_, below_; ///< distances of two rows
};

} // namespace terrainseg
