// SPDX-License-Identifier: LGPL-2.1-or-later
// Learns from a frame's training window.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "base/pipeline.hpp"
#include "coarse/grid.hpp"
#include "coarse/window.hpp"
#include "freespace/learn/window_guard.hpp"
#include "freespace/score/likelihood.hpp"

namespace terrainseg {

struct View;

/// The result of one frame's window: views into memory of the teacher, valid until its next frame.
struct WindowLesson {
  std::uint32_t flags = 0;  ///< flag_learned, or the reason for not learning; flag_window_still
  bool known = false;       ///< a terrain is known, from this frame or from earlier ones
  bool from_memory = false; ///< the window was not examined
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
  std::span<const Cell> lit_window(const View& view);
  std::span<const std::uint8_t> teach(const View& view, const GridCurve& last, TerrainTables& tables,
                                      Terrain& terrain, StageClock& clock);

  std::vector<Cell> lit_cells_;
  Prefiltered kept_;
  ClusterScratch clusters_;
  std::vector<Lesson> lessons_;
};

} // namespace terrainseg
