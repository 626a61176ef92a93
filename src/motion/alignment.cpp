// SPDX-License-Identifier: LGPL-2.1-or-later
#include "motion/alignment.hpp"

#include <algorithm>
#include <cstdlib>
#include <cstring>
#include <utility>

#include "base/tuning.hpp"
#include "kernels/ground_warp.hpp"

namespace terrainseg {
namespace {

TERRAINSEG_TUNED(int, alignment, clipped_at, 40 << 8);            ///< Q8: limit of a difference
TERRAINSEG_TUNED(int, alignment, least_spread, 3 << 7);           ///< Q8: 1.5 grey levels
TERRAINSEG_TUNED(std::int64_t, alignment, small_step, 1678);      ///< Q24: 1e-4, a thirtieth of a pixel
TERRAINSEG_TUNED(std::int64_t, alignment, largest_step, 1 << 23); ///< Q24: 0.5

/// Table of 256 / (1 + (z / 2)^2)^2 for z = (k + 1/2) / 8 spreads; 0 from z = 8 on.
constexpr auto weights = [] {
  std::array<std::int32_t, 65> table{};
  for (int k = 0; k < 64; ++k) {
    const std::int64_t z = 2 * k + 1, one = 1024; // z / 2 in units of 1/32; squared in Q10
    const std::int64_t base = one + z * z;
    table[k] = static_cast<std::int32_t>((256 * one * one + base * base / 2) / (base * base));
  }
  return table;
}();

/// Sums of the clipped differences and of the clipped contrasts (distances from grey 128), over the points
/// inside the earlier frame. Auto-vectorised.
std::pair<std::int32_t, std::int32_t> sums_of(const kernels::PointLists& points,
                                              const std::int32_t* __restrict differences) {
  const std::int32_t* __restrict values = points.values;
  std::int32_t sum = 0, contrast = 0;
  for (int i = 0; i < points.count; ++i) {
    const std::int32_t seen = differences[i] == kernels::no_difference ? 0 : -1,
                       from_grey = values[i] - (128 << 8);
    const std::int32_t e = differences[i] < 0 ? -differences[i] : differences[i],
                       c = from_grey < 0 ? -from_grey : from_grey;
    sum += (e < clipped_at ? e : clipped_at) & seen;
    contrast += (c < clipped_at ? c : clipped_at) & seen;
  }
  return {sum, contrast};
}

GroundPoint point_at(const PassedView& picture, const GroundCamera& view, int u, int v) {
  const std::uint8_t* row = picture.row(v);
  const int dx = row[u + 1] - row[u - 1], dy = picture.row(v + 1)[u] - picture.row(v - 1)[u];
  GroundPoint point;
  point.across = across(view, u);
  point.below = below(view, v);
  point.value = row[u] << 8;
  const int x = point.across * 512 / view.focal, y = point.below * 4 / view.focal; // Q10
  const int xx = x * x >> 10, xy = x * y >> 10, yy = y * y >> 10;
  point.derivative = {
      dx * y, dx * (1024 + xx) + dy * xy, dy * x, dy * y, dy * 1024, -dx * xy - dy * yy, -(dx * x + dy * y)};
  return point;
}

constexpr std::size_t whole_vectors(std::size_t points) {
  constexpr std::size_t together = kernels::points_together;
  return (points + together - 1) / together * together;
}

} // namespace

void GroundPoints::reserve(std::size_t points) {
  if (points <= room_)
    return;
  room_ = whole_vectors(points);
  numbers_.assign((3 + most_unknowns) * room_, 0);
  few_.assign(3 * few_room(), 0);
  size_ = 0;
}

void GroundPoints::add(const GroundPoint& point) {
  if (size_ % every == 0) {
    std::int32_t* few = few_.data() + size_ / every;
    few[0] = point.across;
    few[few_room()] = point.below;
    few[2 * few_room()] = point.value;
  }
  std::int32_t* out = numbers_.data() + size_++;
  out[0] = point.across;
  out[room_] = point.below;
  out[2 * room_] = point.value;
  for (std::size_t k = 0; k < most_unknowns; ++k)
    out[(3 + k) * room_] = point.derivative[k];
}

GroundPoint GroundPoints::operator[](std::size_t i) const {
  GroundPoint point{list(0)[i], list(1)[i], list(2)[i], {}};
  for (std::size_t k = 0; k < most_unknowns; ++k)
    point.derivative[k] = list(3 + k)[i];
  return point;
}

void PointSelection::select(const PassedView& picture, const GroundCamera& view,
                            std::span<const std::uint8_t> ground, int cell, const PointRule& rule,
                            GroundPoints& points) {
  points.clear();
  points.view = view;
  const int width = picture.width, line = view.vanishing_row >> 8;
  const int first = std::max(line + (picture.height - line) / 10, 1);
  keys_.resize(width);
  ground_.resize(width);
  const auto blocks = [&](int pixels) {
    return static_cast<std::size_t>(std::max((pixels + rule.block - 1) / rule.block, 0));
  };
  points.reserve(blocks(picture.height - 1 - first) * blocks(width - 2));
  // Of equal keys the first one in a block must win: the columns count down in the low bits, below the key's
  // 12 bits.
  order_.resize(width);
  for (int u = 1, k = 0; u < width; ++u, k = k + 1 == rule.block ? 0 : k + 1)
    order_[u] = static_cast<std::uint16_t>(15 - k);
  int spread_row = -1;
  bool any = false; // whether row `spread_row` has ground
  for (int top = first; top < picture.height - 1; top += rule.block) {
    bool filled = false;
    const int rows = std::min(rule.block, picture.height - 1 - top);
    for (int k = 0; k < rows; ++k) {
      const int v = top + k;
      if (v / cell != spread_row) {
        spread_row = v / cell;
        any = spread(ground, std::min(spread_row, picture.height / cell - 1), cell, width / cell);
      }
      if (!any)
        continue;
      if (!filled)
        std::fill(keys_.begin(), keys_.end(), std::uint16_t{0});
      filled = true;
      kernels::steepest(picture.row(v - 1), picture.row(v), picture.row(v + 1), ground_.data(), width, 15 - k,
                        keys_.data());
    }
    if (!filled)
      continue;
    for (int u = 0; u < width; ++u)
      keys_[u] = static_cast<std::uint16_t>(keys_[u] * 16 + order_[u]);
    for (int left = 1; left < width - 1; left += rule.block) {
      const int end = std::min(left + rule.block, width - 1);
      std::uint16_t key = 0;
      for (int u = left; u < end; ++u)
        key = std::max(key, keys_[u]);
      if (key >> 8 > rule.least_slope)
        points.add(point_at(picture, view, left + 15 - (key & 15), top + 15 - (key >> 4 & 15)));
    }
  }
}

/// Expands a row of cells to pixels, `cell` pixels each. Returns whether any cell is ground.
bool PointSelection::spread(std::span<const std::uint8_t> ground, int row, int cell, int columns) {
  const std::uint8_t* from = ground.data() + row * columns;
  std::uint8_t any = 0;
  for (int j = 0; j < columns; ++j)
    any |= from[j];
  if (!any)
    return false;
  std::uint8_t* to = ground_.data();
  if (cell == 1)
    to = std::copy_n(from, columns, to);
  else
    for (int j = 0; j < columns; ++j, to += 4) {
      const std::uint32_t four = 0x01010101U * from[j];
      std::memcpy(to, &four, 4);
    }
  // The pixels to the right of the last whole cell belong to that cell.
  std::fill(to, ground_.data() + ground_.size(), from[columns - 1]);
  return true;
}

void Alignment::reserve(std::size_t points) {
  if (weights_.size() >= points)
    return;
  differences_.resize(whole_vectors(points));
  weights_.resize(whole_vectors(points));
}

int Alignment::measure(const kernels::PointLists& points, const PassedView& earlier, const GroundCamera& view,
                       const PlaneMotion& motion) {
  reserve(static_cast<std::size_t>(points.count));
  return kernels::point_differences(earlier, pixel_map(motion, view), points, differences_.data());
}

std::int32_t Alignment::spread(int count, int inside) const {
  // The median of the sizes in eighths of a grey level, at most 255.
  int median = 0;
  for (int above = 255; median < above;) {
    const int middle = (median + above) / 2;
    if (2 * kernels::count_below(differences_.data(), count, (middle + 1) << 5) >= inside)
      above = middle;
    else
      median = middle + 1;
  }
  return std::max((2 * median + 1) * 16 * 379 / 256, least_spread);
}

template <int unknowns>
Alignment::Step Alignment::step(const GroundPoints& points, const PassedView& earlier, PlaneMotion& motion,
                                std::int64_t& information) {
  const int inside = measure(points.all(), earlier, points.view, motion);
  if (inside < fewest_points)
    return Step::failed;
  const auto count = static_cast<int>(points.size());
  const std::int32_t sigma = spread(count, inside);
  kernels::fit_weights(differences_.data(), count, (8 << 16) / sigma, weights.data(), weights_.data());
  NormalEquations equations;
  equations.unknowns = unknowns;
  kernels::fit_sums({points.derivatives(), static_cast<std::ptrdiff_t>(points.room()), weights_.data(),
                     differences_.data(), count},
                    unknowns, equations.left.data(), equations.right.data());
  const auto found = solve(equations, 24);
  if (!found)
    return Step::failed;
  // Derivatives are in 1 / f and Q11, differences in Q8.
  std::array<std::int64_t, 7> x{};
  std::int64_t most = 0;
  for (int i = 0; i < unknowns; ++i) {
    if (std::abs(found->x[i]) > std::int64_t{1} << 40)
      return Step::failed;
    x[i] = found->x[i] * 8 / points.view.focal;
    most = std::max(most, std::abs(x[i]));
  }
  if (most > largest_step)
    return Step::failed;
  information = found->last_pivot / (std::int64_t{sigma} * sigma >> 8);
  PlaneMotion change;
  change.g = {one_q24, x[0], x[1], x[2], one_q24 + x[3], x[4], -x[1], x[5], one_q24 + x[6]};
  motion = compose(motion, inverse(change));
  return most < small_step ? Step::small : Step::large;
}

bool Alignment::refine(const GroundPoints& points, const PassedView& earlier, int iterations,
                       PlaneMotion& motion) {
  if (points.size() < fewest_points)
    return false;
  PlaneMotion found = motion;
  std::int64_t information = 0;
  for (int i = 0; i < iterations; ++i) {
    const Step taken = step<6>(points, earlier, found, information);
    if (taken == Step::failed)
      return false;
    if (taken == Step::small)
      break;
  }
  motion = found;
  return true;
}

Alignment::LineFit Alignment::fit_line(const GroundPoints& points, const PassedView& earlier, int iterations,
                                       const PlaneMotion& motion) {
  if (points.size() < fewest_points)
    return {};
  PlaneMotion found = motion;
  std::int64_t information = 0;
  for (int i = 0; i < iterations; ++i)
    if (step<7>(points, earlier, found, information) == Step::failed)
      return {};
  return {found.g[8] - one_q24, information};
}

Residual Alignment::residual(const GroundPoints& points, const PassedView& earlier,
                             const PlaneMotion& motion) {
  // A quarter of the points is sufficient.
  const kernels::PointLists lists = points.size() >= 16 * fewest_points ? points.few() : points.all();
  Residual result;
  result.points = measure(lists, earlier, points.view, motion);
  const auto [sum, contrast] = sums_of(lists, differences_.data());
  if (4 * result.points >= fewest_points) {
    result.mean = sum / result.points;
    result.contrast = contrast / result.points;
  }
  return result;
}

} // namespace terrainseg
