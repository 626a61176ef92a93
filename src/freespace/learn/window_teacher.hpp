// SPDX-License-Identifier: LGPL-2.1-or-later
// Checks that the training window shows the ground in front of the vehicle, and learns from it.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "base/pipeline.hpp"
#include "coarse/grid.hpp"
#include "coarse/window.hpp"
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

/// How much the training window says about the ground ahead, Q8: 256 for a usual one, or without cells. Less
/// when its `window` cells are rough or of different luma, because it may show several kinds of ground, or a
/// thing.
int clarity_of_window(const Grid& grid, const CellBins& cells, std::span<const Cell> window);

/// What the checks keep between frames.
struct WindowMemory {
  WindowGuard guard;
  StillWindow still;
  std::uint32_t clarity = 0; ///< of the window, followed, Q16; 0 = not yet known
};

struct View;

/// The result of one frame's window: views into memory of the teacher, valid until its next frame.
struct WindowLesson {
  std::uint32_t flags = 0;  ///< flag_learned, or the reason for not learning; flag_window_still
  bool known = false;       ///< a terrain is known, from this frame or from earlier ones
  bool from_memory = false; ///< the window was not examined
  int clarity = 0;          ///< of the windows of this and of earlier frames, Q8
  Vouched trusted;          ///< the window's cells that are ground, and the ground connected to them
  Horizon horizon;          ///< the paper's horizon, when the settings select it
};

class WindowTeacher {
 public:
  /// Learns the window unless it is foreign, has too few cells, or learning is disabled. Updates the
  /// Gaussians (paper, stages C and D) and the histograms of terrain and non-terrain. `last` is the boundary
  /// of the previous frame when it shows the same place, otherwise empty.
  WindowLesson learn(const View& view, const GridCurve& last, WindowMemory& memory, TerrainTables& tables,
                     Terrain& terrain, StageClock& clock);

 private:
  std::span<const std::uint8_t> teach(const View& view, const GridCurve& last, TerrainTables& tables,
                                      Terrain& terrain, StageClock& clock);

  Prefiltered kept_;
  ClusterScratch clusters_;
  std::vector<Lesson> lessons_;
};

} // namespace terrainseg
