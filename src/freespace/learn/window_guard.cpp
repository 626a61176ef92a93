// SPDX-License-Identifier: LGPL-2.1-or-later
#include "freespace/learn/window_guard.hpp"

#include <algorithm>
#include <array>
#include <cstdlib>

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
/// The same for a third of the window's columns.
constexpr int parts = 3;
constexpr Limits of_a_third{48, 0};
TERRAINSEG_TUNED(int, window_guard, score_limit, 48);
TERRAINSEG_TUNED(int, window_guard, patience, 64); ///< frames

} // namespace

bool WindowGuard::refuses(const CellBins& cells, const LikelihoodTables& tables, int grid_width,
                          const Rectangle& window) {
  // A thing may fill a third of the window only: each third is compared too.
  struct Scores {
    std::int64_t sum = 0, cells = 0;
    void add(std::int64_t score, std::int64_t count = 1) {
      sum += score;
      cells += count;
    }
  };
  std::array<Scores, parts> thirds;
  Scores beside;
  for (int i = window.y; i < window.y + window.height; ++i)
    for (int j = 0; j < grid_width; ++j) {
      const std::size_t cell = static_cast<std::size_t>(i) * grid_width + j;
      const bool in_window = j >= window.x && j < window.x + window.width;
      (in_window ? thirds[static_cast<std::size_t>((j - window.x) * parts / window.width)] : beside)
          .add(std::clamp(tables.color[cells.color[cell]] + tables.texture[cells.texture[cell]], -score_limit,
                          score_limit));
    }
  const auto differs = [&beside](const Scores& inside, const Limits& limits) {
    return inside.cells > 0 && beside.cells > 0 && inside.sum < limits.inside * inside.cells &&
           beside.sum * inside.cells - inside.sum * beside.cells > limits.gap * inside.cells * beside.cells;
  };
  Scores whole;
  for (const Scores& third : thirds)
    whole.add(third.sum, third.cells);
  const bool foreign = differs(whole, held_ > 0 ? to_stay : to_enter) ||
                       std::any_of(thirds.begin(), thirds.end(),
                                   [&](const Scores& third) { return differs(third, of_a_third); });
  if (!foreign || held_ >= patience) {
    // After the limit is reached the count decreases slowly, so that the decision does not alternate.
    held_ = std::max(held_ - 4, 0);
    return false;
  }
  ++held_;
  return true;
}

namespace {

/// Grey levels between a cell and its neighbours to the right and below from which it has contrast. Such a
/// cell has changed when it differs from the earlier frame by a quarter of its contrast.
TERRAINSEG_TUNED(int, still_window, least_contrast, 6);
/// Inverse of the largest share of the window's cells with contrast that have changed while it is still.
TERRAINSEG_TUNED(int, still_window, most_changed, 8);
/// Changes of the picture above the window until the window is still, and the largest count.
TERRAINSEG_TUNED(int, still_window, enough, 8);
TERRAINSEG_TUNED(int, still_window, most, 16);

/// Cells with contrast, and those of them that have changed.
struct Changes {
  int all = 0, changed = 0;
  void add(const Grid& grid, const std::uint8_t* before, int row, int column) {
    const std::uint8_t *const here = grid.planes[0].row(row) + column, *const below =
                                                                           grid.planes[0].row(row + 1) +
                                                                           column;
    const int contrast = std::abs(here[0] - here[1]) + std::abs(here[0] - below[0]);
    const bool counts = contrast >= least_contrast && grid.ignored[grid.at(row, column)] == 0;
    all += counts;
    changed += counts && 4 * std::abs(here[0] - before[grid.at(row, column)]) >= contrast;
  }
};

} // namespace

bool StillWindow::look(const Grid& grid, const Rectangle& window) {
  const auto keep = [&] {
    before_.resize(grid.size());
    for (int i = 0; i < grid.height; ++i)
      std::copy_n(grid.planes[0].row(i), grid.width, &before_[grid.at(i, 0)]);
  };
  if (before_.size() != grid.size()) {
    changes_ = 0;
    keep();
    return false;
  }
  Changes above;
  for (int i = 0; i < std::min(window.y, grid.height - 1); ++i)
    for (int j = 0; j + 1 < grid.width; ++j)
      above.add(grid, before_.data(), i, j);
  if (above.all == 0 || 5 * above.changed < 3 * above.all)
    return changes_ >= enough; // the picture has not changed enough to compare the window
  Changes inside;
  int columns = 0; // with contrast
  const int bottom = std::min(window.y + window.height, grid.height - 1),
            right = std::min(window.x + window.width, grid.width - 1);
  for (int j = window.x; j < right; ++j) {
    const int counted = inside.all;
    for (int i = window.y; i < bottom; ++i)
      inside.add(grid, before_.data(), i, j);
    columns += inside.all > counted;
  }
  const bool still = 2 * columns >= window.width && most_changed * inside.changed <= inside.all;
  changes_ = still ? std::min(changes_ + 1, most) : std::max(changes_ - 4, 0);
  keep();
  return changes_ >= enough;
}

} // namespace terrainseg
