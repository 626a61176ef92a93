// SPDX-License-Identifier: LGPL-2.1-or-later
// Colour differences between neighbouring cells, for the detection of edges.
#pragma once

#include <cstdint>
#include <vector>

#include "coarse/grid.hpp"

namespace terrainseg {

/// Upper limit of a colour step.
inline constexpr int most_color_step = 1023;

/// Per cell of the grid the difference from its neighbour: |dY| + 2 |dU| + 2 |dV|, normalised to the learned
/// exposure, 0..most_color_step. Undefined where there is no neighbour.
struct ColorSteps {
  std::vector<std::uint16_t> right, down, down_left, down_right;
};

/// Measures the steps of a grid. `gain_q8` is the exposure's gain. Diagonal steps are measured only with
/// `diagonal`.
void measure_color_steps(const Grid& grid, int gain_q8, bool diagonal, ColorSteps& steps);

} // namespace terrainseg
