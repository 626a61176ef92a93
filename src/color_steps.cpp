// SPDX-License-Identifier: LGPL-2.1-or-later
#include "color_steps.hpp"

#include <algorithm>

#include "kernels/cells.hpp"

namespace terrainseg {

void measure_color_steps(const CoarseGrid& grid, int gain_q8, bool diagonal, ColorSteps& steps) {
  // Rows lie one after the other: all of them in one go, with those over the end of a row that nobody looks
  // at.
  const auto measure = [&](std::size_t from, std::size_t to, std::vector<std::uint16_t>& out) {
    out.resize(grid.size());
    const std::size_t farther = std::max(from, to);
    if (farther < grid.size())
      kernels::color_steps(components_at(grid, from), components_at(grid, to), gain_q8, most_color_step,
                           static_cast<int>(grid.size() - farther), &out[from]);
  };
  const auto width = static_cast<std::size_t>(grid.width);
  measure(0, 1, steps.right);
  measure(0, width, steps.down);
  if (!diagonal)
    return;
  measure(1, width, steps.down_left);
  measure(0, width + 1, steps.down_right);
}

} // namespace terrainseg
