// SPDX-License-Identifier: LGPL-2.1-or-later
#include "freespace/curve/refinement.hpp"

#include <algorithm>
#include <array>
#include <limits>

#include "base/tuning.hpp"
#include "freespace/curve/reestimation.hpp"
#include "freespace/look/view.hpp"
#include "terrainseg/settings.hpp"

namespace terrainseg {
namespace {

constexpr int reach = 3; ///< rows of the refinement's level
static_assert(2 * reach + 2 <= kernels::strip_rows);
constexpr int median_reach = 2;
/// Rows of the grid between neighbouring columns from which the curve follows the side of a thing. Error /
/// unsafe of the drives: 4.28 / 10.6 if it never does, 4.18 / 11.0 with 3, 4.17 / 11.2 with 2.
TERRAINSEG_TUNED(int, refinement, least_side, 3);

// In doubled rows of the refinement's level: every row is ground; no row is ground.
constexpr int all = -1;
constexpr int none_of(int height) {
  return 2 * height - 1;
}
// Row i of the grid is row i * ratio here. The edge above it lies half a cell higher.
int edge_above(int row, const Grid& grid, int height) {
  const int ratio = 1 << (grid.level - refinement_level(grid.level));
  return row == 0 ? all : row >= grid.height ? none_of(height) : (2 * row - 1) * ratio;
}
bool is_open(int edge, int height) {
  return edge <= all || edge >= none_of(height);
}

// Median of five without a loop.
int median5(int a, int b, int c, int d, int e) {
  const int low = std::max(std::min(a, b), std::min(c, d)), high = std::min(std::max(a, b), std::max(c, d));
  return std::max(std::min(low, high), std::min(std::max(low, high), e));
}

} // namespace

void Refinement::refine(const Pyramid& pyramid, const Grid& grid, const ColorTransform& transform,
                        const GridCurve& curve, bool snap, int mask_level, int frame_width, int frame_height,
                        FrameCurve& rows) {
  const int level = refinement_level(grid.level), width = pyramid.width(level),
            height = pyramid.height(level);
  interpolate(grid, curve, width, height);
  if (snap) {
    sharpen_sides(pyramid, transform, grid, curve);
    asked_.resize(fine_.size(), std::numeric_limits<int>::min());
    snapped_.resize(fine_.size());
    for (int first = 0; first < width; first += kernels::strip_columns) {
      const int end = std::min(first + kernels::strip_columns, width);
      if (!ask(first, end))
        snap_columns(pyramid, transform, level, first, end);
    }
    take_medians();
  }
  write_rows(level, height, mask_level, frame_width, frame_height, rows);
}

// Interpolates the curve at the columns of the refinement's level and marks where it may move.
void Refinement::interpolate(const Grid& grid, const GridCurve& curve, int width, int height) {
  const int ratio = 1 << (grid.level - refinement_level(grid.level));
  fine_.resize(width);
  moves_.resize(width);
  for (int j = 0, x = 0; x < width; ++j) {
    const auto edge = [&](int column) {
      return edge_above(curve[std::min(column, grid.width - 1)], grid, height);
    };
    const int here = edge(j), next = edge(j + 1);
    const bool open = is_open(here, height) || is_open(next, height);
    for (int part = 0; part < ratio && x < width; ++part, ++x) {
      moves_[x] = !open;
      fine_[x] = open ? (2 * part < ratio ? here : next) : (here * (ratio - part) + next * part) / ratio;
    }
  }
}

// Where neighbouring columns of the grid differ by least_side, the curve follows the side of a thing: in each
// row of the grid between them it crosses at the strongest colour edge. Row 0 says that nothing ends there.
void Refinement::sharpen_sides(const Pyramid& pyramid, const ColorTransform& transform, const Grid& grid,
                               const GridCurve& curve) {
  const int level = refinement_level(grid.level), ratio = 1 << (grid.level - level),
            width = pyramid.width(level), height = pyramid.height(level);
  for (int j = 0; j + 1 < grid.width; ++j) {
    const int here = curve[j], next = curve[j + 1];
    if (std::min(here, next) == 0 || std::abs(here - next) < least_side)
      continue;
    // A column of the picture more on both sides.
    const int left = std::max(j * ratio - 1, 0), count = std::min((j + 1) * ratio + 2, width) - left;
    Crossings crossings{};
    for (int row = std::min(here, next), end = std::max(here, next); row < end; row += kernels::strip_columns)
      count_crossings(pyramid, transform, level, ratio,
                      {left, row, count, std::min(end - row, kernels::strip_columns)}, crossings);
    for (int k = 1, row = here; k < count - 1; ++k) {
      row += here < next ? crossings[k] : -crossings[k];
      fine_[left + k] = edge_above(row, grid, height);
    }
  }
}

// Counts for each column of the refinement's level in how many rows of the grid it differs most from the
// column before it. The box has columns of the refinement's level and rows of the grid.
void Refinement::count_crossings(const Pyramid& pyramid, const ColorTransform& transform, int level,
                                 int ratio, const Rectangle& box, Crossings& crossings) {
  for (int i = 0; i < box.height; ++i) {
    const int middle = (box.y + i) * ratio, top = std::max(middle - ratio / 2, 0),
              end = std::min(middle + (ratio + 1) / 2, pyramid.height(level));
    for (int c = 0; c < 3; ++c)
      for (int k = 0; k < box.width; ++k) { // columns of the picture are rows of the strip
        int sum = 0;
        for (int y = top; y < end; ++y)
          sum += pyramid.plane(level, c).row(y)[box.x + k];
        strip_[k][c][i] = static_cast<std::uint8_t>(sum / (end - top));
      }
  }
  std::array<std::uint8_t, kernels::strip_columns> last{}, best{};
  last.fill(static_cast<std::uint8_t>(box.width - 1));
  kernels::strongest_edges(strip_, transform.matrix, box.width, last.data(), best.data());
  for (int i = 0; i < box.height; ++i)
    ++crossings[best[i]];
}

// The curve before was the same in these columns: takes what it was moved to, and returns true. Otherwise
// keeps this one as the curve before.
bool Refinement::ask(int first, int end) {
  bool same = true;
  for (int x = first; x < end; ++x) {
    const int wanted = 2 * fine_[x] + moves_[x];
    same &= asked_[x] == wanted;
    asked_[x] = wanted;
  }
  if (same)
    std::copy(snapped_.begin() + first, snapped_.begin() + end, fine_.begin() + first);
  return same;
}

// Moves the curve to the strongest edge near it, in each column separately.
void Refinement::snap_columns(const Pyramid& pyramid, const ColorTransform& transform, int level, int first,
                              int end) {
  const std::array<Plane, 3> planes{pyramid.plane(level, 0), pyramid.plane(level, 1),
                                    pyramid.plane(level, 2)};
  const int lowest = pyramid.height(level) - 1;
  std::array<std::uint8_t, kernels::strip_columns> last{}, best{};
  std::array<int, kernels::strip_columns> tops{};
  int rows = 0;
  for (int x = first; x < end; ++x) {
    if (!moves_[x])
      continue;
    const int i = x - first;
    const int centre = (fine_[x] + 1) / 2; // between rows centre - 1 and centre
    tops[i] = std::max(centre - reach, 1) - 1;
    const int bottom = std::min(centre + reach, lowest);
    last[i] = static_cast<std::uint8_t>(std::max(bottom - tops[i], 0));
    rows = std::max(rows, last[i] + 1);
    for (std::size_t c = 0; c < 3; ++c) {
      const std::uint8_t* pixel = planes[c].row(tops[i]) + x;
      for (std::size_t k = 0; k <= last[i]; ++k, pixel += planes[c].stride)
        strip_[k][c][i] = *pixel;
    }
  }
  kernels::strongest_edges(strip_, transform.matrix, rows, last.data(), best.data());
  for (int x = first; x < end; ++x) {
    const int i = x - first;
    if (best[i] > 0)
      fine_[x] = 2 * (tops[i] + best[i]) - 1;
  }
  std::copy(fine_.begin() + first, fine_.begin() + end, snapped_.begin() + first);
}

void Refinement::take_medians() {
  if (fine_.size() <= 2 * median_reach)
    return;
  median_.assign(fine_.begin(), fine_.end());
  for (std::size_t x = median_reach; x < fine_.size() - median_reach; ++x) {
    const int* f = &median_[x - median_reach];
    fine_[x] = median5(f[0], f[1], f[2], f[3], f[4]);
  }
}

// Converts doubled rows e of this level to rows e * 2^level / 2 of the frame, interpolated linearly between
// columns.
void Refinement::write_rows(int level, int height, int mask_level, int frame_width, int frame_height,
                            FrameCurve& rows) const {
  const int count = subsampled(frame_width, mask_level), coarser = std::max(mask_level - level, 0),
            columns = 1 << std::max(level - mask_level, 0); // columns of the mask per column of this level
  rows.resize(count);
  for (int x = 0; x < count; x += columns) {
    const int f = x / columns << coarser;
    const int a = fine_[f], b = fine_[std::min(f + 1, static_cast<int>(fine_.size()) - 1)];
    const int written = std::min(columns, count - x),
              step = is_open(b, height) ? 0 : (b - a) * (1 << mask_level);
    std::uint16_t* out = &rows[x];
    if (is_open(a, height))
      std::fill_n(out, written, static_cast<std::uint16_t>(a <= all ? 0 : frame_height));
    else
      for (int i = 0, at = (a << level) + 1; i < written; ++i, at += step)
        out[i] = static_cast<std::uint16_t>(std::clamp(at >> 1, 0, frame_height));
  }
}

void walk_doubtful(const Grid& grid, const CellScores& score, int limit, const GridCurve& boundary,
                   GridCurve& safe) {
  safe.assign(boundary.begin(), boundary.end());
  if (limit <= doubtful_off)
    return;
  const auto across = [&](int row, int j) { // 1-2-1 over the columns
    const std::int16_t* s = &score[grid.at(std::clamp(row, 0, grid.height - 1), 0)];
    return s[std::max(j - 1, 0)] + 2 * s[j] + s[std::min(j + 1, grid.width - 1)];
  };
  for (int j = 0; j < grid.width; ++j) {
    int row = boundary[j];
    while (row < grid.height &&
           across(row - 1, j) + 2 * across(row, j) + across(row + 1, j) < limit * 16 * 16)
      ++row;
    safe[j] = static_cast<std::uint16_t>(row);
  }
}

void RefinedCurves::refine(const View& view, const Ground& ground) {
  finer_made_ = 0;
  refinement_.start();
  refine(view, ground, view.task.settings.mask_level, of_mask_);
}

const FreeSpaceCurves& RefinedCurves::at(const View& view, const Ground& ground, int level) {
  if (level == of_mask_.level)
    return of_mask_;
  for (std::size_t i = 0; i < finer_made_; ++i)
    if (finer_[i].level == level)
      return finer_[i];
  FreeSpaceCurves& finer = finer_[std::min(finer_made_++, finer_.size() - 1)];
  refine(view, ground, level, finer);
  return finer;
}

void RefinedCurves::refine(const View& view, const Ground& ground, int level, FreeSpaceCurves& curves) {
  curves.level = level;
  const auto bring = [&](const GridCurve& curve, FrameCurve& rows) {
    refinement_.refine(view.pyramid, view.grid, view.transform, curve, view.task.settings.refine, level,
                       view.task.frame.width, view.task.frame.height, rows);
  };
  bring(ground.boundary, curves.boundary);
  bring(ground.safe, curves.safe);
  for (std::size_t x = 0; x < curves.safe.size(); ++x)
    curves.safe[x] = std::max(curves.safe[x], curves.boundary[x]);
  curves.ground_behind = ground.behind.any;
  for (FrameCurve* rows : {&curves.behind_first, &curves.behind_end})
    rows->reserve(curves.safe.size()); // reserved early, so that the first frame with ground behind an
                                       // obstacle does not allocate
  if (!ground.behind.any)
    return;
  bring(ground.behind.first, curves.behind_first);
  bring(ground.behind.end, curves.behind_end);
  for (std::size_t x = 0; x < curves.safe.size(); ++x)
    curves.behind_end[x] =
        std::min(curves.behind_end[x], static_cast<std::uint16_t>(std::max(curves.boundary[x] - 1, 0)));
}

} // namespace terrainseg
