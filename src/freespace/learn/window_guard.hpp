// SPDX-License-Identifier: LGPL-2.1-or-later
// Prevents the learning of an obstacle that fills the training window.
#pragma once

#include <cstdint>
#include <vector>

#include "coarse/grid.hpp"
#include "freespace/look/color_bins.hpp"
#include "freespace/score/likelihood.hpp"

namespace terrainseg {

/// The learned terrain is visible left and right of the window but not in it: an obstacle stands in front. A
/// change of the terrain itself is visible on both sides too, and is learned immediately. A window that keeps
/// looking foreign is learned after 64 frames, so that the guard cannot stop learning permanently.
class WindowGuard {
 public:
  /// Returns true when this frame's window must not be learned. `tables` are those of the terrain before this
  /// frame; `window` is in cells of the grid.
  bool refuses(const CellBins& cells, const LikelihoodTables& tables, int grid_width,
               const Rectangle& window);

 private:
  int held_ = 0; ///< number of consecutive refused frames
};

} // namespace terrainseg
