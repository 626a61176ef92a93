// SPDX-License-Identifier: LGPL-2.1-or-later
#include "freespace/answer/confidence.hpp"

#include <algorithm>
#include <cstdlib>

#include "base/tuning.hpp"

namespace terrainseg {
namespace {

/// Rows on each side of the boundary whose scores measure how certain its position is, their limit (Q4), and
/// their weight. On rendered scenes the rank correlation with the error is -0.38 with them and -0.19 without.
TERRAINSEG_TUNED(int, confidence, near_rows, 3);
TERRAINSEG_TUNED(int, confidence, near_limit, 24 * 16);
TERRAINSEG_TUNED(int, confidence, near_weight, 3);
TERRAINSEG_TUNED(int, confidence, full_separation, 130 * 16); ///< Q4; the best frames reach 168
TERRAINSEG_TUNED(int, confidence, half_at_jumps,
                 200); ///< percent of the grid's width: sum of the jumps in rows that halves the confidence
TERRAINSEG_TUNED(int, confidence, spread_weight, 16); ///< a spread of 1/16 of the height halves the
                                                      ///< confidence

std::uint8_t of_separation(std::int64_t separation) {
  return static_cast<std::uint8_t>(std::clamp<std::int64_t>(separation * 255 / full_separation, 0, 255));
}

} // namespace

std::uint8_t mask_confidence(const Grid& grid, const CellScores& score, const GridCurve& boundary,
                             const GroundBehind& behind) {
  std::int64_t ground = 0, other = 0, cells_ground = 0, near = 0, cells_near = 0, jumps = 0;
  for (int i = 0; i < grid.height; ++i)
    for (int j = 0; j < grid.width; ++j) {
      const auto x = static_cast<std::size_t>(j);
      const bool is_ground = i >= boundary[x] || (behind.any && i >= behind.first[x] && i < behind.end[x]);
      const int s = score[grid.at(i, j)];
      (is_ground ? ground : other) += s;
      cells_ground += is_ground;
      if (i >= boundary[x] - near_rows && i < boundary[x] + near_rows) {
        near += std::clamp(is_ground ? s : -s, -near_limit, near_limit);
        ++cells_near;
      }
    }
  for (int j = 1; j < grid.width; ++j)
    jumps += std::abs(boundary[static_cast<std::size_t>(j)] - boundary[static_cast<std::size_t>(j - 1)]);
  const auto cells_other = static_cast<std::int64_t>(grid.size()) - cells_ground;
  if (cells_ground == 0 || cells_other == 0)
    return 0;
  const std::int64_t separation = ground / cells_ground - other / cells_other +
                                  near_weight * near / std::max<std::int64_t>(cells_near, 1);
  return of_separation(separation * half_at_jumps / (half_at_jumps + jumps * 100 / grid.width));
}

std::uint8_t horizon_confidence(std::uint8_t mask_confidence, int spread, int frame_height) {
  return static_cast<std::uint8_t>(mask_confidence * frame_height / (frame_height + spread_weight * spread));
}

} // namespace terrainseg
