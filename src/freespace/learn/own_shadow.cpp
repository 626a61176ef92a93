// SPDX-License-Identifier: LGPL-2.1-or-later
#include "freespace/learn/own_shadow.hpp"

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstdlib>

#include "base/tuning.hpp"

namespace terrainseg {
namespace {

/// Smallest number of cells that can be split into two kinds.
TERRAINSEG_TUNED(std::size_t, own_shadow, fewest, 32);
/// Percent of the cells. A crate or paint that is brighter than the ground and fills less than two fifths of
/// the window is not lit ground. 25 gives the same results. With 50 the rocks of Mars, whose shadows cover
/// more than half of the window, have 6.0 % error instead of 2.6 %.
TERRAINSEG_TUNED(int, own_shadow, least_lit, 40);
/// Percent of the cells. Lower values change little, but a stone's shadow on the Moon has 10 % (60.1 % of the
/// stones are called ground instead of 59.6 %). The error is nearly constant from 12 to 25.
TERRAINSEG_TUNED(int, own_shadow, least_dark, 12);
/// Smallest ratio of the mean lumas of the lit and the dark kind, in percent, and smallest difference in grey
/// levels. With 130, snow has 5.1 % error instead of 5.4 %, but the stage also affects a drive by day; with
/// 180, Mars has 5.1 %.
TERRAINSEG_TUNED(int, own_shadow, least_ratio, 150);
TERRAINSEG_TUNED(int, own_shadow, least_step, 8);
TERRAINSEG_TUNED(int, own_shadow, most_chroma,
                 12); ///< U and V together, because shade is bluer; with 24 snow has 6.2 % error
/// Percent of the cells in the middle 3/10 between both kinds. A gradient of light across the window, as from
/// a lamp by night, has 15 %: it has no edge and is not a shadow. With 14 a stone's shadow in the window is
/// included, and the Moon has 15.1 % error instead of 14.5 %; with 8 Mars has 5.1 % instead of 2.6 %.
TERRAINSEG_TUNED(int, own_shadow, most_between, 12);

/// Sums over the cells up to a luma.
struct Sum {
  std::int64_t count = 0, luma = 0, u = 0, v = 0, upper = 0; ///< upper: number of cells in the upper half of
                                                             ///< the window
  void add(const Color& color, bool is_upper) {
    ++count;
    luma += color[0];
    u += color[1];
    v += color[2];
    upper += is_upper;
  }
  /// The mean of one of the sums, Q8.
  std::int64_t mean(std::int64_t sum) const { return 256 * sum / count; }
};

/// The threshold of luma that splits a histogram into dark (up to it) and lit: the one with the largest
/// variance between both (N. Otsu, IEEE Trans. SMC 9, 1979).
int parting_luma(const std::array<std::int64_t, 256>& histogram, std::int64_t count, std::int64_t total) {
  std::int64_t dark_count = 0, dark_total = 0, most = -1;
  int parting = 0;
  for (int luma = 0; luma < 255; ++luma) {
    dark_count += histogram[static_cast<std::size_t>(luma)];
    dark_total += luma * histogram[static_cast<std::size_t>(luma)];
    const std::int64_t lit_count = count - dark_count;
    if (dark_count == 0 || lit_count == 0)
      continue;
    const std::int64_t step = 256 * (total - dark_total) / lit_count - 256 * dark_total / dark_count; // Q8
    const std::int64_t between = (step * step >> 8) * dark_count * lit_count;
    if (between > most) {
      most = between;
      parting = luma;
    }
  }
  return parting;
}

} // namespace

bool leave_own_shadow(const Grid& grid, const Rectangle& window, std::span<const Cell> cells,
                      std::vector<Cell>& lit) {
  if (cells.size() < fewest)
    return false;
  lit.reserve(cells.size()); // reserved now, so that the first frame with a shadow does not allocate
  const auto count = static_cast<std::int64_t>(cells.size());
  std::array<std::int64_t, 256> histogram{};
  std::int64_t total = 0;
  for (const Cell& cell : cells) {
    const int luma = grid.color(cell)[0];
    ++histogram[static_cast<std::size_t>(luma)];
    total += luma;
  }
  const int parting = parting_luma(histogram, count, total);
  std::array<Sum, 2> kinds; // dark, lit
  for (const Cell& cell : cells) {
    const Color color = grid.color(cell);
    kinds[color[0] > parting].add(color, cell.y < window.y + window.height / 2);
  }
  const auto& [dark, bright] = kinds;
  if (100 * bright.count < least_lit * count || 100 * dark.count < least_dark * count)
    return false;
  const std::int64_t low = dark.mean(dark.luma), high = bright.mean(bright.luma);
  if (100 * high < least_ratio * low + 100 * 256 * least_step)
    return false;
  if (std::abs(dark.mean(dark.u) - bright.mean(bright.u)) +
          std::abs(dark.mean(dark.v) - bright.mean(bright.v)) >
      256 * most_chroma)
    return false;
  // The dark share of the upper half must not exceed that of the whole window.
  if (dark.upper * count > dark.count * (dark.upper + bright.upper))
    return false;
  const std::int64_t from = low + (high - low) * 35 / 100, to = high - (high - low) * 35 / 100;
  std::int64_t between = 0;
  for (int luma = 0; luma < 256; ++luma)
    if (256 * luma > from && 256 * luma < to)
      between += histogram[static_cast<std::size_t>(luma)];
  if (100 * between > most_between * count)
    return false;
  lit.clear();
  for (const Cell& cell : cells)
    if (grid.color(cell)[0] > parting)
      lit.push_back(cell);
  return true;
}

} // namespace terrainseg
