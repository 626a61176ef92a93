// SPDX-License-Identifier: LGPL-2.1-or-later
#include "metric/ground_blocks.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "kernels/targets.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "metric/ground_blocks.cpp"
#include <hwy/foreach_target.h>
// After foreach_target.h, as Highway demands.
#include <hwy/highway.h>

// Straight-line loops, of which the compiler makes vectors for each target. No product is fused with a sum
// (meson.build), so that every target gives the same bits.
HWY_BEFORE_NAMESPACE();
namespace terrainseg::metric {
namespace HWY_NAMESPACE {

constexpr double millidegree = std::numbers::pi / 180000, per_millidegree = 180000 / std::numbers::pi;
constexpr double near_angle = 0.18; ///< below it five terms of the series are exact to 1e-9

/// Rounded to a whole number, without a call: good below 2^51, and of floats below 2^22.
HWY_INLINE double whole(double value) {
  constexpr double shift = 6755399441055744.0; // 1.5 * 2^52
  return (value + shift) - shift;
}
HWY_INLINE float whole(float value) {
  constexpr float shift = 12582912; // 1.5 * 2^23
  return (value + shift) - shift;
}

/// Forward and left on the ground, of a block's rays.
template <typename Real>
HWY_INLINE void project(const GroundProjection& ground, const Real* HWY_RESTRICT x,
                        const Real* HWY_RESTRICT y, Real* HWY_RESTRICT forward, Real* HWY_RESTRICT left) {
  Real r[3][3];
  for (int axis = 0; axis < 3; ++axis)
    for (int i = 0; i < 3; ++i)
      r[axis][i] = static_cast<Real>(ground.row(axis)[i]);
  const Real height = static_cast<Real>(ground.height()), ahead = static_cast<Real>(ground.x()),
             aside = static_cast<Real>(ground.y()), least = static_cast<Real>(least_descent);
  for (std::size_t i = 0; i < block_columns; ++i) {
    const Real down = r[2][1] * x[i] + r[2][2] * y[i] - r[2][0];
    // At and above the horizon: so far away that it is beyond any range_max, in the ray's own direction.
    const Real t = height / std::max(down, least);
    forward[i] = ahead + t * (r[0][0] - r[0][1] * x[i] - r[0][2] * y[i]);
    left[i] = aside + t * (r[1][0] - r[1][1] * x[i] - r[1][2] * y[i]);
  }
}

/// Metres of a block's ends, to millimetres where they are not `beyond` range_max.
template <typename Real>
HWY_INLINE void round_ranges(const Real* HWY_RESTRICT forward, const Real* HWY_RESTRICT left,
                             const float* HWY_RESTRICT beyond, Real range_max, float* HWY_RESTRICT out) {
  constexpr Real endless = std::numeric_limits<Real>::infinity();
  Real ends[block_columns];
  for (std::size_t i = 0; i < block_columns; ++i) {
    const Real range = std::sqrt(forward[i] * forward[i] + left[i] * left[i]);
    const Real rounded = whole(range * 1000) * static_cast<Real>(0.001);
    ends[i] = range > range_max ? endless : rounded; // a NaN of a ray that the lens does not have stays one
  }
  for (std::size_t i = 0; i < block_columns; ++i) {
    const float narrow = static_cast<float>(ends[i]), otherwise = beyond[i];
    out[i] = narrow == std::numeric_limits<float>::infinity() ? otherwise : narrow;
  }
}

/// One arc tangent, of the middle column; the others by their angle to it: d - d^3 / 3 + d^5 / 5 - ...
HWY_INLINE void find_bearings(const double* HWY_RESTRICT forward, const double* HWY_RESTRICT left,
                              std::size_t columns, float* HWY_RESTRICT bearings) {
  const std::size_t middle = columns / 2;
  const double reference = std::atan2(left[middle], forward[middle]);
  const double x0 = forward[middle], y0 = left[middle];
  double angle[block_columns], wide[block_columns];
  for (std::size_t i = 0; i < block_columns; ++i) {
    const double across = x0 * left[i] - y0 * forward[i], along = x0 * forward[i] + y0 * left[i];
    const double d = across / along, d2 = d * d;
    const double series = d * (1 - d2 * (1.0 / 3 - d2 * (1.0 / 5 - d2 * (1.0 / 7 - d2 * (1.0 / 9)))));
    double turned = reference + series; // of a camera that looks back, over half a turn
    turned = turned > std::numbers::pi ? turned - 2 * std::numbers::pi : turned;
    turned = turned < -std::numbers::pi ? turned + 2 * std::numbers::pi : turned;
    angle[i] = whole(turned * per_millidegree) * millidegree;
    wide[i] = along > 0 ? d2 : 1; // a NaN is as narrow as any
  }
  for (std::size_t i = 0; i < columns; ++i)
    if (wide[i] >= near_angle * near_angle)
      angle[i] = whole(std::atan2(left[i], forward[i]) * per_millidegree) * millidegree;
  for (std::size_t i = 0; i < block_columns; ++i)
    bearings[i] = static_cast<float>(angle[i]);
}

void measure(const RayBlock& rays, std::size_t columns, const GroundProjection (&grounds)[3],
             double range_max, RangeBlock& block) {
  double forward[block_columns], left[block_columns];
  project(grounds[0], rays.x, rays.y, forward, left);
  round_ranges(forward, left, rays.beyond, range_max, block.ranges);
  find_bearings(forward, left, columns, block.bearings);
  // How far it may be off needs no more than single precision: a tenth of a millimetre at 30 m.
  float x[block_columns], y[block_columns], narrow_forward[block_columns], narrow_left[block_columns];
  for (std::size_t i = 0; i < block_columns; ++i) {
    x[i] = static_cast<float>(rays.x[i]);
    y[i] = static_cast<float>(rays.y[i]);
  }
  for (int g = 1; g < 3; ++g) {
    project(grounds[g], x, y, narrow_forward, narrow_left);
    round_ranges(narrow_forward, narrow_left, rays.beyond, static_cast<float>(range_max),
                 g == 1 ? block.low : block.high);
  }
}

} // namespace HWY_NAMESPACE
} // namespace terrainseg::metric
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace terrainseg::metric {

HWY_EXPORT(measure);

decltype(measure) measure = kernels::dispatched([] { return &HWY_DYNAMIC_DISPATCH(measure); });

} // namespace terrainseg::metric
#endif
