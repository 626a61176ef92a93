// SPDX-License-Identifier: LGPL-2.1-or-later
#include "coarse.hpp"

#include <algorithm>

namespace terrainseg {

PyramidPlan coarse_plan(PixelFormat format, int coarsest) {
  const int texture = texture_level(coarsest);
  // Luma of RGB is a mixture of all three components, so its texture bands need all three.
  return {coarsest, layout_of(format).rgb ? texture : refinement_level(coarsest), texture};
}

void read_grid(const Pyramid& pyramid, int level, const ColorTransform& transform,
               std::span<const Rectangle> ignore_regions, CoarseGrid& grid) {
  grid.level = level;
  grid.width = pyramid.width(level);
  grid.height = pyramid.height(level);
  const std::size_t size = static_cast<std::size_t>(grid.width) * grid.height;
  for (auto* plane : {&grid.y, &grid.u, &grid.v})
    plane->resize(size);
  for (int i = 0; i < grid.height; ++i)
    transform_row(
        transform,
        {pyramid.plane(level, 0).row(i), pyramid.plane(level, 1).row(i), pyramid.plane(level, 2).row(i)},
        {&grid.y[grid.at(i, 0)], &grid.u[grid.at(i, 0)], &grid.v[grid.at(i, 0)]}, grid.width);
  grid.ignored.assign(size, 0);
  for (const Rectangle& region : ignore_regions) {
    const Rectangle cells = cells_in(region, level, grid.width, grid.height);
    for (int i = cells.y; i < cells.y + cells.height; ++i)
      std::fill_n(&grid.ignored[grid.at(i, 0)] + cells.x, cells.width, std::uint8_t{1});
  }
}

} // namespace terrainseg
