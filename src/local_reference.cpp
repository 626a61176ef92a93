// SPDX-License-Identifier: LGPL-2.1-or-later
#include "local_reference.hpp"

#include <algorithm>
#include <cstdlib>

namespace terrainseg {
namespace {

constexpr int follow_below = 48; ///< distance that is still the same surface in another light
constexpr int free_below = 28;   ///< distance without a penalty
constexpr int most = 44;

} // namespace

void LocalReference::climb(const CoarseGrid& grid, const std::array<int, 3>& start, int gain,
                           std::vector<std::int8_t>& penalty) {
  const int width = grid.width;
  penalty.resize(grid.size());
  for (int c = 0; c < 3; ++c) {
    reference_[c].assign(width, start[c]);
    smooth_[c].resize(width);
  }
  const std::array<const std::uint8_t*, 3> planes{grid.y.data(), grid.u.data(), grid.v.data()};
  for (int i = grid.height - 1; i >= 0; --i) {
    const std::size_t row = static_cast<std::size_t>(i) * width;
    for (int j = 0; j < width; ++j) {
      const std::size_t at = row + j;
      const int dy = 16 * planes[0][at] - reference_[0][j], du = 16 * planes[1][at] - reference_[1][j],
                dv = 16 * planes[2][at] - reference_[2][j];
      const int e = ((std::abs(dy) + 2 * (std::abs(du) + std::abs(dv))) * gain) >> 12;
      penalty[at] = static_cast<std::int8_t>(std::clamp((e - free_below) >> 1, 0, most));
      if (e < follow_below && !grid.ignored[at]) {
        reference_[0][j] += dy >> 2;
        reference_[1][j] += du >> 2;
        reference_[2][j] += dv >> 2;
      }
    }
    for (int c = 0; c < 3; ++c) {
      const std::vector<int>& r = reference_[c];
      for (int j = 0; j < width; ++j)
        smooth_[c][j] = (r[std::max(j - 1, 0)] + 2 * r[j] + r[std::min(j + 1, width - 1)]) >> 2;
      reference_[c].swap(smooth_[c]);
    }
  }
}

} // namespace terrainseg
