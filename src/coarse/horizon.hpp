// SPDX-License-Identifier: LGPL-2.1-or-later
// Stage D: the horizon (paper, section 3.4, equations (9) to (12)).
#pragma once

#include <cstdint>

#include "coarse/grid.hpp"
#include "terrainseg/terrain.hpp"

namespace terrainseg {

struct Horizon {
  int row = -1; ///< of the grid; -1 = null: the stage is skipped
  std::uint8_t confidence =
      0; ///< how much poorer the row is than the rest: 255 = nothing of the ground in it
};

/// Equation (10): every component of `color` lies within two standard deviations of the ground. Squares are
/// compared: the paper prints an interval around zero and the variance where the deviation is meant.
bool looks_like_ground(const Color& color, const Gaussian& ground);

/// Equation (11): the row above the window that shares the least with the ground. `window_top` and
/// `window_end` are the first of the window's rows in the grid and one past the last. Terrain is kept from
/// this row down (equation (12) prints the opposite).
Horizon find_horizon(const Grid& grid, const Gaussian& ground, int window_top, int window_end);

} // namespace terrainseg
