// SPDX-License-Identifier: LGPL-2.1-or-later
// Keeps an obstacle that fills the window from being learned as terrain.
#pragma once

#include <cstdint>
#include <vector>

#include "coarse/grid.hpp"
#include "freespace/look/color_bins.hpp"
#include "freespace/score/likelihood.hpp"

namespace terrainseg {

/// The learned terrain is to be seen left and right of the window but not in it: something stands in front.
/// When the terrain itself changes it does so on both sides too, and is learned at once. What keeps looking
/// foreign is learned after 64 frames all the same: the guard must not blind the filter for good.
class WindowGuard {
 public:
  /// True when this frame's window must not be learned. `tables` are those of what was learned before it;
  /// `window` in cells of the grid.
  bool refuses(const CellBins& cells, const LikelihoodTables& tables, int grid_width,
               const Rectangle& window);

 private:
  int held_ = 0; ///< frames
};

} // namespace terrainseg
