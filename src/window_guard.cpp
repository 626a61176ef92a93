// SPDX-License-Identifier: LGPL-2.1-or-later
#include "window_guard.hpp"

#include <algorithm>

namespace terrainseg {
namespace {

constexpr int least_gap = 20;     ///< mean score beside the window minus inside it, 32 = 1 nat
constexpr int doubted_below = 16; ///< mean score inside
constexpr int score_limit = 48;
constexpr int patience = 64; ///< frames

} // namespace

bool WindowGuard::refuses(const CellIndices& indices, const EvidenceTables& tables, int grid_width,
                          const Rectangle& window) {
  std::int64_t inside = 0, beside = 0;
  const std::int64_t cells_inside = std::int64_t{window.width} * window.height,
                     cells_beside = std::int64_t{grid_width - window.width} * window.height;
  for (int i = window.y; i < window.y + window.height; ++i)
    for (int j = 0; j < grid_width; ++j) {
      const std::size_t cell = static_cast<std::size_t>(i) * grid_width + j;
      const int score = std::clamp(tables.color[indices.color[cell]] + tables.texture[indices.texture[cell]],
                                   -score_limit, score_limit);
      (j >= window.x && j < window.x + window.width ? inside : beside) += score;
    }
  const bool foreign =
      cells_inside > 0 && cells_beside > 0 && inside < doubted_below * cells_inside &&
      beside * cells_inside - inside * cells_beside > least_gap * cells_inside * cells_beside;
  if (!foreign || held_ >= patience) {
    // After giving in the patience comes back slowly: no flapping between the two.
    held_ = std::max(held_ - 4, 0);
    return false;
  }
  ++held_;
  return true;
}

} // namespace terrainseg
