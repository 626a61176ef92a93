// SPDX-License-Identifier: LGPL-2.1-or-later
// The grid that the default pipeline thinks on: the coarsest pyramid level in one colour space.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "color_transform.hpp"
#include "grid.hpp"
#include "kernels/cells.hpp"
#include "pyramid.hpp"

namespace terrainseg {

/// Full-range BT.601 luma and chroma, width x height cells each. Cell (row i, column j) is centred at frame
/// pixel (row i * 2^level, column j * 2^level): a pyramid keeps the phase of its even samples, and half a
/// cell further would cost 1 % of the height.
struct CoarseGrid {
  int level = 0, width = 0, height = 0;
  std::vector<std::uint8_t> y, u, v;
  std::vector<std::uint8_t> ignored; ///< 1 where ignore-regions cover the centre
  std::size_t size() const { return y.size(); }
  std::size_t at(int row, int column) const { return static_cast<std::size_t>(row) * width + column; }
};

/// The cells from `cell` on.
inline kernels::ComponentRow components_at(const CoarseGrid& grid, std::size_t cell) {
  // Not by operator[]: of a grid of one row there is no second one, and nothing of it is looked at.
  return {grid.y.data() + cell, grid.u.data() + cell, grid.v.data() + cell};
}

/// Level of the refinement: two finer than the grid where there are two.
constexpr int refinement_level(int coarsest) {
  return coarsest > 2 ? coarsest - 2 : 0;
}

/// Level of the finest texture band: three finer than the grid where there are three.
constexpr int texture_level(int coarsest) {
  return coarsest > 3 ? coarsest - 3 : 0;
}

/// What the default pipeline reads of a frame.
PyramidPlan coarse_plan(PixelFormat format, int coarsest);

/// Copies the pyramid's level into the grid. Allocates only when the grid grows.
void read_grid(const Pyramid& pyramid, int level, const ColorTransform& transform,
               std::span<const Rectangle> ignore_regions, CoarseGrid& grid);

} // namespace terrainseg
