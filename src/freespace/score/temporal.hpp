// SPDX-License-Identifier: LGPL-2.1-or-later
// Averaging of scores over neighbouring frames.
#pragma once

#include <cstdint>
#include <vector>

#include "base/quantities.hpp"
#include "coarse/grid.hpp"
#include "terrainseg/settings.hpp"

namespace terrainseg {

/// The last frame's luma and time, by which it is seen whether the next one continues it.
struct LastPicture {
  std::vector<std::uint8_t> luma; ///< row by row; empty = there is none
  std::int64_t pts = -1;          ///< nanoseconds, -1 = unknown
};

/// Whether a frame shows the same place as the last one: with Temporal::on wherever their size is the same,
/// else where the picture shows much the same and the time between them, where known, is two seconds at most.
bool shows_same_place(const LastPicture& last, const Grid& grid, std::int64_t pts, Temporal mode);

/// Makes this frame the last one.
void remember(const Grid& grid, std::int64_t pts, LastPicture& last);

/// `average` (Q4) moves towards `score` (Q4) by three quarters, or becomes it when the frame does not
/// continue the last one.
void average_scores(const CellScores& score, bool continued, CellScores& average);

} // namespace terrainseg
