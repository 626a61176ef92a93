// SPDX-License-Identifier: LGPL-2.1-or-later
#include "motion/alignment.hpp"

#include <algorithm>
#include <cstdlib>

#include "kernels/ground_warp.hpp"
#include "motion/normal_equations.hpp"

namespace terrainseg {
namespace {

constexpr int clipped_at = 40 << 8;            ///< Q8: a difference counts no more
constexpr int least_spread = 3 << 7;           ///< Q8: 1.5 grey levels
constexpr std::int64_t small_step = 1678;      ///< Q24: 1e-4, a thirtieth of a pixel
constexpr std::int64_t largest_step = 1 << 23; ///< Q24: 0.5

/// 256 / (1 + (z / 2)^2)^2 for z = (k + 1/2) / 8 spreads.
constexpr std::array<std::uint16_t, 64> make_weights() {
  std::array<std::uint16_t, 64> weights{};
  for (int k = 0; k < 64; ++k) {
    const std::int64_t z = 2 * k + 1, one = 1024; // z / 2 = z / 32, squared in Q10
    const std::int64_t base = one + z * z;
    weights[static_cast<std::size_t>(k)] =
        static_cast<std::uint16_t>((256 * one * one + base * base / 2) / (base * base));
  }
  return weights;
}
constexpr auto weights = make_weights();

bool shows(const PassedView& picture, const PixelMap::Position& p) {
  return p.u >= 0 && p.v >= 0 && p.u >> 8 < picture.width - 1 && p.v >> 8 < picture.height - 1;
}

std::int32_t sample(const PassedView& picture, const PixelMap::Position& p) {
  const int u = p.u >> 8, v = p.v >> 8, fu = p.u & 255, fv = p.v & 255;
  const std::uint8_t* at = picture.row(v) + u;
  const std::uint8_t* under = at + picture.width;
  return ((at[0] * (256 - fu) + at[1] * fu) * (256 - fv) + (under[0] * (256 - fu) + under[1] * fu) * fv +
          128) >>
         8;
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

} // namespace

void PointSelection::select(const PassedView& picture, const GroundCamera& view,
                            std::span<const std::uint8_t> ground, int cell, const PointRule& rule,
                            std::vector<GroundPoint>& points) {
  points.clear();
  const int width = picture.width, line = view.vanishing_row >> 8;
  const int first = std::max(line + (picture.height - line) / 10, 1);
  keys_.resize(static_cast<std::size_t>(width));
  ground_.resize(static_cast<std::size_t>(width));
  int spread_row = -1;
  for (int top = first; top < picture.height - 1; top += rule.block) {
    std::fill(keys_.begin(), keys_.end(), std::uint16_t{0});
    const int rows = std::min(rule.block, picture.height - 1 - top);
    for (int k = 0; k < rows; ++k) {
      const int v = top + k;
      if (v / cell != spread_row) {
        spread_row = v / cell;
        const int columns = width / cell, row = std::min(spread_row, picture.height / cell - 1);
        const std::uint8_t* from = ground.data() + static_cast<std::ptrdiff_t>(row) * columns;
        auto to = ground_.begin();
        for (int j = 0; j < columns; ++j)
          to = std::fill_n(to, cell, from[j]);
        // What is left of a picture behind its whole cells belongs to the last of them.
        std::fill(to, ground_.end(), from[columns - 1]);
      }
      kernels::steepest(picture.row(v - 1), picture.row(v), picture.row(v + 1), ground_.data(), width, 15 - k,
                        keys_.data());
    }
    for (int left = 1; left < width - 1; left += rule.block) {
      int best = left;
      for (int u = left + 1; u < std::min(left + rule.block, width - 1); ++u)
        if (keys_[static_cast<std::size_t>(u)] > keys_[static_cast<std::size_t>(best)])
          best = u;
      const int key = keys_[static_cast<std::size_t>(best)];
      if (key >> 4 > rule.least_slope)
        points.push_back(point_at(picture, view, best, top + 15 - (key & 15)));
    }
  }
}

int Alignment::measure(std::span<const GroundPoint> points, const PassedView& earlier, const PixelMap& map) {
  differences_.resize(points.size());
  int inside = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const PixelMap::Position p = map.at(points[i].across, points[i].below);
    const bool seen = shows(earlier, p);
    differences_[i] = seen ? sample(earlier, p) - points[i].value : no_answer;
    inside += seen;
  }
  return inside;
}

std::int32_t Alignment::spread() const {
  std::array<int, 256> bins{};
  int count = 0;
  for (const std::int32_t e : differences_)
    if (e != no_answer) {
      ++bins[static_cast<std::size_t>(std::min(std::abs(e) >> 5, 255))]; // eighths of a grey level
      ++count;
    }
  int median = 0;
  for (int seen = bins[0]; 2 * seen < count; seen += bins[static_cast<std::size_t>(median)])
    ++median;
  return std::max((2 * median + 1) * 16 * 379 / 256, least_spread);
}

template <int unknowns>
Alignment::Step Alignment::step(std::span<const GroundPoint> points, const PassedView& earlier,
                                const GroundCamera& view, PlaneMotion& motion, std::int64_t& information) {
  if (measure(points, earlier, {motion, view}) < fewest_points)
    return Step::failed;
  const std::int32_t sigma = spread();
  const std::int32_t per_index = (8 << 16) / sigma;
  NormalEquations equations;
  equations.unknowns = unknowns;
  auto left = equations.left;
  auto right = equations.right;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const std::int32_t e = differences_[i];
    if (e == no_answer)
      continue;
    const std::int64_t index = (std::int64_t{std::abs(e)} * per_index) >> 16;
    if (index >= 64)
      continue;
    const std::int32_t weight = weights[static_cast<std::size_t>(index)];
    const auto& j = points[i].derivative;
    std::size_t k = 0;
#pragma GCC unroll 7
    for (std::size_t row = 0; row < unknowns; ++row) {
      const std::int32_t weighted = weight * j[row];
#pragma GCC unroll 7
      for (std::size_t column = 0; column <= row; ++column)
        left[k++] += std::int64_t{weighted} * j[column];
      right[row] += std::int64_t{weighted} * e;
    }
  }
  equations.left = left;
  equations.right = right;
  const auto found = solve(equations, 24);
  if (!found)
    return Step::failed;
  // Derivatives are in 1 / f and Q11, differences in Q8.
  std::array<std::int64_t, 7> x{};
  std::int64_t most = 0;
  for (int i = 0; i < unknowns; ++i) {
    if (std::abs(found->x[i]) > std::int64_t{1} << 40)
      return Step::failed;
    x[i] = found->x[i] * 8 / view.focal;
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

bool Alignment::refine(std::span<const GroundPoint> points, const PassedView& earlier,
                       const GroundCamera& view, int iterations, PlaneMotion& motion) {
  if (points.size() < fewest_points)
    return false;
  PlaneMotion found = motion;
  std::int64_t information = 0;
  for (int i = 0; i < iterations; ++i) {
    const Step taken = step<6>(points, earlier, view, found, information);
    if (taken == Step::failed)
      return false;
    if (taken == Step::small)
      break;
  }
  motion = found;
  return true;
}

Alignment::LineFit Alignment::fit_line(std::span<const GroundPoint> points, const PassedView& earlier,
                                       const GroundCamera& view, int iterations, const PlaneMotion& motion) {
  if (points.size() < fewest_points)
    return {};
  PlaneMotion found = motion;
  std::int64_t information = 0;
  for (int i = 0; i < iterations; ++i)
    if (step<7>(points, earlier, view, found, information) == Step::failed)
      return {};
  return {found.g[8] - one_q24, information};
}

Residual Alignment::residual(std::span<const GroundPoint> points, const PassedView& earlier,
                             const GroundCamera& view, const PlaneMotion& motion) {
  // A quarter of the points says it as well.
  const PixelMap map(motion, view);
  const std::size_t step = points.size() >= 16 * fewest_points ? 4 : 1;
  Residual result;
  std::int64_t sum = 0, contrast = 0;
  for (std::size_t i = 0; i < points.size(); i += step) {
    const PixelMap::Position p = map.at(points[i].across, points[i].below);
    if (!shows(earlier, p))
      continue;
    ++result.points;
    sum += std::min(std::abs(sample(earlier, p) - points[i].value), clipped_at);
    contrast += std::min(std::abs(points[i].value - (128 << 8)), clipped_at);
  }
  if (result.points > 0) {
    result.mean = static_cast<int>(sum / result.points);
    result.contrast = static_cast<int>(contrast / result.points);
  }
  return result;
}

} // namespace terrainseg
