// SPDX-License-Identifier: LGPL-2.1-or-later
#include "freespace/curve/reestimation.hpp"

#include <algorithm>
#include <array>
#include <cstdlib>

#include "base/fixed.hpp"
#include "base/tuning.hpp"
#include "freespace/look/color_bins.hpp"

namespace terrainseg {
namespace {

/// Scale of the counts, so that smoothing loses no precision.
constexpr std::uint32_t one = 64;
/// Pseudo-count added to every bin, and the largest number of bins of colours that get it.
TERRAINSEG_TUNED(std::uint32_t, reestimation, floor, one);
TERRAINSEG_TUNED(std::uint32_t, reestimation, color_floors, 50);
/// Q4 of the score per octave: a quarter of the log ratio of colours, an eighth of that of textures.
TERRAINSEG_TUNED(int, reestimation, color_weight, 89);
TERRAINSEG_TUNED(int, reestimation, texture_weight, 44);
/// Q4, three eighths of a nat. The error is nearly constant from 10/32 to 20/32 nat. One frame's appearance
/// may correct the score, not overrule it.
TERRAINSEG_TUNED(int, reestimation, limit, 192);
/// Reduction of the limit, Q4 per unit of the penalty: two units each.
TERRAINSEG_TUNED(int, reestimation, limit_per_penalty, 32);
TERRAINSEG_TUNED(int, reestimation, upper_end, 10); ///< percent of the columns

int ratio(std::uint32_t ground, std::uint32_t ground_total, std::uint32_t rest, std::uint32_t rest_total,
          int weight) {
  const int octaves_q8 = log2_q8(ground) - log2_q8(ground_total) - log2_q8(rest) + log2_q8(rest_total);
  return std::clamp(octaves_q8 * weight / 256, -limit, limit);
}

std::uint32_t smoothed(const std::array<std::uint32_t, texture_bins>& histogram, int bin) {
  const auto at = [&](int i) { return histogram[std::clamp(i, 0, texture_bins - 1)]; };
  return (at(bin - 1) + 2 * at(bin) + at(bin + 1)) / 4;
}

// Calls f(first bin, number of bins) for each luma.
template <typename F> void for_each_luma(const BinRange& u, F f) {
  for (int first = u.first * chroma_bins; first < color_bins; first += chroma_bins * chroma_bins)
    f(first, u.count() * chroma_bins);
}

} // namespace

bool Reestimation::revise(const Grid& grid, const CellBins& cells, const GridCurve& boundary,
                          const CellPenalties& penalty, const CellScores& score, CellScores& revised) {
  count(grid, cells, boundary);
  if (ground_.cells == 0 || rest_.cells == 0)
    return false;
  compare();
  scratch_.assign(boundary.begin(), boundary.end());
  const std::size_t first = grid.at(percentile(scratch_, upper_end), 0);
  revised.resize(grid.size());
  for (std::size_t i = 0; i < grid.size(); ++i) {
    const bool below = i >= first;
    const int most = below ? std::max(limit - limit_per_penalty * penalty[i], 0) : 0;
    const int says = std::min<int>(color_[cells.color[i]], most) +
                     std::min<int>(texture_[cells.texture[i]], below ? limit : 0);
    revised[i] = static_cast<std::int16_t>(grid.ignored[i] ? score[i] : score[i] + says);
  }
  return true;
}

void Reestimation::count(const Grid& grid, const CellBins& cells, const GridCurve& boundary) {
  u_ = range_of_u(cells.color);
  for (Side* side : {&ground_, &rest_}) {
    for_each_luma(with_neighbours(u_),
                  [&](int first, int count) { std::fill_n(&side->color[first], count, 0u); });
    side->texture.fill(0);
    side->cells = 0;
  }
  for (int row = 0; row < grid.height; ++row)
    for (int column = 0; column < grid.width; ++column) {
      const std::size_t cell = grid.at(row, column);
      if (grid.ignored[cell])
        continue;
      Side& side = row >= boundary[column] ? ground_ : rest_;
      side.color[cells.color[cell]] += one;
      side.texture[cells.texture[cell]] += one;
      ++side.cells;
    }
}

void Reestimation::compare() {
  for (Side* side : {&ground_, &rest_})
    blur_colors(side->color, u_, between_, side->blurred);
  // Blurring keeps the sum of all bins, because `one` is divided without a rest.
  const std::uint32_t ground = one * ground_.cells + color_floors * floor,
                      rest = one * rest_.cells + color_floors * floor;
  for_each_luma(u_, [&](int first, int count) {
    for (int i = first; i < first + count; ++i)
      if (ground_.color[i] + rest_.color[i] > 0) // bins that do not occur are not read
        color_[i] = static_cast<std::int16_t>(
            ratio(ground_.blurred[i] + floor, ground, rest_.blurred[i] + floor, rest, color_weight));
  });
  for (int i = 0; i < texture_bins; ++i)
    texture_[i] = static_cast<std::int16_t>(
        ratio(smoothed(ground_.texture, i) + floor, one * ground_.cells + texture_bins * floor,
              smoothed(rest_.texture, i) + floor, one * rest_.cells + texture_bins * floor, texture_weight));
}

namespace {

constexpr int unseen = 255; ///< no ground is beside the cell
TERRAINSEG_TUNED(int, ground_behind, free_below,
                 14); ///< distance from the neighbouring ground without a penalty
TERRAINSEG_TUNED(int, ground_behind, follow_below, 24); ///< distance within which it is the same surface
TERRAINSEG_TUNED(int, ground_behind, margin,
                 8); ///< a quarter of a nat, because dark roofs and bonnets score slightly above 0
TERRAINSEG_TUNED(int, ground_behind, least_sum,
                 64); ///< 2 nats; half of it gives 0.05 points more flicker at 15 Hz
/// Rows by which what joins a stretch from the side may miss it: the boundary is smooth, so it ends lower
/// beside an obstacle than the ground does. Rendered corridors have 2.8 % error with 0 and 1, 3.1 with 2.
TERRAINSEG_TUNED(int, ground_behind, most_apart, 1);

} // namespace

void GroundBehindSearch::find(const Grid& grid, const CellScores& score, const GridCurve& boundary,
                              int gain_q8, GroundBehind& behind) {
  const int width = grid.width;
  behind.first.assign(width, 0);
  behind.end.assign(width, 0);
  open_.resize(boundary.size());
  behind.any = false;
  const auto [top, bottom] = std::minmax_element(boundary.begin(), boundary.end());
  const int first_row = *top;
  compare_sideways(grid, boundary, first_row, *bottom, gain_q8);
  for (int j = 0; j < width; ++j) {
    // Find the stretch with the largest sum.
    int sum = 0, start = 0, greatest = 16 * least_sum;
    std::uint16_t &first = behind.first[j], &end = behind.end[j];
    // The obstacle itself takes at least one row.
    for (int i = first_row; i < boundary[j] - 1; ++i) {
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
    behind.any |= end > 0;
  }
  if (behind.any)
    drop_closed(boundary, behind);
}

// The front of a cabinet of the ground's colour, above its dark foot, is not ground.
void GroundBehindSearch::drop_closed(const GridCurve& boundary, GroundBehind& behind) {
  const int width = static_cast<int>(boundary.size());
  const auto open_beside = [&](int j, int beside) {
    return beside >= 0 && beside < width && boundary[beside] <= behind.end[j] + most_apart;
  };
  const auto join = [&](int j, int beside) {
    if (behind.end[j] > 0 && open_[beside] && behind.first[beside] <= behind.end[j] + most_apart &&
        behind.first[j] <= behind.end[beside] + most_apart)
      open_[j] = 1;
  };
  for (int j = 0; j < width; ++j)
    open_[j] = behind.end[j] > 0 && (open_beside(j, j - 1) || open_beside(j, j + 1));
  for (int j = 1; j < width; ++j)
    join(j, j - 1);
  for (int j = width - 2; j >= 0; --j)
    join(j, j + 1);
  behind.any = false;
  for (int j = 0; j < width; ++j)
    if (open_[j])
      behind.any = true;
    else
      behind.first[j] = behind.end[j] = 0;
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
        if (i >= boundary[j]) {
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
          penalty = std::clamp((e - free_below) >> 1, 0, unseen - 1);
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
