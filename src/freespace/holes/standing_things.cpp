// SPDX-License-Identifier: LGPL-2.1-or-later
#include "freespace/holes/standing_things.hpp"

#include <algorithm>

#include "coarse/grid.hpp"
#include "coarse/ignored.hpp"
#include "terrainseg/estimate.hpp"

namespace terrainseg {
namespace {

constexpr int cell_bits = 2; ///< a cell is 4 x 4 pixels of motion's level

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

// Compilers make vectors of these.
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

/// Whether something stands in the row.
bool outline_standing(const std::uint8_t* __restrict ground, const std::int16_t* __restrict standing,
                      std::size_t count, std::uint8_t* __restrict out) {
  std::uint8_t any = 0;
  for (std::size_t j = 0; j < count; ++j) {
    out[j] = static_cast<std::uint8_t>(ground[j] & (standing[j] > least_standing ? 255 : 0));
    any |= out[j];
  }
  return any != 0;
}

unsigned take(std::uint8_t* row, int count) {
  unsigned taken = 0;
  for (int x = 0; x < count; ++x) {
    const bool traversable = row[x] == mask_traversable;
    row[x] = traversable ? mask_not_traversable : row[x];
    taken += traversable;
  }
  return taken;
}

} // namespace

/// A cell's middle, which is looked at, is a column of theirs.
int StandingThings::coarsest_columns(const Pyramid& pyramid, int grid_level) {
  return level_of(pyramid, grid_level) + cell_bits - 1;
}

/// Cells whose centres lie in the ground, outside what is ignored.
void StandingThings::outline_ground(const FreeSpaceCurves& curves, const CurvesOfFrame& of, int width,
                                    int height) {
  const int cell_level = level_ + cell_bits, half = 1 << cell_level >> 1;
  columns_ = width / 4;
  rows_ = height / 4;
  ground_.resize(static_cast<std::size_t>(columns_) * rows_);
  // The first row of cells whose centre lies at or below a row of the frame.
  const auto cell_row = [=](int row) {
    return static_cast<std::uint16_t>(std::max((row - half + (1 << cell_level) - 1) >> cell_level, 0));
  };
  const int last = static_cast<int>(curves.safe.size()) - 1;
  const auto columns = static_cast<std::size_t>(columns_);
  for (std::vector<std::uint16_t>* rows : {&safe_, &behind_first_, &behind_end_})
    rows->assign(columns, 0);
  for (std::size_t j = 0; j < columns; ++j) {
    const auto x = static_cast<std::size_t>(
        std::min(((static_cast<int>(j) << cell_level) + half) >> of.mask_level, last));
    safe_[j] = cell_row(curves.safe[x]);
    if (curves.ground_behind) {
      behind_first_[j] = cell_row(curves.behind_first[x]);
      behind_end_[j] = cell_row(curves.behind_end[x]);
    }
  }
  for (int i = 0; i < rows_; ++i)
    outline_row({safe_.data(), behind_first_.data(), behind_end_.data()}, static_cast<std::uint16_t>(i),
                columns, ground_.data() + i * columns_);
  fill_ignored(of.ignored, cell_level, columns_, rows_, 0, ground_.data());
}

bool StandingThings::find(const Pyramid& pyramid, const FreeSpaceCurves& curves, const CurvesOfFrame& of,
                          MotionTrack& track) {
  track.line = {}; // a picture that is too small for motion has none
  track.speed = track.line_offset = 0;
  evidence_ = {};
  level_ = level_of(pyramid, of.grid_level);
  if (level_ > of.grid_level)
    return false; // the pyramid ends before
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
  first_row_ = rows_;
  end_row_ = 0;
  for (int i = 0; i < rows_; ++i) {
    const std::ptrdiff_t at = std::ptrdiff_t{i} * columns_;
    if (outline_standing(ground_.data() + at, view.standing.data() + at, static_cast<std::size_t>(columns_),
                         stands_.data() + at)) {
      first_row_ = std::min(first_row_, i);
      end_row_ = i + 1;
    }
  }
  return end_row_ > 0;
}

FinerCells<std::int16_t> StandingThings::evidence() const {
  const int level = level_ + cell_bits;
  return {evidence_, columns_, rows_, level, 1 << level >> 1};
}

void StandingThings::lower(int mask_level, FrameCurve& rows) const {
  for (int j = 0; j < columns_; ++j) {
    int end = end_row_; // below the lowest cell
    while (end > first_row_ && !stands_[static_cast<std::size_t>((end - 1) * columns_ + j)])
      --end;
    if (end <= first_row_)
      continue;
    const auto row = static_cast<std::uint16_t>(end << (level_ + cell_bits));
    const auto [first, last] = columns_of(j, mask_level, static_cast<int>(rows.size()));
    for (int x = first; x < last; ++x)
      rows[static_cast<std::size_t>(x)] = std::max(rows[static_cast<std::size_t>(x)], row);
  }
}

std::uint64_t StandingThings::mark(const MutablePlane& mask, int width, int height, int mask_level) const {
  std::uint64_t taken = 0;
  for (int i = first_row_; i < end_row_; ++i) {
    const std::uint8_t* cells = stands_.data() + i * columns_;
    const int top = std::min(subsampled(i << (level_ + cell_bits), mask_level), height),
              bottom = i + 1 == rows_
                           ? height
                           : std::min(subsampled((i + 1) << (level_ + cell_bits), mask_level), height);
    for (int j = 0; j < columns_; ++j) {
      if (!cells[j])
        continue;
      const int first = columns_of(j, mask_level, width).first;
      while (j + 1 < columns_ && cells[j + 1])
        ++j;
      const int last = columns_of(j, mask_level, width).second;
      for (int y = top; y < bottom; ++y)
        taken += take(mask.row(y) + first, last - first);
    }
  }
  return taken;
}

/// Columns of the mask that a column of cells covers; the last one has the odd rest.
std::pair<int, int> StandingThings::columns_of(int column, int mask_level, int width) const {
  const auto edge = [&](int cell) {
    return std::min(subsampled(cell << (level_ + cell_bits), mask_level), width);
  };
  return {edge(column), column + 1 == columns_ ? width : edge(column + 1)};
}

} // namespace terrainseg
