// SPDX-License-Identifier: LGPL-2.1-or-later
// What a frame's training window teaches.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "base/stage_clock.hpp"
#include "coarse/horizon.hpp"
#include "coarse/window.hpp"
#include "freespace/learn/window_guard.hpp"
#include "freespace/score/terrain_tables.hpp"

namespace terrainseg {

struct View;

/// Of one frame's window: views into memory of the teacher, good until its next frame.
struct WindowLesson {
  std::uint32_t flags = 0;  ///< learned, or why not
  bool known = false;       ///< a terrain is known, from this frame or from earlier ones
  bool from_memory = false; ///< what stands in front has not been looked at
  Vouched trusted;          ///< the window's cells that are ground, and what is joined to them
  Horizon horizon;          ///< the paper's, where it is asked for
};

class WindowTeacher {
 public:
  /// Learns the window unless it is foreign, has too few cells, or must not be learned: Gaussians (paper, C
  /// and D), and histograms of what stands against them. `last` is the boundary of the frame before where
  /// that shows the same place, else empty.
  WindowLesson learn(const View& view, const GridCurve& last, WindowGuard& guard, TerrainTables& tables,
                     Terrain& terrain, StageClock& clock);

 private:
  std::span<const Cell> lit_window(const View& view);
  std::span<const std::uint8_t> teach(const View& view, const GridCurve& last, TerrainTables& tables,
                                      Terrain& terrain, StageClock& clock);

  std::vector<Cell> lit_cells_;
  Prefiltered kept_;
  ClusterScratch clusters_;
  std::vector<Lesson> lessons_;
};

} // namespace terrainseg
