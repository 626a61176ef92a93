// SPDX-License-Identifier: LGPL-2.1-or-later
#include "metric/free_space_ranges.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

namespace terrainseg::metric {
namespace {

constexpr int node_rows =
    8; ///< a lens bends so little between two nodes that a straight line is exact to 1e-5
constexpr float unknown_value = std::numeric_limits<float>::quiet_NaN();
constexpr float free_value = std::numeric_limits<float>::infinity();
constexpr double range_error_limit = 0.2;
constexpr double millidegree = std::numbers::pi / 180000;
constexpr double near_angle = 0.06; ///< below it three terms of the series are exact to 1e-9

constexpr std::size_t block = 8; ///< columns that share one arc tangent

/// Rounded to a whole number, without a call: good below 2^51.
double whole(double value) {
  constexpr double shift = 6755399441055744.0; // 1.5 * 2^52
  return (value + shift) - shift;
}

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
  if (camera == calibration_ && camera_.width == frame_width && frame_height_ == frame_height &&
      mask_region == region_ && result_.ranges.size() == count)
    return;
  calibration_ = {}; // of no camera until all is there: memory may run out in between
  camera_ = scaled(camera, frame_width, frame_height);
  region_ = mask_region;
  frame_height_ = frame_height;
  rows_ = static_cast<std::size_t>(frame_height / node_rows) + 2;
  nodes_.resize(count * rows_);
  for (std::size_t i = 0; i < count; ++i) {
    const double u = region_.x + (static_cast<double>(i) + 0.5) * region_.width / columns - 0.5;
    for (std::size_t k = 0; k < rows_; ++k)
      nodes_[i * rows_ + k] = undistort(camera_, u, static_cast<double>(k * node_rows))
                                  .value_or(ImagePoint{unknown_value, unknown_value});
  }
  for (auto* values : {&result_.ranges, &result_.bearings, &result_.low, &result_.high})
    values->assign(count, unknown_value);
  calibration_ = camera;
}

/// The ray through the upper edge of `row`: half a row above its centre.
ImagePoint FreeSpaceRanges::ray(std::size_t column, int row) const {
  const double v = std::max(row - 0.5, 0.0);
  const std::size_t k = static_cast<std::size_t>(v) / node_rows;
  const double part = v / node_rows - static_cast<double>(k);
  const ImagePoint &above = nodes_[column * rows_ + k], &below = nodes_[column * rows_ + k + 1];
  return {above.x + (below.x - above.x) * part, above.y + (below.y - above.y) * part};
}

/// Columns first .. first + block - 1, as far as there are: straight-line code that compilers make vectors
/// of.
void FreeSpaceRanges::measure_block(std::size_t first, std::span<const std::uint16_t> boundary,
                                    const GroundProjection (&grounds)[3], double range_max) {
  const std::size_t count = std::min(block, boundary.size() - first);
  double x[block]{}, y[block]{};
  for (std::size_t i = 0; i < count; ++i) {
    const ImagePoint seen = ray(first + i, std::min<int>(boundary[first + i], frame_height_));
    x[i] = seen.x;
    y[i] = seen.y;
  }
  float* const out[3] = {&result_.ranges[first], &result_.low[first], &result_.high[first]};
  double forward[block], left[block];
  for (int g = 2; g >= 0; --g) {
    const GroundProjection& ground = grounds[g];
    for (std::size_t i = 0; i < block; ++i) {
      const ImagePoint seen{x[i], y[i]};
      const double down = -ground.along(2, seen);
      // At and above the horizon: so far away that it is beyond any range_max, in the ray's own direction.
      const double t = ground.height() / std::max(down, least_descent);
      forward[i] = ground.x() + t * ground.along(0, seen);
      left[i] = ground.y() + t * ground.along(1, seen);
    }
    for (std::size_t i = 0; i < count; ++i) {
      const double range = std::sqrt(forward[i] * forward[i] + left[i] * left[i]);
      const float rounded = static_cast<float>(whole(range * 1000) / 1000);
      const float beyond = boundary[first + i] < frame_height_ ? free_value : unknown_value;
      out[g][i] =
          range > range_max ? beyond : rounded; // a NaN of a ray that the lens does not have stays one
    }
  }
  // One arc tangent a block, from its middle column; the others by their angle to it: d - d^3 / 3 + d^5 / 5.
  const std::size_t middle = count / 2;
  const double reference = std::atan2(left[middle], forward[middle]);
  for (std::size_t i = 0; i < count; ++i) {
    const double across = forward[middle] * left[i] - left[middle] * forward[i];
    const double along = forward[middle] * forward[i] + left[middle] * left[i];
    const double d = across / along, d2 = d * d;
    const double angle = std::abs(d) < near_angle && along > 0 ? reference + d * (1 - d2 * (1.0 / 3 - d2 / 5))
                                                               : std::atan2(left[i], forward[i]);
    result_.bearings[first + i] = static_cast<float>(whole(angle / millidegree) * millidegree);
  }
}

double FreeSpaceRanges::nearest(const Mount& mount) const {
  constexpr std::size_t places = 16; // the nearest row is a smooth curve on the ground
  const GroundProjection ground(mount);
  const std::size_t columns = result_.ranges.size();
  double least = free_value;
  for (std::size_t i = 0; i <= places && columns > 0; ++i)
    if (const auto point = ground(ray(i * (columns - 1) / places, frame_height_)))
      least = std::min(least, std::hypot(point->x, point->y));
  return least;
}

const RangeColumns& FreeSpaceRanges::measure(std::span<const std::uint16_t> boundary, bool unknown,
                                             const Mount& mount, double range_max) {
  const double error = angle_error(mount, camera_, row_error_of_height * frame_height_);
  const GroundProjection grounds[3] = {GroundProjection(mount), GroundProjection(pitched(mount, error)),
                                       GroundProjection(pitched(mount, -error))};
  if (unknown || boundary.size() != result_.ranges.size()) {
    for (auto* values : {&result_.ranges, &result_.bearings, &result_.low, &result_.high})
      std::fill(values->begin(), values->end(), unknown_value);
    return result_;
  }
  for (std::size_t first = 0; first < boundary.size(); first += block)
    measure_block(first, boundary, grounds, range_max);
  return result_;
}

} // namespace terrainseg::metric
