// SPDX-License-Identifier: LGPL-2.1-or-later
// Coarse grids for the tests of the stages that look at one.
#pragma once

#include <cstdint>

#include "color_steps.hpp"

namespace terrainseg::test {

/// All cells of one grey, none ignored.
inline CoarseGrid gray_grid(int width, int height, int luma = 100) {
  CoarseGrid grid;
  grid.width = width;
  grid.height = height;
  const auto size = static_cast<std::size_t>(width * height);
  grid.y.assign(size, static_cast<std::uint8_t>(luma));
  grid.u = grid.v = std::vector<std::uint8_t>(size, 128);
  grid.ignored.assign(size, 0);
  return grid;
}

/// The steps between all neighbours.
inline ColorSteps color_steps_of(const CoarseGrid& grid, int gain_q8 = 256) {
  ColorSteps steps;
  measure_color_steps(grid, gain_q8, true, steps);
  return steps;
}

} // namespace terrainseg::test
