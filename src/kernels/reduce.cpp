// SPDX-License-Identifier: LGPL-2.1-or-later
#include "kernels/reduce.hpp"

#include <array>

namespace terrainseg::kernels {
namespace {

// Mirrors an index without repeating the edge, as often as a very short axis needs.
int reflect_101(int i, int size) {
  if (size == 1)
    return 0;
  while (i < 0 || i >= size)
    i = i < 0 ? -i : 2 * size - 2 - i;
  return i;
}

std::array<const std::uint8_t*, 5> taps(const Plane& source, int height, int y) {
  std::array<const std::uint8_t*, 5> rows;
  for (int k = 0; k < 5; ++k)
    rows[k] = source.row(reflect_101(2 * y + k - 2, height));
  return rows;
}

template <typename Row> int tap_sum(const Row& at) {
  return at(0) + at(4) + 4 * (at(1) + at(3)) + 6 * at(2);
}

} // namespace

void reduce(const Plane& source, int width, int height, const MutablePlane& target, std::uint16_t* columns) {
  const int half = (width + 1) / 2;
  for (int y = 0; y < (height + 1) / 2; ++y) {
    const auto rows = taps(source, height, y);
    for (int x = 0; x < width; ++x)
      columns[x] = static_cast<std::uint16_t>(tap_sum([&](int k) { return int{rows[k][x]}; }));
    std::uint8_t* out = target.row(y);
    for (int x = 0; x < half; ++x) {
      const bool inside = x > 0 && 2 * x + 2 < width;
      const int sum = inside
                          ? tap_sum([&](int k) { return int{columns[2 * x + k - 2]}; })
                          : tap_sum([&](int k) { return int{columns[reflect_101(2 * x + k - 2, width)]}; });
      out[x] = static_cast<std::uint8_t>((sum + 128) >> 8);
    }
  }
}

void reduce_rows(const Plane& source, int width, int height, const MutablePlane& target) {
  for (int y = 0; y < (height + 1) / 2; ++y) {
    const auto rows = taps(source, height, y);
    std::uint8_t* out = target.row(y);
    for (int x = 0; x < width; ++x)
      out[x] = static_cast<std::uint8_t>((tap_sum([&](int k) { return int{rows[k][x]}; }) + 8) >> 4);
  }
}

} // namespace terrainseg::kernels
