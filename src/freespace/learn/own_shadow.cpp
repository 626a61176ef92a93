// SPDX-License-Identifier: LGPL-2.1-or-later
#include "freespace/learn/own_shadow.hpp"

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstdlib>

#include "base/tuning.hpp"

namespace terrainseg {
namespace {

/// Fewer cells have no two kinds.
TERRAINSEG_TUNED(std::size_t, own_shadow, fewest, 32);
/// Percent of the cells. A crate or paint that is brighter than the ground and fills less than two fifths of
/// the window is no lit ground. With 25 what is measured is the same, with 50 the rocks of Mars whose shadows
/// cover more than half of the window are 6.0 % wrong in place of 2.6.
TERRAINSEG_TUNED(int, own_shadow, least_lit, 40);
/// Percent: less changes little, but a stone's shadow on the Moon has 10 (60.1 % of the stones are called
/// ground in place of 59.6). Flat from 12 to 25.
TERRAINSEG_TUNED(int, own_shadow, least_dark, 12);
/// The lit kind's mean luma is at least this many percent of the dark one's, and so many levels. With 130
/// snow is 5.1 % wrong in place of 5.4, but a drive by day takes part too; with 180 Mars is 5.1.
TERRAINSEG_TUNED(int, own_shadow, least_ratio, 150);
TERRAINSEG_TUNED(int, own_shadow, least_step, 8);
TERRAINSEG_TUNED(int, own_shadow, most_chroma,
                 12); ///< U and V together: shade is bluer; with 24 snow is 6.2 % wrong
/// Percent of the cells in the middle 3/10 between both. A slope of light across the window has 15, as a lamp
/// by night makes it: no edge, no shadow. With 14 a stone's shadow in the window takes part and the Moon
/// is 15.1 % wrong in place of 14.5, with 8 Mars is 5.1 in place of 2.6.
TERRAINSEG_TUNED(int, own_shadow, most_between, 12);

/// Of cells up to a luma.
struct Sum {
  std::int64_t count = 0, luma = 0, u = 0, v = 0, upper = 0; ///< upper: how many in the window's upper half
  void add(const Color& color, bool is_upper) {
    ++count;
    luma += color[0];
    u += color[1];
    v += color[2];
    upper += is_upper;
  }
  /// Of one of the sums, Q8.
  std::int64_t mean(std::int64_t sum) const { return 256 * sum / count; }
};

/// The luma that parts a histogram best: up to it dark, above it lit (Otsu 1979: the greatest variance
/// between both).
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
  lit.reserve(cells.size()); // however late there is a shadow: later frames need no memory
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
  // Of the upper half no more is dark than of all.
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
