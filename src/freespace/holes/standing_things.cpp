// SPDX-License-Identifier: LGPL-2.1-or-later
#include "freespace/holes/standing_things.hpp"

#include <algorithm>

#include "base/tuning.hpp"
#include "coarse/grid.hpp"

namespace terrainseg {
namespace {

TERRAINSEG_TUNED(int, standing_things, cell_bits, 2); ///< a cell has 4 x 4 pixels of motion's level

int level_of(const Pyramid& pyramid, int grid_level) {
  return std::max(motion_level(pyramid.width(0), pyramid.height(0)), texture_level(grid_level));
}

MotionKnowledge knowledge_of(const FrameLine& line, int level) {
  using Line = MotionKnowledge::Line;
  return {line.source == FrameLine::Source::setting ? Line::exact
          : line.known()                            ? Line::near
                                                    : Line::unknown,
          line.row_q8_of_level(level)};
}

/// Per column the rows of cells that are ground.
struct GroundColumns {
  const std::uint16_t *safe, *behind_first, *behind_end;
};

// The functions below are auto-vectorised.
void outline_row(const GroundColumns& ground, std::uint16_t row, std::size_t count,
                 std::uint8_t* __restrict out) {
  const std::uint16_t *const safe = ground.safe, *const first = ground.behind_first,
                             *const end = ground.behind_end;
  for (std::size_t j = 0; j < count; ++j) {
    const int below = static_cast<int>(row >= safe[j]),
              behind = static_cast<int>(row >= first[j]) & static_cast<int>(row < end[j]);
    out[j] = static_cast<std::uint8_t>(-(below | behind));
  }
}

/// Returns whether something stands in the row.
bool outline_standing(const std::uint8_t* __restrict ground, const std::int16_t* __restrict standing,
                      std::size_t count, std::uint8_t* __restrict out) {
  std::uint8_t any = 0;
  for (std::size_t j = 0; j < count; ++j) {
    out[j] = static_cast<std::uint8_t>(ground[j] & (standing[j] > least_standing ? 255 : 0));
    any |= out[j];
  }
  return any != 0;
}

} // namespace

/// Each cell is tested at its centre, which is a column of these curves.
int StandingThings::coarsest_columns(const Pyramid& pyramid, int grid_level) {
  return level_of(pyramid, grid_level) + cell_bits - 1;
}

/// Marks the cells whose centres are in the ground and not in an ignored region.
void StandingThings::outline_ground(const FreeSpaceCurves& curves, const CurvesOfFrame& of, int width,
                                    int height) {
  const int cell_level = level_ + cell_bits, half = 1 << cell_level >> 1;
  columns_ = width / 4;
  rows_ = height / 4;
  ground_.resize(columns_ * rows_);
  // The first row of cells whose centre is at or below a row of the frame.
  const auto cell_row = [=](int row) {
    return static_cast<std::uint16_t>(std::max((row - half + (1 << cell_level) - 1) >> cell_level, 0));
  };
  const int last = static_cast<int>(curves.safe.size()) - 1;
  for (std::vector<std::uint16_t>* rows : {&safe_, &behind_first_, &behind_end_})
    rows->assign(columns_, 0);
  for (int j = 0; j < columns_; ++j) {
    const int x = std::min(((j << cell_level) + half) >> curves.level, last);
    safe_[j] = cell_row(curves.safe[x]);
    if (curves.ground_behind) {
      behind_first_[j] = cell_row(curves.behind_first[x]);
      behind_end_[j] = cell_row(curves.behind_end[x]);
    }
  }
  for (int i = 0; i < rows_; ++i)
    outline_row({safe_.data(), behind_first_.data(), behind_end_.data()}, static_cast<std::uint16_t>(i),
                columns_, ground_.data() + i * columns_);
  fill_ignored(of.ignored, cell_level, columns_, rows_, 0, ground_.data());
}

bool StandingThings::find(const Pyramid& pyramid, const FreeSpaceCurves& curves, const CurvesOfFrame& of,
                          MotionTrack& track, std::vector<Hole>& holes) {
  holes.clear();
  track.line = {}; // the picture is too small for motion
  track.speed = track.line_offset = 0;
  evidence_ = {};
  level_ = level_of(pyramid, of.grid_level);
  if (level_ > of.grid_level)
    return false; // the pyramid has no such level
  const int width = pyramid.width(level_), height = pyramid.height(level_);
  outline_ground(curves, of, width, height);
  if (ground_.empty())
    return false;
  const MotionView& view = track.motion.observe({pyramid.plane(level_, 0), width, height},
                                                {{ground_.data(), columns_}, columns_, rows_}, of.pts,
                                                knowledge_of(of.line, level_));
  if (view.columns == 0)
    return false;
  const int row_q8 = view.vanishing_row * (1 << level_);
  if (view.line_settled && row_q8 >= 0 && row_q8 < pyramid.height(0) << 8)
    track.line = {FrameLine::Source::motion, row_q8};
  track.line_offset = view.line_offset * (1 << level_);
  track.speed =
      static_cast<std::int32_t>(std::clamp<std::int64_t>(view.speed_over_height, INT32_MIN, INT32_MAX));
  evidence_ = view.standing;
  stands_.resize(ground_.size());
  holes.reserve(ground_.size() / 2 + 1); // reserved now, so that the first frame with an obstacle does not
                                         // allocate
  for (int i = 0; i < rows_; ++i) {
    const std::ptrdiff_t at = std::ptrdiff_t{i} * columns_;
    if (outline_standing(ground_.data() + at, view.standing.data() + at, columns_, stands_.data() + at))
      list(i, pyramid.width(0), pyramid.height(0), holes);
  }
  return !holes.empty();
}

FinerCells<std::int16_t> StandingThings::evidence() const {
  const int level = level_ + cell_bits;
  return {evidence_, columns_, rows_, level, 1 << level >> 1, columns_};
}

/// The last row and the last column of cells include the remaining pixels of the frame.
void StandingThings::list(int row, int frame_width, int frame_height, std::vector<Hole>& holes) const {
  const int level = level_ + cell_bits;
  const auto pixel = [](int value) { return static_cast<std::uint16_t>(value); };
  const std::uint8_t* const cells = stands_.data() + row * columns_;
  for (int j = 0; j < columns_; ++j) {
    if (!cells[j])
      continue;
    const int first = j;
    while (j + 1 < columns_ && cells[j + 1])
      ++j;
    const int right = j + 1 == columns_ ? frame_width : (j + 1) << level,
              bottom = row + 1 == rows_ ? frame_height : (row + 1) << level;
    holes.push_back(
        {pixel(first << level), pixel(row << level), pixel(right), pixel(bottom), pixel((row + 1) << level)});
  }
}

} // namespace terrainseg
