// SPDX-License-Identifier: LGPL-2.1-or-later
#include "freespace/cues/temporal.hpp"

#include <cstdlib>
#include <numeric>

namespace terrainseg {
namespace {

constexpr std::int64_t longest_gap =
    2'000'000'000; ///< after it the scores are old, however like the pictures are
/// What tells is the picture, not the clock: averaging over the jumps of a 1 Hz sequence costs 0.8 to 6
/// points, over two like pictures a second apart nothing. Frames of one motion differ by less than a fifth of
/// what the picture itself varies: a drive in town at 15 Hz by 0.07 to 0.2, pictures a second apart by 0.3
/// and more.
constexpr std::uint64_t likeness = 5;

} // namespace

void ScoreAverage::forget() {
  last_.clear();
  last_pts_ = -1;
}

bool ScoreAverage::continues(const Grid& grid, std::int64_t pts, Temporal mode) {
  luma_.clear();
  for (int i = 0; i < grid.height; ++i)
    luma_.insert(luma_.end(), grid.planes[0].row(i), grid.planes[0].row(i) + grid.width);
  bool same = last_.size() == grid.size();
  if (same && mode == Temporal::automatic) {
    if (pts >= 0 && last_pts_ >= 0 && std::llabs(pts - last_pts_) > longest_gap) {
      same = false;
    } else {
      const int mean =
          static_cast<int>(std::accumulate(luma_.begin(), luma_.end(), std::uint64_t{0}) / grid.size());
      std::uint64_t change = 0, spread = 0;
      for (std::size_t i = 0; i < grid.size(); ++i) {
        change += static_cast<std::uint64_t>(std::abs(luma_[i] - last_[i]));
        spread += static_cast<std::uint64_t>(std::abs(luma_[i] - mean));
      }
      same = change * likeness <= spread;
    }
  }
  last_.swap(luma_);
  last_pts_ = pts;
  return same && mode != Temporal::off;
}

void ScoreAverage::add(const CellScores& score, bool continued, CellScores& average) const {
  if (!continued || average.size() != score.size()) {
    average.assign(score.begin(), score.end());
    return;
  }
  // Three quarters: what shifts along in the picture must not leave a trail. A half makes twice as many
  // unsafe pixels in a drive at 15 Hz as an eighth saves of flicker.
  for (std::size_t i = 0; i < score.size(); ++i)
    average[i] = static_cast<std::int16_t>(average[i] + (((score[i] - average[i]) * 3) >> 2));
}

} // namespace terrainseg
