// SPDX-License-Identifier: LGPL-2.1-or-later
#include "coarse/grid.hpp"

#include <algorithm>

#include "terrainseg/settings.hpp"

namespace terrainseg {

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
