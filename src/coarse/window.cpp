// SPDX-License-Identifier: LGPL-2.1-or-later
#include "coarse/window.hpp"

#include <algorithm>
#include <bit>
#include <limits>

#include "base/lattice.hpp"

namespace terrainseg {
namespace {

int power_of_two_at_most(int value) {
  return static_cast<int>(std::bit_floor(static_cast<unsigned>(std::max(value, 1))));
}

/// Converts a range in 1/65536 of `whole` pixels to pixels, rounded, at least one pixel long.
struct Stretch {
  int first, count;
};
Stretch scaled(int first_q16, int count_q16, int whole) {
  const auto at = [whole](std::int64_t q16) { return static_cast<int>((q16 * whole + 32768) >> 16); };
  const int first = std::min(at(first_q16), whole - 1),
            end = std::clamp(at(std::int64_t{first_q16} + count_q16), first + 1, whole);
  return {first, end - first};
}

bool trains(const TrainingArea& area, int x, int y) {
  for (const Rectangle& r : area.ignored)
    if (contains(r, x, y))
      return false;
  if (area.supervision.empty())
    return contains(area.window, x, y);
  for (const Rectangle& r : area.supervision.rectangles)
    if (contains(r, x, y))
      return true;
  const GrayView& mask = area.supervision.mask;
  return !mask.empty() &&
         mask.plane.row(y * mask.height / area.frame_height)[x * mask.width / area.frame_width] >= 128;
}

/// A rectangle that contains all training pixels.
Rectangle hull(const TrainingArea& area) {
  if (area.supervision.empty())
    return area.window;
  if (!area.supervision.mask.empty())
    return {0, 0, area.frame_width, area.frame_height};
  int left = area.frame_width, top = area.frame_height, right = 0, bottom = 0;
  for (const Rectangle& rectangle : area.supervision.rectangles) {
    const Rectangle r = clipped(rectangle, area.frame_width, area.frame_height);
    if (r.empty())
      continue;
    left = std::min(left, r.x);
    top = std::min(top, r.y);
    right = std::max(right, r.x + r.width);
    bottom = std::max(bottom, r.y + r.height);
  }
  return {left, top, right - left, bottom - top};
}

/// The largest squared distance of a component from the mean, in units of the variance (Q16). Rounded up, so
/// that a comparison with the squared limit is exact.
std::uint64_t farthest_component(const Color& color, const Gaussian& moments, std::uint32_t variance_floor) {
  std::uint64_t farthest = 0;
  for (int c = 0; c < 3; ++c) {
    const std::int64_t d = (static_cast<std::int64_t>(color[c]) << 8) - moments.mean[c];
    const std::uint64_t square = static_cast<std::uint64_t>(d * d), // Q16
        variance = std::uint64_t{moments.variance[c]} + variance_floor;
    if (variance > 0)
      farthest = std::max(farthest, ceiled_quotient(square << 8, variance));
    else if (square > 0)
      return std::numeric_limits<std::uint64_t>::max();
  }
  return farthest;
}

} // namespace

// The paper's window is 64 x 128 at a fixed frame size; it does not say which side is the width. With 128 as
// the width 99.9 / 94.2 % of its pixels are ground, otherwise 94.7 / 87.2 % (two halves of 701 labelled
// CamVid frames). For other frame sizes the automatic rule scales it: the largest power of two that is at
// most a fifth of the width, and half as high.
std::optional<Rectangle> place_window(const Settings& s, int frame_width, int frame_height) {
  if (const Rectangle& share = s.window_rect_q16; !share.empty()) {
    const Stretch columns = scaled(share.x, share.width, frame_width),
                  rows = scaled(share.y, share.height, frame_height);
    return Rectangle{columns.first, rows.first, columns.count, rows.count};
  }
  const int columns = frame_width - std::max(s.window_x, 0), rows = frame_height - s.window_bottom;
  if (columns < 1 || rows < 1)
    return std::nullopt;
  int width = s.window_width, height = s.window_height;
  if (width == 0)
    width = s.power_of_two_window ? power_of_two_at_most(std::min(frame_width / 5, columns))
                                  : std::clamp(frame_width * 30 / 100, 1, columns);
  if (height == 0)
    height = s.power_of_two_window ? power_of_two_at_most(std::min(width / 2, rows))
                                   : std::clamp(frame_height * 15 / 100, 1, rows);
  if (width > columns || height > rows)
    return std::nullopt;
  const int x = s.window_x < 0 ? (frame_width - width) / 2 : s.window_x;
  return Rectangle{x, rows - height, width, height};
}

std::string window_does_not_fit(const Settings& s, int frame_width, int frame_height) {
  return "the training window (window-width = " + std::to_string(s.window_width) +
         ", window-height = " + std::to_string(s.window_height) +
         ", window-bottom = " + std::to_string(s.window_bottom) +
         ", window-x = " + std::to_string(s.window_x) + ") does not fit a frame of " +
         std::to_string(frame_width) + "x" + std::to_string(frame_height) +
         ": make it smaller, or 0 to follow the frame";
}

Settings with_fitting_window(Settings s, int frame_width, int frame_height) {
  if (place_window(s, frame_width, frame_height))
    return s;
  s.window_width = std::min(s.window_width, frame_width);
  s.window_height = std::min(s.window_height, frame_height);
  Settings unmoved = s;
  unmoved.window_x = -1;
  unmoved.window_bottom = 0;
  const Rectangle window = *place_window(unmoved, frame_width, frame_height);
  if (frame_width - s.window_x < std::max(s.window_width, 1))
    s.window_x = frame_width - window.width;
  if (frame_height - s.window_bottom < std::max(s.window_height, 1))
    s.window_bottom = frame_height - window.height;
  return s;
}

void select_cells(const TrainingArea& area, int level, std::vector<Cell>& cells) {
  cells.clear();
  const Rectangle range =
      cells_in(hull(area), level, subsampled(area.frame_width, level), subsampled(area.frame_height, level));
  for (int y = range.y; y < range.y + range.height; ++y)
    for (int x = range.x; x < range.x + range.width; ++x)
      if (trains(area, x << level, y << level) && (area.veto.empty() || !area.veto.touches_cell(level, x, y)))
        cells.push_back({static_cast<std::int16_t>(x), static_cast<std::int16_t>(y)});
}

int select_training_level(const TrainingArea& area, int coarsest, int needed, std::vector<Cell>& cells) {
  for (int level = coarsest; level > 0; --level) {
    select_cells(area, level, cells);
    if (cells.size() >= static_cast<std::size_t>(needed))
      return level;
  }
  select_cells(area, 0, cells);
  return 0;
}

Rectangle training_bounds(const TrainingArea& area, int level, std::span<const Cell> cells) {
  if (area.supervision.empty())
    return area.window;
  if (area.supervision.mask.empty() || cells.empty()) {
    const Rectangle box = hull(area);
    return box.empty() ? Rectangle{} : box;
  }
  int left = cells[0].x, right = left, bottom = cells.back().y;
  for (const Cell& cell : cells) {
    left = std::min<int>(left, cell.x);
    right = std::max<int>(right, cell.x);
  }
  const int top = cells[0].y;
  return clipped({left << level, top << level, (right - left + 1) << level, (bottom - top + 1) << level},
                 area.frame_width, area.frame_height);
}

Gaussian moments_of(const Grid& grid, std::span<const Cell> cells) {
  MomentSums sums;
  for (const Cell& cell : cells)
    sums.add(grid.color(cell));
  return sums.moments();
}

void prefilter(const Grid& grid, std::span<const Cell> cells, const Gaussian& moments,
               const PrefilterRule& rule, Prefiltered& kept) {
  kept.cells.clear();
  kept.distances.clear();
  kept.cells.reserve(cells.size());
  kept.distances.reserve(cells.size());
  kept.ranks.reserve(cells.size());
  std::uint64_t limit = static_cast<std::uint64_t>(rule.sigma_q8) * rule.sigma_q8;
  std::size_t within = 0;
  for (const Cell& cell : cells) {
    const std::uint64_t distance = farthest_component(grid.color(cell), moments, rule.variance_floor);
    kept.distances.push_back(distance);
    within += distance <= limit;
  }

  const std::size_t half = (cells.size() + 1) / 2;
  if (rule.scarce == PrefilterRule::Scarce::nearest_half && within < half) {
    kept.ranks.assign(kept.distances.begin(), kept.distances.end());
    const auto last_kept = kept.ranks.begin() + static_cast<std::ptrdiff_t>(half) - 1;
    std::nth_element(kept.ranks.begin(), last_kept, kept.ranks.end());
    limit = *last_kept;
  } else if (rule.scarce == PrefilterRule::Scarce::all_below_one_quarter && within * 4 < cells.size()) {
    limit = std::numeric_limits<std::uint64_t>::max();
  }
  for (std::size_t i = 0; i < cells.size(); ++i)
    if (kept.distances[i] <= limit)
      kept.cells.push_back(cells[i]);
}

bool looks_like_ground(const Color& color, const Gaussian& ground) {
  for (int c = 0; c < 3; ++c) {
    const std::int64_t d = (std::int64_t{color[c]} << 8) - ground.mean[c];
    if (d * d > std::int64_t{4} * ground.variance[c] << 8)
      return false;
  }
  return true;
}

// Often several rows have no ground cell. The first of them (the literal reading) differs from the true
// horizon by 51 % of the height, the lowest one by 26 % (701 labelled frames). Therefore the lowest one is
// taken.
//
// The paper has no condition for "u_h gets assigned to null". Here there is no horizon when no row has less
// than half of the other rows' mean, or when a row of the window has as few.
Horizon find_horizon(const Grid& grid, const Gaussian& ground, int window_top, int window_end) {
  int poorest = -1, least = std::numeric_limits<int>::max(), least_in_window = least;
  std::int64_t total = 0;
  for (int row = 0; row < window_end; ++row) {
    int count = 0;
    for (Cell cell{0, static_cast<std::int16_t>(row)}; cell.x < grid.width; ++cell.x)
      count += looks_like_ground(grid.color(cell), ground);
    total += count;
    if (row >= window_top)
      least_in_window = std::min(least_in_window, count);
    else if (count <= least) {
      least = count;
      poorest = row;
    }
  }
  if (poorest < 0 || least_in_window <= least)
    return {};
  const std::int64_t others = window_end - 1, rest = total - least; // others * average = rest
  if (2 * least * others >= rest)
    return {};
  // NOLINTNEXTLINE(clang-analyzer-core.DivideZero): here `rest` is greater than 0
  return {poorest, static_cast<std::uint8_t>(255 - 255 * least * others / rest)};
}

} // namespace terrainseg
