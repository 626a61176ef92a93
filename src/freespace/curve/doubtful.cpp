// SPDX-License-Identifier: LGPL-2.1-or-later
#include "freespace/curve/doubtful.hpp"

#include <algorithm>

namespace terrainseg {

void walk_doubtful(const Grid& grid, const CellScores& score, int limit, const GridCurve& boundary,
                   GridCurve& safe) {
  safe.assign(boundary.begin(), boundary.end());
  if (limit <= doubtful_off)
    return;
  const auto across = [&](int row, int j) { // 1-2-1 over the columns
    const std::int16_t* s = &score[grid.at(std::clamp(row, 0, grid.height - 1), 0)];
    return s[std::max(j - 1, 0)] + 2 * s[j] + s[std::min(j + 1, grid.width - 1)];
  };
  for (int j = 0; j < grid.width; ++j) {
    int row = boundary[static_cast<std::size_t>(j)];
    while (row < grid.height &&
           across(row - 1, j) + 2 * across(row, j) + across(row + 1, j) < limit * 16 * 16)
      ++row;
    safe[static_cast<std::size_t>(j)] = static_cast<std::uint16_t>(row);
  }
}

} // namespace terrainseg
