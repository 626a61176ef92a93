// SPDX-License-Identifier: LGPL-2.1-or-later
#include "freespace/curve/reestimation.hpp"

#include <algorithm>
#include <numeric>

#include "base/fixed_log.hpp"
#include "base/percentile.hpp"
#include "base/tuning.hpp"
#include "freespace/look/color_bins.hpp"

namespace terrainseg {
namespace {

/// Scale of the counts, so that smoothing loses no precision.
TERRAINSEG_TUNED(std::uint32_t, reestimation, one, 64);
TERRAINSEG_TUNED(std::uint32_t, reestimation, least_cells, 50);
/// Pseudo-count added to every bin, and the largest number of bins that get it.
TERRAINSEG_TUNED(std::uint32_t, reestimation, color_floor, one);
TERRAINSEG_TUNED(std::uint32_t, reestimation, color_floors, 50);
TERRAINSEG_TUNED(std::uint32_t, reestimation, texture_floor, 2 * one);
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
  const auto at = [&](int i) {
    return histogram[static_cast<std::size_t>(std::clamp(i, 0, texture_bins - 1))];
  };
  return (at(bin - 1) + 2 * at(bin) + at(bin + 1)) / 4;
}

template <std::size_t size> std::uint32_t total_of(const std::array<std::uint32_t, size>& histogram) {
  return std::accumulate(histogram.begin(), histogram.end(), std::uint32_t{0});
}

} // namespace

bool Reestimation::revise(const Grid& grid, const CellBins& cells, const GridCurve& boundary,
                          const CellPenalties& penalty, const CellScores& score, CellScores& revised) {
  count(grid, cells, boundary);
  if (ground_.cells < least_cells || rest_.cells < least_cells)
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
  for (Side* side : {&ground_, &rest_}) {
    side->color.fill(0);
    side->texture.fill(0);
    side->cells = 0;
  }
  for (int row = 0; row < grid.height; ++row)
    for (int column = 0; column < grid.width; ++column) {
      const std::size_t cell = grid.at(row, column);
      if (grid.ignored[cell])
        continue;
      Side& side = row >= boundary[static_cast<std::size_t>(column)] ? ground_ : rest_;
      side.color[cells.color[cell]] += one;
      side.texture[cells.texture[cell]] += one;
      ++side.cells;
    }
}

void Reestimation::compare() {
  for (Side* side : {&ground_, &rest_})
    blur_colors(side->color, between_, side->blurred);
  const std::uint32_t ground = total_of(ground_.blurred) + color_floors * color_floor,
                      rest = total_of(rest_.blurred) + color_floors * color_floor;
  for (std::size_t i = 0; i < color_.size(); ++i)
    if (ground_.color[i] + rest_.color[i] > 0) // bins that do not occur are not read
      color_[i] = static_cast<std::int16_t>(ratio(ground_.blurred[i] + color_floor, ground,
                                                  rest_.blurred[i] + color_floor, rest, color_weight));
  for (int i = 0; i < texture_bins; ++i)
    texture_[static_cast<std::size_t>(i)] = static_cast<std::int16_t>(
        ratio(smoothed(ground_.texture, i) + texture_floor,
              one * ground_.cells + texture_bins * texture_floor, smoothed(rest_.texture, i) + texture_floor,
              one * rest_.cells + texture_bins * texture_floor, texture_weight));
}

} // namespace terrainseg
