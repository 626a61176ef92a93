// SPDX-License-Identifier: LGPL-2.1-or-later
#include "recording/free_space_shapes.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

namespace terrainseg::recording {
namespace {

constexpr float unknown = std::numeric_limits<float>::quiet_NaN();
constexpr float free_way = std::numeric_limits<float>::infinity();
constexpr std::int8_t cell_free = 0, cell_occupied = 100, cell_unknown = -1;

/// The nearer of two, where free is the farthest and unknown is nearer than free.
float nearer(float a, float b) {
  if (std::isfinite(a) && std::isfinite(b))
    return std::min(a, b);
  if (std::isfinite(a) || std::isfinite(b))
    return std::isfinite(a) ? a : b;
  return std::isnan(a) || std::isnan(b) ? unknown : free_way;
}

/// `angle` plus whole turns, within half a turn of `reference`.
double unwrapped(double angle, double reference) {
  return reference + std::remainder(angle - reference, 2 * std::numbers::pi);
}

} // namespace

void Beams::take(const MetricEstimate& metric) {
  columns_.clear();
  for (std::size_t i = 0; i < metric.bearings.size(); ++i)
    if (!std::isnan(metric.bearings[i]))
      columns_.emplace_back(metric.bearings[i], metric.ranges[i]);
  if (columns_.empty()) { // nothing is known of this frame: the view is that of the last
    std::fill(ranges_.begin(), ranges_.end(), unknown);
    return;
  }
  const double middle = columns_[columns_.size() / 2].first;
  for (auto& [angle, range] : columns_)
    angle = unwrapped(angle, middle);
  std::stable_sort(columns_.begin(), columns_.end(),
                   [](const auto& a, const auto& b) { return a.first < b.first; });
  increment_ = 0;
  for (std::size_t i = 1; i < columns_.size(); ++i)
    increment_ = std::max(increment_, columns_[i].first - columns_[i - 1].first);
  angle_min_ = columns_.front().first;
  const auto beam = [&](double angle) {
    return increment_ > 0 ? static_cast<std::size_t>(std::lround((angle - angle_min_) / increment_)) : 0;
  };
  ranges_.assign(beam(columns_.back().first) + 1, free_way);
  for (const auto& [angle, range] : columns_) {
    float& value = ranges_[beam(angle)];
    value = nearer(value, range);
  }
}

const float* Beams::at(double angle) const {
  if (ranges_.empty())
    return nullptr;
  const double half_view = static_cast<double>(ranges_.size() - 1) * increment_ / 2;
  const double offset = unwrapped(angle, angle_min_ + half_view) - angle_min_;
  constexpr double hair = 1e-6; // the width of a beam that is alone, radians
  const double index = std::round(offset / (increment_ > 0 ? increment_ : hair));
  return index >= 0 && index < static_cast<double>(ranges_.size()) ? &ranges_[static_cast<std::size_t>(index)]
                                                                   : nullptr;
}

void boundary_points(std::vector<BoundaryPoint>& points, const MetricEstimate& m) {
  points.clear();
  for (std::size_t i = 0; i < m.ranges.size(); ++i)
    if (std::isfinite(m.ranges[i]) && std::isfinite(m.bearings[i]))
      points.push_back({m.ranges[i] * std::cos(m.bearings[i]), m.ranges[i] * std::sin(m.bearings[i]), 0,
                        m.low[i], m.high[i]});
}

/// Around all that can be seen, to whole metres, so that the small changes of an attitude do not move it.
FreeSpaceGrid::Box FreeSpaceGrid::box_of(const MetricEstimate& m, double cell) {
  double low[2] = {free_way, free_way}, high[2] = {-free_way, -free_way};
  for (const float bearing : m.bearings) {
    if (std::isnan(bearing))
      continue;
    const double along[2] = {std::cos(bearing), std::sin(bearing)};
    for (const double range : {m.range_min, m.range_max})
      for (int axis = 0; axis < 2; ++axis) {
        low[axis] = std::min(low[axis], std::floor(range * along[axis]));
        high[axis] = std::max(high[axis], std::ceil(range * along[axis]));
      }
  }
  Box box{cell, low[0], low[1], 0, 0};
  const double longest = std::max(high[0] - low[0], high[1] - low[1]);
  while (longest / box.resolution > most_cells)
    box.resolution *= 2;
  box.width = std::max(static_cast<int>(std::ceil((high[0] - low[0]) / box.resolution)), 1);
  box.height = std::max(static_cast<int>(std::ceil((high[1] - low[1]) / box.resolution)), 1);
  return box;
}

void FreeSpaceGrid::lay_out(const Box& box) {
  box_ = box;
  places_.clear();
  for (int row = 0; row < box.height; ++row)
    for (int column = 0; column < box.width; ++column) {
      const double x = box.x + (column + 0.5) * box.resolution, y = box.y + (row + 0.5) * box.resolution;
      places_.push_back({static_cast<float>(std::hypot(x, y)), static_cast<float>(std::atan2(y, x))});
    }
}

void FreeSpaceGrid::draw(const MetricEstimate& m, const Beams& beams, double cell) {
  const bool has_view =
      std::any_of(m.bearings.begin(), m.bearings.end(), [](float bearing) { return !std::isnan(bearing); });
  if (has_view)
    if (const Box box = box_of(m, cell); !(box == box_))
      lay_out(box);
  const double thickness = 1.5 * box_.resolution; // no gap on a diagonal
  cells_.clear();
  for (const Polar& place : places_) {
    const float* beam = beams.at(place.angle);
    // The nearest row that is seen is a line across the way, not a circle.
    const double across = std::cos(place.angle - m.yaw);
    const bool in_view =
        beam && across > 0.05 && place.range * across >= m.range_min && place.range <= m.range_max;
    std::int8_t value = cell_unknown;
    if (beam && !std::isnan(*beam) && place.range <= m.range_max) {
      if (place.range >= *beam)
        value = place.range < *beam + thickness ? cell_occupied : cell_unknown;
      else if (in_view)
        value = cell_free;
    }
    cells_.push_back(value);
  }
  stamp_boundary(m);
}

/// What is narrower than a cell may lie beside all centres: where a column's free space ends its cell is
/// occupied.
void FreeSpaceGrid::stamp_boundary(const MetricEstimate& m) {
  for (std::size_t i = 0; i < m.ranges.size(); ++i) {
    if (!std::isfinite(m.ranges[i]) || !std::isfinite(m.bearings[i]))
      continue;
    const double column = (m.ranges[i] * std::cos(m.bearings[i]) - box_.x) / box_.resolution;
    const double row = (m.ranges[i] * std::sin(m.bearings[i]) - box_.y) / box_.resolution;
    if (column >= 0 && row >= 0 && column < box_.width && row < box_.height)
      cells_[static_cast<std::size_t>(row) * static_cast<std::size_t>(box_.width) +
             static_cast<std::size_t>(column)] = cell_occupied;
  }
}

OccupancyGrid FreeSpaceGrid::grid() const {
  return {box_.resolution,
          static_cast<std::uint32_t>(box_.width),
          static_cast<std::uint32_t>(box_.height),
          box_.x,
          box_.y,
          cells_};
}

} // namespace terrainseg::recording
