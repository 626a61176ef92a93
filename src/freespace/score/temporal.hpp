// SPDX-License-Identifier: LGPL-2.1-or-later
// Averages scores over neighbouring frames.
#pragma once

#include <cstdint>
#include <vector>

#include "base/quantities.hpp"
#include "coarse/grid.hpp"
#include "terrainseg/settings.hpp"

namespace terrainseg {

/// Luma and time of the last frame, to decide whether the next frame continues it.
struct LastPicture {
  std::vector<std::uint8_t> luma; ///< row by row; empty = no last frame
  std::int64_t pts = -1;          ///< nanoseconds, -1 = unknown
};

/// Whether a frame shows the same place as the last one. With Temporal::on: when their sizes are equal.
/// Otherwise: when the pictures are similar and the interval, if known, is at most two seconds.
bool shows_same_place(const LastPicture& last, const Grid& grid, std::int64_t pts, Temporal mode);

/// Stores this frame as the last one.
void remember(const Grid& grid, std::int64_t pts, LastPicture& last);

/// Moves `average` (Q4) towards `score` (Q4) by three quarters, or sets it to `score` when the frame does not
/// continue the last one.
void average_scores(const CellScores& score, bool continued, CellScores& average);

} // namespace terrainseg
