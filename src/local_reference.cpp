// SPDX-License-Identifier: LGPL-2.1-or-later
#include "local_reference.hpp"

#include "kernels/cells.hpp"

namespace terrainseg {
namespace {

constexpr int follow_below = 48; ///< distance that is still the same surface in another light
constexpr int free_below = 34;   ///< distance without a penalty
constexpr int most = 36;

} // namespace

void LocalReference::climb(const CoarseGrid& grid, const std::array<int, 3>& start, int gain,
                           std::vector<std::int8_t>& penalty) {
  const int width = grid.width;
  penalty.resize(grid.size());
  for (int c = 0; c < 3; ++c) {
    reference_[c].assign(width, start[c]);
    smooth_[c].resize(width);
  }
  const kernels::FollowRule rule{gain, free_below, most, follow_below};
  for (int i = grid.height - 1; i >= 0; --i) {
    const std::size_t row = grid.at(i, 0);
    kernels::follow_row(components_at(grid, row), &grid.ignored[row], rule,
                        {reference_[0].data(), reference_[1].data(), reference_[2].data()}, width,
                        &penalty[row]);
    for (int c = 0; c < 3; ++c) {
      kernels::smooth_row(reference_[c].data(), width, smooth_[c].data());
      reference_[c].swap(smooth_[c]);
    }
  }
}

} // namespace terrainseg
