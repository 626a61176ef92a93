// SPDX-License-Identifier: LGPL-2.1-or-later
#include "coarse/horizon.hpp"

#include <algorithm>
#include <limits>

namespace terrainseg {
namespace {

int ground_cells_in_row(const Grid& grid, const Gaussian& ground, int row) {
  int count = 0;
  for (int x = 0; x < grid.width; ++x)
    count +=
        looks_like_ground(grid.color({static_cast<std::int16_t>(x), static_cast<std::int16_t>(row)}), ground);
  return count;
}

} // namespace

bool looks_like_ground(const Color& color, const Gaussian& ground) {
  for (int c = 0; c < 3; ++c) {
    const std::int64_t d = (std::int64_t{color[c]} << 8) - ground.mean[c];
    if (d * d > std::int64_t{4} * ground.variance[c] << 8)
      return false;
  }
  return true;
}

// Often several rows have no ground cell. The first of them (the literal reading) differs from the true
// horizon by 51 % of the height, the lowest one by 26 % (701 labelled frames). Therefore the lowest one is
// taken.
//
// The paper has no condition for "u_h gets assigned to null". Here there is no horizon when no row has less
// than half of the other rows' mean, or when a row of the window has as few.
Horizon find_horizon(const Grid& grid, const Gaussian& ground, int window_top, int window_end) {
  int poorest = -1, least = std::numeric_limits<int>::max(), least_in_window = least;
  std::int64_t total = 0;
  for (int row = 0; row < window_end; ++row) {
    const int count = ground_cells_in_row(grid, ground, row);
    total += count;
    if (row >= window_top)
      least_in_window = std::min(least_in_window, count);
    else if (count <= least) {
      least = count;
      poorest = row;
    }
  }
  if (poorest < 0 || least_in_window <= least)
    return {};
  const std::int64_t others = window_end - 1, rest = total - least; // others * average = rest
  if (2 * least * others >= rest)
    return {};
  // NOLINTNEXTLINE(clang-analyzer-core.DivideZero): here `rest` is greater than 0
  return {poorest, static_cast<std::uint8_t>(255 - 255 * least * others / rest)};
}

} // namespace terrainseg
