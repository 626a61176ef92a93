// SPDX-License-Identifier: LGPL-2.1-or-later
// A reference colour per column that is updated row by row, from the window's colour upwards.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "base/quantities.hpp"
#include "coarse/grid.hpp"

namespace terrainseg {

/// The mean Y U V (Q4) of the given cells of the grid, at least one.
std::array<int, 3> mean_color(const Grid& grid, std::span<const Cell> cells);

/// The reference follows light and perspective, but does not follow a sudden change of colour, such as the
/// base of a car. Keeps no state between frames.
class LocalReference {
 public:
  /// Writes to `penalty` the penalty of each cell, 0..36 (32 = 1 nat). `start` is the window's mean Y U V,
  /// Q4; `gain` is the exposure's, Q8.
  void climb(const Grid& grid, const std::array<int, 3>& start, int gain, CellPenalties& penalty);

 private:
  std::array<std::vector<std::int32_t>, 3> reference_, smooth_;
};

} // namespace terrainseg
