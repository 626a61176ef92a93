// SPDX-License-Identifier: LGPL-2.1-or-later
#include "recording/free_space_shapes.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

namespace terrainseg::recording {
namespace {

constexpr float unknown = std::numeric_limits<float>::quiet_NaN();
constexpr std::int8_t cell_free = 0, cell_occupied = 100, cell_unknown = -1;

/// The nearer of two ranges. Unknown counts as nearer than free.
float nearer(float a, float b) {
  const float least = std::fmin(a, b); // ignores NaN
  return !std::isfinite(least) && (std::isnan(a) || std::isnan(b)) ? unknown : least;
}

/// The bounding box of the fan and the body's origin, rounded outwards to metres, without cells. It is the
/// same for all frames of a stream.
GridPlace box_of(const ScanFan& fan, double range_max, double cell) {
  double low[2] = {0, 0}, high[2] = {0, 0};
  for (std::uint32_t i = 0; i < fan.beams; ++i) {
    const double angle = fan.angle_min + i * fan.increment;
    const double along[2] = {range_max * std::cos(angle), range_max * std::sin(angle)};
    for (int axis = 0; axis < 2; ++axis) {
      low[axis] = std::min(low[axis], std::floor(along[axis]));
      high[axis] = std::max(high[axis], std::ceil(along[axis]));
    }
  }
  GridPlace box{cell, 0, 0, low[0], low[1]};
  const double longest = std::max(high[0] - low[0], high[1] - low[1]);
  while (longest / box.resolution > FreeSpaceGrid::most_cells)
    box.resolution *= 2;
  box.width = std::max(static_cast<std::uint32_t>(std::ceil((high[0] - low[0]) / box.resolution)), 1u);
  box.height = std::max(static_cast<std::uint32_t>(std::ceil((high[1] - low[1]) / box.resolution)), 1u);
  return box;
}

} // namespace

std::optional<std::size_t> Beams::beam_of(double angle) const {
  constexpr double turn = 2 * std::numbers::pi;
  double offset = std::remainder(angle - fan_.angle_min, turn);
  if (offset < -fan_.increment / 2)
    offset += turn;
  const auto beam = static_cast<std::size_t>(std::lround(offset / fan_.increment));
  return beam < ranges_.size() ? std::optional(beam) : std::nullopt;
}

void Beams::take(const MetricEstimate& m) {
  constexpr std::uint32_t half_degrees = 720;
  if (fan_.beams == 0)
    fan_ = m.fan.beams > 0 ? m.fan : whole_circle(half_degrees, m.range_min);
  constexpr float without_column = -1;
  const auto least = static_cast<float>(fan_.range_min);
  ranges_.assign(fan_.beams, without_column);
  for (std::size_t i = 0; i < m.bearings.size(); ++i) {
    const auto beam = std::isnan(m.bearings[i]) ? std::nullopt : beam_of(m.bearings[i]);
    if (!beam)
      continue;
    const float range = m.ranges[i] < least ? least : m.ranges[i];
    float& value = ranges_[*beam];
    value = value == without_column ? range : nearer(value, range);
  }
  std::replace(ranges_.begin(), ranges_.end(), without_column, unknown);
}

void boundary_points(std::vector<BoundaryPoint>& points, const MetricEstimate& m) {
  points.clear();
  for (std::size_t i = 0; i < m.ranges.size(); ++i)
    if (std::isfinite(m.ranges[i]) && std::isfinite(m.bearings[i]))
      points.push_back({m.ranges[i] * std::cos(m.bearings[i]), m.ranges[i] * std::sin(m.bearings[i]), 0,
                        m.low[i], m.high[i]});
}

void FreeSpaceGrid::lay_out(const Beams& beams) {
  fan_ = beams.fan();
  yaw_.reset();
  places_.clear();
  for (std::uint32_t row = 0; row < grid_.height; ++row)
    for (std::uint32_t column = 0; column < grid_.width; ++column) {
      const double x = grid_.x + (column + 0.5) * grid_.resolution,
                   y = grid_.y + (row + 0.5) * grid_.resolution;
      const auto range = static_cast<float>(std::hypot(x, y)), angle = static_cast<float>(std::atan2(y, x));
      if (const auto beam = beams.beam_of(angle))
        places_.push_back({std::size_t{row} * grid_.width + column, *beam, range, angle, 0});
    }
}

void FreeSpaceGrid::draw(const MetricEstimate& m, const Beams& beams, double cell) {
  if (const GridPlace box = box_of(beams.fan(), m.range_max, cell); box != grid_ || beams.fan() != fan_) {
    grid_ = {box, {}};
    lay_out(beams);
  }
  if (yaw_ != m.yaw)
    for (Place& place : places_)
      place.across = std::cos(place.angle - m.yaw);
  yaw_ = m.yaw;
  const double thickness = 1.5 * grid_.resolution; // no gap on a diagonal
  cells_.assign(std::size_t{grid_.width} * grid_.height, cell_unknown);
  grid_.cells = cells_;
  for (const Place& place : places_) {
    const float beam = beams.ranges()[place.beam];
    if (std::isnan(beam) || place.range > m.range_max)
      continue;
    // The nearest row that is seen is a line across the way, not a circle.
    const bool in_view = place.across > 0.05 && place.range * place.across >= m.range_min;
    if (place.range >= beam)
      cells_[place.cell] = place.range < beam + thickness ? cell_occupied : cell_unknown;
    else if (in_view)
      cells_[place.cell] = cell_free;
  }
  // An obstacle narrower than a cell may lie between all centres: the cells in which the free space of a
  // column ends are occupied.
  boundary_points(points_, m);
  for (const BoundaryPoint& point : points_) {
    const double column = (point.x - grid_.x) / grid_.resolution,
                 row = (point.y - grid_.y) / grid_.resolution;
    if (column >= 0 && row >= 0 && column < grid_.width && row < grid_.height)
      cells_[static_cast<std::size_t>(row) * grid_.width + static_cast<std::size_t>(column)] = cell_occupied;
  }
}

} // namespace terrainseg::recording
