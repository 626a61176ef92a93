// SPDX-License-Identifier: LGPL-2.1-or-later
#include "freespace/score/temporal.hpp"

#include <cstdlib>
#include <numeric>

#include "base/tuning.hpp"

namespace terrainseg {
namespace {

TERRAINSEG_TUNED(std::int64_t, temporal, longest_gap,
                 2'000'000'000); ///< largest interval; after it the scores are outdated even if the pictures
                                 ///< are similar
/// Largest difference for averaging, as the inverse of a share of the variation. The decision uses the
/// picture instead of the clock: averaging over the jumps of a 1 Hz sequence costs 0.8 to 6 points of error,
/// over two similar pictures a second apart nothing. Frames of one motion differ by less than a fifth of the
/// picture's own variation: a drive in town at 15 Hz by 0.07 to 0.2, pictures a second apart by 0.3 and more.
TERRAINSEG_TUNED(std::uint64_t, temporal, likeness, 5);

} // namespace

bool shows_same_place(const LastPicture& last, const Grid& grid, std::int64_t pts, Temporal mode) {
  if (last.luma.size() != grid.size() || mode == Temporal::on)
    return last.luma.size() == grid.size();
  if (pts >= 0 && last.pts >= 0 && std::llabs(pts - last.pts) > longest_gap)
    return false;
  std::uint64_t sum = 0;
  for (int i = 0; i < grid.height; ++i)
    sum = std::accumulate(grid.planes[0].row(i), grid.planes[0].row(i) + grid.width, sum);
  const int mean = static_cast<int>(sum / grid.size());
  std::uint64_t change = 0, spread = 0;
  for (int i = 0; i < grid.height; ++i) {
    const std::uint8_t *const now = grid.planes[0].row(i), *const before = &last.luma[grid.at(i, 0)];
    for (int j = 0; j < grid.width; ++j) {
      change += static_cast<std::uint64_t>(std::abs(now[j] - before[j]));
      spread += static_cast<std::uint64_t>(std::abs(now[j] - mean));
    }
  }
  return change * likeness <= spread;
}

void remember(const Grid& grid, std::int64_t pts, LastPicture& last) {
  last.luma.clear();
  for (int i = 0; i < grid.height; ++i)
    last.luma.insert(last.luma.end(), grid.planes[0].row(i), grid.planes[0].row(i) + grid.width);
  last.pts = pts;
}

void average_scores(const CellScores& score, bool continued, CellScores& average) {
  if (!continued || average.size() != score.size()) {
    average.assign(score.begin(), score.end());
    return;
  }
  // Weight of three quarters, so that objects that move in the picture leave no trail. A half doubles the
  // unsafe pixels of a drive at 15 Hz, and saves an eighth of the flicker.
  for (std::size_t i = 0; i < score.size(); ++i)
    average[i] = static_cast<std::int16_t>(average[i] + (((score[i] - average[i]) * 3) >> 2));
}

} // namespace terrainseg
