// SPDX-License-Identifier: LGPL-2.1-or-later
#include "coarse/ignored.hpp"

#include <algorithm>

#include "base/lattice.hpp"
#include "terrainseg/estimate.hpp"

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

} // namespace terrainseg
