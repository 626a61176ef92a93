// SPDX-License-Identifier: LGPL-2.1-or-later
#include "freespace/score/local_reference.hpp"

#include "base/tuning.hpp"
#include "kernels/cells.hpp"

namespace terrainseg {
namespace {

TERRAINSEG_TUNED(int, local_reference, follow_below,
                 48); ///< distance within which it is the same surface in another light
TERRAINSEG_TUNED(int, local_reference, free_below, 34); ///< distance without a penalty
TERRAINSEG_TUNED(int, local_reference, most, 36);

} // namespace

std::array<int, 3> mean_color(const Grid& grid, std::span<const Cell> cells) {
  std::array<std::int64_t, 3> sum{};
  for (const Cell& cell : cells) {
    const Color color = grid.color(cell);
    for (int c = 0; c < 3; ++c)
      sum[c] += color[c];
  }
  std::array<int, 3> color{};
  for (int c = 0; c < 3; ++c)
    color[c] = static_cast<int>(16 * sum[c] / static_cast<std::int64_t>(cells.size()));
  return color;
}

void LocalReference::climb(const Grid& grid, const std::array<int, 3>& start, int gain,
                           CellPenalties& penalty) {
  const int width = grid.width;
  penalty.resize(grid.size());
  for (int c = 0; c < 3; ++c) {
    reference_[c].assign(width, start[c]);
    smooth_[c].resize(width);
  }
  const kernels::FollowRule rule{gain, free_below, most, follow_below};
  for (int i = grid.height - 1; i >= 0; --i) {
    const std::size_t row = grid.at(i, 0);
    kernels::follow_row(grid.row(i), &grid.ignored[row], rule,
                        {reference_[0].data(), reference_[1].data(), reference_[2].data()}, width,
                        &penalty[row]);
    for (int c = 0; c < 3; ++c) {
      kernels::smooth_row(reference_[c].data(), width, smooth_[c].data());
      reference_[c].swap(smooth_[c]);
    }
  }
}

} // namespace terrainseg
