// SPDX-License-Identifier: LGPL-2.1-or-later
#include "freespace/look/color_steps.hpp"

#include <cstdlib>

#include "kernels/cells.hpp"

namespace terrainseg {
namespace {

kernels::ComponentRow row_from(const Grid& grid, int row, int column) {
  kernels::ComponentRow components = grid.row(row);
  for (const std::uint8_t*& component : components)
    component += column;
  return components;
}

} // namespace

void measure_color_steps(const Grid& grid, int gain_q8, bool diagonal, ColorSteps& steps) {
  // Measures from every cell to the one `down` rows below and `right` columns to the right.
  const auto measure = [&](int down, int right, std::vector<std::uint16_t>& out) {
    out.resize(grid.size());
    const int first = right < 0 ? 1 : 0, count = grid.width - std::abs(right);
    for (int i = 0; i + down < grid.height; ++i)
      kernels::color_steps(row_from(grid, i, first), row_from(grid, i + down, first + right), gain_q8,
                           most_color_step, count, &out[grid.at(i, 0)] + first);
  };
  measure(0, 1, steps.right);
  measure(1, 0, steps.down);
  if (!diagonal)
    return;
  measure(1, -1, steps.down_left);
  measure(1, 1, steps.down_right);
}

} // namespace terrainseg
