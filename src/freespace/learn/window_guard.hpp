// SPDX-License-Identifier: LGPL-2.1-or-later
// Checks that the training window shows the ground in front of the vehicle.
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

/// The window is still: the picture above it has changed many times, but the window has not. It then shows a
/// part of the vehicle, such as a bonnet or a dashboard, or a picture that stands still. A window without
/// contrast is never still.
class StillWindow {
 public:
  /// Compares the frame with an earlier one. `window` is in cells of the grid. Returns true while the window
  /// is still.
  bool look(const Grid& grid, const Rectangle& window);

 private:
  std::vector<std::uint8_t> before_; ///< luma of the grid at the last change of the picture above the window
  int changes_ = 0; ///< changes of the picture above the window in which the window was still
};

/// What the checks keep between frames.
struct WindowMemory {
  WindowGuard guard;
  StillWindow still;
};

} // namespace terrainseg
