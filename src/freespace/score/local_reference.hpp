// SPDX-License-Identifier: LGPL-2.1-or-later
// A reference colour per column that climbs from the window's colour up the rows.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "base/quantities.hpp"
#include "coarse/grid.hpp"

namespace terrainseg {

/// The mean Y U V (Q4) of cells of the grid, at least one.
std::array<int, 3> mean_color(const Grid& grid, std::span<const Cell> cells);

/// It follows light and perspective, and stays behind where the colour breaks: at a car's base, say. No state
/// between frames.
class LocalReference {
 public:
  /// Penalty of each cell, 0..36 (32 = 1 nat), into `penalty`. `start` is the window's mean Y U V, Q4; `gain`
  /// the exposure's, Q8.
  void climb(const Grid& grid, const std::array<int, 3>& start, int gain, CellPenalties& penalty);

 private:
  std::array<std::vector<std::int32_t>, 3> reference_, smooth_;
};

} // namespace terrainseg
