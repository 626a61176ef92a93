// SPDX-License-Identifier: LGPL-2.1-or-later
#include "metric/free_space_ranges.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <numbers>
#include <utility>

#include "metric/ground_blocks.hpp"

namespace terrainseg::metric {
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
  if (camera == calibration_ && camera_.width == frame_width && frame_height_ == frame_height &&
      mask_region == region_ && result_.ranges.size() == count)
    return;
  calibration_ = {}; // of no camera until all is there: memory may run out in between
  camera_ = scaled(camera, frame_width, frame_height);
  region_ = mask_region;
  frame_height_ = frame_height;
  columns_ = count;
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
  const unsigned halves = static_cast<unsigned>(std::max(2 * row - 1, 0)); // of a row
  const double part = static_cast<int>(halves % halves_of_node) * (1.0 / halves_of_node);
  const ImagePoint* const above = &nodes_[halves / halves_of_node * columns_ + column];
  const ImagePoint* const below = above + columns_;
  return {above->x + (below->x - above->x) * part, above->y + (below->y - above->y) * part};
}

/// The rays of `columns` columns from `first` on.
RayBlock FreeSpaceRanges::rays(std::size_t first, std::size_t columns,
                               std::span<const std::uint16_t> boundary) const {
  RayBlock block;
  for (std::size_t i = 0; i < columns; ++i) {
    const int row = std::min<int>(boundary[first + i], frame_height_);
    const ImagePoint seen = ray(first + i, row);
    block.x[i] = seen.x;
    block.y[i] = seen.y;
    block.beyond[i] = row < frame_height_ ? free_value : unknown_value;
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
    if (const auto point = ground(ray(i * (columns - 1) / places, frame_height_)))
      least = std::min(least, std::hypot(point->x, point->y));
  return least;
}

std::optional<GroundView> FreeSpaceRanges::view(const Mount& mount, double sway) const {
  GroundView view{free_value, -free_value, 0};
  const int columns = static_cast<int>(columns_);
  for (const auto& [pitch, roll] :
       {std::pair(0.0, 0.0), {sway, 0.0}, {-sway, 0.0}, {0.0, sway}, {0.0, -sway}}) {
    Mount swayed = pitched(mount, pitch);
    swayed.roll += roll;
    const GroundProjection ground(swayed);
    for (int row = 0; row < frame_height_ + node_rows; row += node_rows) {
      double last = unknown_value;
      for (int i = 0; i < columns; ++i) {
        const auto point = ground(ray(static_cast<std::size_t>(i), std::min(row, frame_height_)));
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
  const double error = angle_error(mount, camera_, row_error_of_height * frame_height_);
  const GroundProjection grounds[3] = {GroundProjection(mount), GroundProjection(pitched(mount, error)),
                                       GroundProjection(pitched(mount, -error))};
  if (unknown || boundary.size() != result_.ranges.size()) {
    for (auto* values : {&result_.ranges, &result_.bearings, &result_.low, &result_.high})
      std::fill(values->begin(), values->end(), unknown_value);
    return result_;
  }
  for (std::size_t first = 0; first < boundary.size(); first += block_columns) {
    const std::size_t columns = std::min(block_columns, boundary.size() - first);
    RangeBlock block;
    metric::measure(rays(first, columns, boundary), columns, grounds, range_max, block);
    std::copy_n(block.ranges, columns, &result_.ranges[first]);
    std::copy_n(block.bearings, columns, &result_.bearings[first]);
    std::copy_n(block.low, columns, &result_.low[first]);
    std::copy_n(block.high, columns, &result_.high[first]);
  }
  return result_;
}

} // namespace terrainseg::metric
