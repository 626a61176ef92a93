// SPDX-License-Identifier: LGPL-2.1-or-later
#include "freespace/holes/small_things.hpp"

#include <algorithm>

#include "base/lattice.hpp"
#include "terrainseg/estimate.hpp"

namespace terrainseg {
namespace {

// Traversable pixels; returns how many there were.
int make_row_doubtful(std::uint8_t* pixels, int count) {
  int turned = 0;
  for (int x = 0; x < count; ++x) {
    const bool traversable = pixels[x] == mask_traversable;
    turned += traversable;
    pixels[x] = traversable ? mask_doubtful : pixels[x];
  }
  return turned;
}

} // namespace

void lower_below(const CellStretch& s, int mask_level, FrameCurve& rows) {
  const int k = s.level, half = 1 << k >> 1, columns = static_cast<int>(rows.size());
  const auto row = static_cast<std::uint16_t>((s.row << k) - half + (1 << k));
  const int left = subsampled(std::max((s.from << k) - half, 0), mask_level),
            right = std::min(subsampled((s.to << k) - half, mask_level), columns);
  for (int x = left; x < right; ++x)
    rows[static_cast<std::size_t>(x)] = std::max(rows[static_cast<std::size_t>(x)], row);
}

std::uint64_t make_doubtful(const CellStretch& s, const MutablePlane& mask, int width, int height,
                            int mask_level) {
  const int half = 1 << s.level >> 1;
  const auto first = [&](int cell) { return subsampled(std::max((cell << s.level) - half, 0), mask_level); };
  const int left = first(s.from), count = std::max(std::min(first(s.to), width) - left, 0);
  std::uint64_t turned = 0;
  for (int y = first(s.row), bottom = std::min(first(s.row + 1), height); y < bottom; ++y)
    turned += static_cast<std::uint64_t>(make_row_doubtful(mask.row(y) + left, count));
  return turned;
}

} // namespace terrainseg
