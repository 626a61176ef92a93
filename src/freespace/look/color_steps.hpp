// SPDX-License-Identifier: LGPL-2.1-or-later
// How much neighbouring cells differ in colour: what edges are told by.
#pragma once

#include <cstdint>
#include <vector>

#include "coarse/grid.hpp"

namespace terrainseg {

/// No colour step counts more.
inline constexpr int most_color_step = 1023;

/// Per cell of the grid the step to its neighbour: |dY| + 2 |dU| + 2 |dV|, brought to the learned exposure,
/// 0..most_color_step. Only where there is a neighbour; anything elsewhere.
struct ColorSteps {
  std::vector<std::uint16_t> right, down, down_left, down_right;
};

/// Measures the steps of a grid, `gain_q8` being the exposure's; the slanting ones only where `diagonal`.
void measure_color_steps(const Grid& grid, int gain_q8, bool diagonal, ColorSteps& steps);

} // namespace terrainseg
