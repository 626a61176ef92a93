// SPDX-License-Identifier: LGPL-2.1-or-later
#include "coarse/grid_reader.hpp"

#include <algorithm>

#include "coarse/grid.hpp"

namespace terrainseg {

PyramidPlan coarse_plan(PixelFormat format, int coarsest) {
  const int texture = texture_level(coarsest);
  // Luma of RGB is a mixture of all three components, so its texture bands need all three.
  const int color = layout_of(format).rgb ? texture : refinement_level(coarsest);
  // The finest level that is read is never sparse. At 4K, with one more sparse level of luma, more ground of
  // rendered trails is missed.
  return {coarsest, color, texture, std::clamp(texture - 1, 0, 1), std::clamp(color - 1, 0, 2)};
}

Grid GridReader::read(const Pyramid& pyramid, int level, const ColorTransform& transform,
                      std::span<const Rectangle> ignore_regions) {
  const Grid source = pyramid.grid(level);
  const int width = source.width;
  bytes_.assign(4 * source.size(), 0);
  const auto part = [&](std::size_t index) { return bytes_.data() + index * source.size(); };
  for (int i = 0; i < source.height; ++i) {
    const std::size_t row = source.at(i, 0);
    transform_row(transform, source.row(i), {part(0) + row, part(1) + row, part(2) + row}, width);
  }
  fill_ignored(ignore_regions, level, width, source.height, 1, part(3));
  return {{Plane{part(0), width}, Plane{part(1), width}, Plane{part(2), width}},
          width,
          source.height,
          level,
          {part(3), source.size()}};
}

} // namespace terrainseg
