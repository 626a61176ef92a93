// SPDX-License-Identifier: LGPL-2.1-or-later
#include "coarse/grid.hpp"

#include <algorithm>

#include "base/lattice.hpp"
#include "terrainseg/estimate.hpp"
#include "terrainseg/settings.hpp"

namespace terrainseg {

void fill_ignored(std::span<const Rectangle> ignored, int level, int width, int height, std::uint8_t value,
                  std::uint8_t* cells) {
  for (const Rectangle& pixels : ignored) {
    const Rectangle r = cells_in(pixels, level, width, height);
    for (int y = r.y; y < r.y + r.height; ++y)
      std::fill_n(cells + static_cast<std::ptrdiff_t>(y) * width + r.x, r.width, value);
  }
}

std::uint64_t mark_ignored(std::span<const Rectangle> ignored, int mask_level, const MutablePlane& mask,
                           int width, int height) {
  std::uint64_t was_traversable = 0;
  for (const Rectangle& pixels : ignored) {
    const Rectangle r = cells_in(pixels, mask_level, width, height);
    for (int y = r.y; y < r.y + r.height; ++y) {
      std::uint8_t* row = mask.row(y) + r.x;
      was_traversable += static_cast<std::uint64_t>(std::count(row, row + r.width, mask_traversable));
      std::fill_n(row, r.width, mask_doubtful);
    }
  }
  return was_traversable;
}

int grid_level(int wanted, int width, int height) {
  int level = std::max(wanted, 0);
  if (wanted < 0)
    while (level < max_pyramid_levels && subsampled(width, level) >= 96)
      ++level;
  while (level > 0 && subsampled(std::min(width, height), level) < 4)
    --level;
  return level;
}

bool is_blank(const Grid& grid) {
  constexpr int noise = 2;
  for (const Plane& plane : grid.planes) {
    int least = 255, most = 0;
    for (int y = 0; y < grid.height; ++y) {
      const auto [low, high] = std::minmax_element(plane.row(y), plane.row(y) + grid.width);
      least = std::min<int>(least, *low);
      most = std::max<int>(most, *high);
      if (most - least > noise)
        return false;
    }
  }
  return true;
}

} // namespace terrainseg
