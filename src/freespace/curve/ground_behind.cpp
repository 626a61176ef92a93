// SPDX-License-Identifier: LGPL-2.1-or-later
#include "freespace/curve/ground_behind.hpp"

#include <algorithm>
#include <array>
#include <cstdlib>

#include "base/tuning.hpp"

namespace terrainseg {
namespace {

TERRAINSEG_TUNED(int, ground_behind, unseen, 255);
TERRAINSEG_TUNED(int, ground_behind, free_below,
                 14); ///< distance from the neighbouring ground without a penalty
TERRAINSEG_TUNED(int, ground_behind, follow_below, 24); ///< distance within which it is the same surface
TERRAINSEG_TUNED(int, ground_behind, most, 60);

TERRAINSEG_TUNED(int, ground_behind, margin,
                 8); ///< a quarter of a nat, because dark roofs and bonnets score slightly above 0
TERRAINSEG_TUNED(int, ground_behind, least_sum,
                 64); ///< 2 nats; half of it gives 0.05 points more flicker at 15 Hz
TERRAINSEG_TUNED(int, ground_behind, least_rows, 2);

} // namespace

void GroundBehindSearch::find(const Grid& grid, const CellScores& score, const GridCurve& boundary,
                              int gain_q8, GroundBehind& behind) {
  const int width = grid.width;
  behind.first.assign(static_cast<std::size_t>(width), 0);
  behind.end.assign(static_cast<std::size_t>(width), 0);
  behind.any = false;
  const auto [top, bottom] = std::minmax_element(boundary.begin(), boundary.end());
  const int first_row = *top;
  if (*bottom - first_row < least_rows)
    return;
  compare_sideways(grid, boundary, first_row, *bottom, gain_q8);
  for (int j = 0; j < width; ++j) {
    // Find the stretch with the largest sum.
    int sum = 0, start = 0, greatest = 16 * least_sum;
    std::uint16_t &first = behind.first[static_cast<std::size_t>(j)],
                  &end = behind.end[static_cast<std::size_t>(j)];
    // The obstacle itself takes at least one row.
    for (int i = first_row; i < boundary[static_cast<std::size_t>(j)] - 1; ++i) {
      const int penalty = penalty_[grid.at(i, j)];
      if (sum <= 0 || penalty == unseen) {
        sum = 0;
        start = penalty == unseen ? i + 1 : i;
      }
      if (penalty == unseen)
        continue;
      const std::int16_t* s = &score[grid.at(i, 0)];
      const int mean = (s[std::max(j - 1, 0)] + 2 * s[j] + s[std::min(j + 1, width - 1)]) >> 2;
      sum += mean - 16 * (margin + penalty);
      if (sum > greatest) {
        greatest = sum;
        first = static_cast<std::uint16_t>(start);
        end = static_cast<std::uint16_t>(i + 1);
      }
    }
    if (end - first < least_rows)
      first = end = 0;
    behind.any |= end > 0;
  }
}

// Carries the ground's colour along each row from both sides, across the cells above the boundary.
void GroundBehindSearch::compare_sideways(const Grid& grid, const GridCurve& boundary, int first_row,
                                          int end_row, int gain_q8) {
  penalty_.resize(grid.size());
  for (int i = first_row; i < end_row; ++i)
    for (const bool rightwards : {true, false}) {
      const auto colors = grid.row(i);
      std::array<int, 3> reference{};
      bool seen = false;
      for (int k = 0; k < grid.width; ++k) {
        const int j = rightwards ? k : grid.width - 1 - k;
        const std::size_t cell = grid.at(i, j);
        const std::array<int, 3> color{16 * colors[0][j], 16 * colors[1][j], 16 * colors[2][j]};
        if (i >= boundary[static_cast<std::size_t>(j)]) {
          if (!grid.ignored[cell]) {
            reference = color;
            seen = true;
          }
          continue;
        }
        int penalty = unseen;
        if (seen) {
          std::array<int, 3> d{};
          for (int c = 0; c < 3; ++c)
            d[c] = color[c] - reference[c];
          const int e = ((std::abs(d[0]) + 2 * (std::abs(d[1]) + std::abs(d[2]))) * gain_q8) >> 12;
          penalty = std::clamp((e - free_below) >> 1, 0, most);
          if (e < follow_below)
            for (int c = 0; c < 3; ++c)
              reference[c] += d[c] >> 2;
        }
        const int other = rightwards ? unseen : penalty_[cell];
        penalty_[cell] = static_cast<std::uint8_t>(std::min(penalty, other));
      }
    }
}

} // namespace terrainseg
