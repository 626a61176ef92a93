// SPDX-License-Identifier: LGPL-2.1-or-later
// What one frame's own ground and the rest of it look like, once a first boundary parts them (the iteration
// of C. Rother, V. Kolmogorov, A. Blake, "GrabCut", ACM Transactions on Graphics 23, 2004, with histograms
// and one step). What is learned over time knows the window and the frames before; light that this frame
// alone is in, and ground that never was in the window, only the frame itself can tell.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "base/quantities.hpp"
#include "coarse/grid.hpp"
#include "freespace/look/color_bins.hpp"

namespace terrainseg {

class Reestimation {
 public:
  /// `revised` = `score` (Q4, 16 * 32 = 1 nat) and what each cell's colour and texture say by how often they
  /// occur below and above `boundary` (first ground row per column): three eighths of a nat at most by each
  /// of the two. Above the boundary's upper tenth nothing speaks for the ground, and where there is a
  /// `penalty` (32 = 1 nat) a colour does so the less the higher it is. False, and nothing else done, where
  /// either side has too few cells to tell. No state between frames.
  bool revise(const Grid& grid, const CellBins& cells, const GridCurve& boundary,
              const CellPenalties& penalty, const CellScores& score, CellScores& revised);

 private:
  /// How often bins occur on one side.
  struct Side {
    std::array<std::uint32_t, color_bins> color, blurred;
    std::array<std::uint32_t, texture_bins> texture;
    std::uint32_t cells;
  };
  void count(const Grid& grid, const CellBins& cells, const GridCurve& boundary);
  void compare();

  Side ground_{}, rest_{};
  std::array<std::uint32_t, color_bins> between_{};
  std::array<std::int16_t, color_bins> color_{};     ///< Q4, for the ground where positive
  std::array<std::int16_t, texture_bins> texture_{}; ///< likewise
  std::vector<std::uint16_t> scratch_;
};

} // namespace terrainseg
