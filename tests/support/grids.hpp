// SPDX-License-Identifier: LGPL-2.1-or-later
// Grids for the tests of the stages that look at one.
#pragma once

#include <cstdint>
#include <vector>

#include "coarse/grid.hpp"
#include "freespace/look/connected_ground.hpp"

namespace terrainseg::test {

/// A grid with its bytes, to be written to.
struct OwnedGrid {
  int width = 0, height = 0, level = 0;
  std::vector<std::uint8_t> y, u, v, ignored;

  OwnedGrid() = default;
  /// All cells of one colour, none ignored.
  OwnedGrid(int w, int h, Color color = {}, int l = 0)
      : width(w), height(h), level(l), y(size(), color[0]), u(size(), color[1]), v(size(), color[2]),
        ignored(size(), 0) {}

  std::size_t size() const { return static_cast<std::size_t>(width) * height; }
  std::size_t at(int row, int column) const { return static_cast<std::size_t>(row) * width + column; }
  void set(Cell cell, Color color) {
    const std::size_t i = at(cell.y, cell.x);
    y[i] = color[0];
    u[i] = color[1];
    v[i] = color[2];
  }
  Grid view() const {
    return {{Plane{y.data(), width}, Plane{u.data(), width}, Plane{v.data(), width}},
            width,
            height,
            level,
            ignored};
  }
  operator Grid() const { return view(); }
};

/// All cells of one grey, none ignored.
inline OwnedGrid gray_grid(int width, int height, int luma = 100) {
  return {width, height, {static_cast<std::uint8_t>(luma), 128, 128}};
}

/// The steps between all neighbours.
inline ColorSteps color_steps_of(const Grid& grid, int gain_q8 = 256) {
  ColorSteps steps;
  measure_color_steps(grid, gain_q8, true, steps);
  return steps;
}

} // namespace terrainseg::test
