// SPDX-License-Identifier: LGPL-2.1-or-later
#include "metric/free_space_ranges.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <numbers>
#include <utility>

#include "kernels/targets.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "metric/free_space_ranges.cpp"
#include <hwy/foreach_target.h>
// After foreach_target.h, as Highway demands.
#include <hwy/highway.h>

// From rays to ranges and bearings: straight-line loops, of which the compiler makes vectors for each target.
// No product is fused with a sum (meson.build), so that every target gives the same bits.
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

// `grounds`: as the camera stands, and pitched by one standard deviation down and up. Writes the values of
// the columns from `first` on; at least one.
void measure_block(const RayBlock& rays, std::size_t first, std::size_t columns,
                   const GroundProjection (&grounds)[3], double range_max, RangeColumns& out) {
  float ranges[block_columns], bearings[block_columns], low[block_columns], high[block_columns];
  double forward[block_columns], left[block_columns];
  project(grounds[0], rays.x, rays.y, forward, left);
  round_ranges(forward, left, rays.beyond, range_max, ranges);
  find_bearings(forward, left, columns, bearings);
  // How far it may be off needs no more than single precision: a tenth of a millimetre at 30 m.
  float x[block_columns], y[block_columns], narrow_forward[block_columns], narrow_left[block_columns];
  for (std::size_t i = 0; i < block_columns; ++i) {
    x[i] = static_cast<float>(rays.x[i]);
    y[i] = static_cast<float>(rays.y[i]);
  }
  for (int g = 1; g < 3; ++g) {
    project(grounds[g], x, y, narrow_forward, narrow_left);
    round_ranges(narrow_forward, narrow_left, rays.beyond, static_cast<float>(range_max),
                 g == 1 ? low : high);
  }
  std::copy_n(ranges, columns, &out.ranges[first]);
  std::copy_n(bearings, columns, &out.bearings[first]);
  std::copy_n(low, columns, &out.low[first]);
  std::copy_n(high, columns, &out.high[first]);
}

} // namespace HWY_NAMESPACE
} // namespace terrainseg::metric
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace terrainseg::metric {

HWY_EXPORT(measure_block);

namespace {

constexpr int node_rows =
    8; ///< a lens bends so little between two nodes that a straight line is exact to 1e-5
constexpr float unknown_value = std::numeric_limits<float>::quiet_NaN();
constexpr float free_value = std::numeric_limits<float>::infinity();
constexpr double range_error_limit = 0.2;
Mount pitched(Mount mount, double by) {
  mount.pitch += by;
  return mount;
}

} // namespace

double angle_error(const Mount& mount, const Camera& camera, double row_error) {
  return std::hypot(mount.pitch_error, row_error / camera.fy);
}

double expected_range_limit(const Mount& mount, const Camera& camera, int frame_height) {
  const double rows = row_error_of_height * frame_height;
  return range_error_limit * mount.height /
         angle_error(mount, scaled(camera, camera.width, frame_height), rows);
}

void FreeSpaceRanges::adapt(const Camera& camera, int frame_width, int frame_height,
                            const Rectangle& mask_region, int columns) {
  const std::size_t count = static_cast<std::size_t>(std::max(columns, 0));
  if (camera == calibration_ && camera_.width == frame_width && camera_.height == frame_height &&
      mask_region == region_ && result_.ranges.size() == count)
    return;
  calibration_ = {}; // of no camera until all is there: memory may run out in between
  camera_ = scaled(camera, frame_width, frame_height);
  region_ = mask_region;
  const std::size_t rows = static_cast<std::size_t>(frame_height / node_rows) + 2;
  nodes_.resize(rows * count);
  for (std::size_t i = 0; i < count; ++i) {
    const double u = region_.x + (static_cast<double>(i) + 0.5) * region_.width / columns - 0.5;
    for (std::size_t k = 0; k < rows; ++k)
      nodes_[k * count + i] = undistort(camera_, u, static_cast<double>(k * node_rows))
                                  .value_or(ImagePoint{unknown_value, unknown_value});
  }
  for (auto* values : {&result_.ranges, &result_.bearings, &result_.low, &result_.high})
    values->assign(count, unknown_value);
  calibration_ = camera;
}

/// The ray through the upper edge of `row`: half a row above its centre.
ImagePoint FreeSpaceRanges::ray(std::size_t column, int row) const {
  constexpr unsigned halves_of_node = 2 * node_rows;
  const std::size_t columns = result_.ranges.size();
  const unsigned halves = static_cast<unsigned>(std::max(2 * row - 1, 0)); // of a row
  const double part = static_cast<int>(halves % halves_of_node) * (1.0 / halves_of_node);
  const ImagePoint* const above = &nodes_[halves / halves_of_node * columns + column];
  const ImagePoint* const below = above + columns;
  return {above->x + (below->x - above->x) * part, above->y + (below->y - above->y) * part};
}

/// The rays of `columns` columns from `first` on.
RayBlock FreeSpaceRanges::rays(std::size_t first, std::size_t columns,
                               std::span<const std::uint16_t> boundary) const {
  RayBlock block;
  for (std::size_t i = 0; i < columns; ++i) {
    const int row = std::min<int>(boundary[first + i], camera_.height);
    const ImagePoint seen = ray(first + i, row);
    block.x[i] = seen.x;
    block.y[i] = seen.y;
    block.beyond[i] = row < camera_.height ? free_value : unknown_value;
  }
  std::fill(block.x + columns, std::end(block.x), block.x[columns - 1]);
  std::fill(block.y + columns, std::end(block.y), block.y[columns - 1]);
  std::fill(block.beyond + columns, std::end(block.beyond), unknown_value);
  return block;
}

double FreeSpaceRanges::nearest(const Mount& mount) const {
  constexpr std::size_t places = 16; // the nearest row is a smooth curve on the ground
  const GroundProjection ground(mount);
  const std::size_t columns = result_.ranges.size();
  double least = free_value;
  for (std::size_t i = 0; i <= places && columns > 0; ++i)
    if (const auto point = ground(ray(i * (columns - 1) / places, camera_.height)))
      least = std::min(least, std::hypot(point->x, point->y));
  return least;
}

std::optional<GroundView> FreeSpaceRanges::view(const Mount& mount, double sway) const {
  GroundView view{free_value, -free_value, 0};
  const int columns = static_cast<int>(result_.ranges.size());
  for (const auto& [pitch, roll] :
       {std::pair(0.0, 0.0), {sway, 0.0}, {-sway, 0.0}, {0.0, sway}, {0.0, -sway}}) {
    Mount swayed = pitched(mount, pitch);
    swayed.roll += roll;
    const GroundProjection ground(swayed);
    for (int row = 0; row < camera_.height + node_rows; row += node_rows) {
      double last = unknown_value;
      for (int i = 0; i < columns; ++i) {
        const auto point = ground(ray(static_cast<std::size_t>(i), std::min(row, camera_.height)));
        const double angle =
            point ? std::remainder(std::atan2(point->y, point->x) - mount.yaw, 2 * std::numbers::pi)
                  : static_cast<double>(unknown_value);
        if (pitch == 0 && roll == 0 && std::abs(angle - last) < std::numbers::pi)
          view.widest_step = std::max(view.widest_step, std::abs(angle - last));
        last = angle;
        view.right = std::fmin(view.right, angle);
        view.left = std::fmax(view.left, angle);
      }
    }
  }
  if (!(view.right <= view.left))
    return std::nullopt;
  view.right += mount.yaw;
  view.left += mount.yaw;
  return view;
}

const RangeColumns& FreeSpaceRanges::measure(std::span<const std::uint16_t> boundary, bool unknown,
                                             const Mount& mount, double range_max) {
  const double error = angle_error(mount, camera_, row_error_of_height * camera_.height);
  const GroundProjection grounds[3] = {GroundProjection(mount), GroundProjection(pitched(mount, error)),
                                       GroundProjection(pitched(mount, -error))};
  if (unknown || boundary.size() != result_.ranges.size()) {
    for (auto* values : {&result_.ranges, &result_.bearings, &result_.low, &result_.high})
      std::fill(values->begin(), values->end(), unknown_value);
    return result_;
  }
  for (std::size_t first = 0; first < boundary.size(); first += block_columns) {
    const std::size_t columns = std::min(block_columns, boundary.size() - first);
    HWY_DYNAMIC_DISPATCH(measure_block)
    (rays(first, columns, boundary), first, columns, grounds, range_max, result_);
  }
  return result_;
}

} // namespace terrainseg::metric
#endif
