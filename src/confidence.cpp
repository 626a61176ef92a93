// SPDX-License-Identifier: LGPL-2.1-or-later
#include "confidence.hpp"

#include <algorithm>
#include <cstdlib>

namespace terrainseg {
namespace {

constexpr int full_separation = 80 * 16; ///< Q4: of 96, what the best frames reach
constexpr int half_at_jumps = 200;       ///< percent of the grid's width: rows jumped at which half is left
constexpr int spread_weight = 16;        ///< a sixteenth of the height apart: half is left

std::uint8_t of_separation(std::int64_t separation) {
  return static_cast<std::uint8_t>(std::clamp<std::int64_t>(separation * 255 / full_separation, 0, 255));
}

} // namespace

std::uint8_t mask_confidence(const CoarseGrid& grid, const std::vector<std::int16_t>& score,
                             const std::vector<std::uint16_t>& boundary) {
  std::int64_t below = 0, above = 0, cells_below = 0, jumps = 0;
  for (int i = 0; i < grid.height; ++i) {
    const std::int16_t* row = &score[grid.at(i, 0)];
    std::int32_t sum = 0, sum_below = 0, count_below = 0;
    for (int j = 0; j < grid.width; ++j) {
      const std::int32_t is_below = i >= boundary[static_cast<std::size_t>(j)];
      sum += row[j];
      sum_below += row[j] & -is_below;
      count_below += is_below;
    }
    below += sum_below;
    above += sum - sum_below;
    cells_below += count_below;
  }
  for (int j = 1; j < grid.width; ++j)
    jumps += std::abs(boundary[static_cast<std::size_t>(j)] - boundary[static_cast<std::size_t>(j - 1)]);
  const auto cells_above = static_cast<std::int64_t>(grid.size()) - cells_below;
  if (cells_below == 0 || cells_above == 0)
    return 0;
  const std::int64_t separation = below / cells_below - above / cells_above;
  return of_separation(separation * half_at_jumps / (half_at_jumps + jumps * 100 / grid.width));
}

std::uint8_t horizon_confidence(std::uint8_t mask_confidence, int spread, int frame_height) {
  return static_cast<std::uint8_t>(mask_confidence * frame_height / (frame_height + spread_weight * spread));
}

} // namespace terrainseg
