// SPDX-License-Identifier: LGPL-2.1-or-later
// Stage D: the horizon (paper, section 3.4, equations (9) to (12)).
#pragma once

#include <cstdint>

#include "coarse/grid.hpp"
#include "terrainseg/terrain.hpp"

namespace terrainseg {

struct Horizon {
  int row = -1;                ///< row of the grid; -1 = none: the stage is skipped
  std::uint8_t confidence = 0; ///< how much less ground the row has than the others; 255 = none
};

/// Equation (10): whether every component of `color` is within two standard deviations of the ground.
/// Compares squares. The paper prints an interval around zero, and the variance instead of the deviation.
bool looks_like_ground(const Color& color, const Gaussian& ground);

/// Equation (11): the row above the window that has the fewest ground cells. `window_top` is the first row of
/// the window in the grid, `window_end` is exclusive. Terrain is kept from this row down (equation (12)
/// prints the opposite).
Horizon find_horizon(const Grid& grid, const Gaussian& ground, int window_top, int window_end);

} // namespace terrainseg
