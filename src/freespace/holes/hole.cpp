// SPDX-License-Identifier: LGPL-2.1-or-later
#include "freespace/holes/hole.hpp"

#include <algorithm>

#include "base/lattice.hpp"

namespace terrainseg {
namespace {

// Labels traversable pixels. Returns their number. Auto-vectorised.
unsigned label_row(std::uint8_t* pixels, int count, std::uint8_t label) {
  unsigned turned = 0;
  for (int x = 0; x < count; ++x) {
    const bool traversable = pixels[x] == mask_traversable;
    turned += traversable;
    pixels[x] = traversable ? label : pixels[x];
  }
  return turned;
}

} // namespace

Hole hole_of_cells(int level, int row, int from, int to) {
  const int half = 1 << level >> 1;
  const auto edge = [&](int cell) { return static_cast<std::uint16_t>(std::max((cell << level) - half, 0)); };
  return {edge(from), edge(row), edge(to), edge(row + 1), edge(row + 1)};
}

void lower_below(const Detection& found, int mask_level, FrameCurve& rows) {
  for (const Hole& hole : found.holes) {
    const int right = std::min(subsampled(hole.right, mask_level), static_cast<int>(rows.size()));
    for (int x = subsampled(hole.left, mask_level); x < right; ++x)
      rows[static_cast<std::size_t>(x)] = std::max(rows[static_cast<std::size_t>(x)], hole.free_from);
  }
}

std::uint64_t mark(const Detection& found, const MutablePlane& mask, int width, int height, int mask_level) {
  std::uint64_t turned = 0;
  for (const Hole& hole : found.holes) {
    const int left = subsampled(hole.left, mask_level),
              count = std::max(std::min(subsampled(hole.right, mask_level), width) - left, 0),
              bottom = std::min(subsampled(hole.bottom, mask_level), height);
    for (int y = subsampled(hole.top, mask_level); y < bottom; ++y)
      turned += label_row(mask.row(y) + left, count, found.label);
  }
  return turned;
}

} // namespace terrainseg
