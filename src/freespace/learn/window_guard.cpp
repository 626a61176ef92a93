// SPDX-License-Identifier: LGPL-2.1-or-later
#include "freespace/learn/window_guard.hpp"

#include <algorithm>

#include "base/tuning.hpp"

namespace terrainseg {
namespace {

/// Thresholds of the mean score beside the window minus that inside, and of the mean score inside, 32 = 1
/// nat. While an obstacle is in the window lower thresholds apply, because a car's smooth flanks look like
/// the road in one frame and unlike it in the next. (A drive at dusk among queueing cars has 25 % unsafe
/// pixels with the second pair and 31 % without it; the result is nearly constant around both values.)
struct Limits {
  int gap, inside;
};
constexpr Limits to_enter{20, 16}, to_stay{8, 24};
TERRAINSEG_TUNED(int, window_guard, score_limit, 48);
TERRAINSEG_TUNED(int, window_guard, patience, 64); ///< frames

} // namespace

bool WindowGuard::refuses(const CellBins& cells, const LikelihoodTables& tables, int grid_width,
                          const Rectangle& window) {
  std::int64_t inside = 0, beside = 0;
  const std::int64_t cells_inside = std::int64_t{window.width} * window.height,
                     cells_beside = std::int64_t{grid_width - window.width} * window.height;
  for (int i = window.y; i < window.y + window.height; ++i)
    for (int j = 0; j < grid_width; ++j) {
      const std::size_t cell = static_cast<std::size_t>(i) * grid_width + j;
      const int score = std::clamp(tables.color[cells.color[cell]] + tables.texture[cells.texture[cell]],
                                   -score_limit, score_limit);
      (j >= window.x && j < window.x + window.width ? inside : beside) += score;
    }
  const Limits& limits = held_ > 0 ? to_stay : to_enter;
  const bool foreign =
      cells_inside > 0 && cells_beside > 0 && inside < limits.inside * cells_inside &&
      beside * cells_inside - inside * cells_beside > limits.gap * cells_inside * cells_beside;
  if (!foreign || held_ >= patience) {
    // After the limit is reached the count decreases slowly, so that the decision does not alternate.
    held_ = std::max(held_ - 4, 0);
    return false;
  }
  ++held_;
  return true;
}

} // namespace terrainseg
