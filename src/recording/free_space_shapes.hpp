// SPDX-License-Identifier: LGPL-2.1-or-later
// Converts the boundary in metres to the shapes of robot messages: beams of equal angles, points, grid cells.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "exchange/metric_estimate.hpp"
#include "recording/ros_messages.hpp"

namespace terrainseg::recording {

/// Beams of equal angles as REP 117 defines them. A beam has the shortest range of the columns in it.
class Beams {
 public:
  /// All frames use the fan of the first frame, or all directions if that frame gives no fan. A beam is NaN
  /// if it has no column, or an unknown column and no obstacle. Columns outside the fan are ignored.
  void take(const MetricEstimate& metric);
  const ScanFan& fan() const { return fan_; }
  /// From right to left; NaN = unknown, +infinity = free.
  const std::vector<float>& ranges() const { return ranges_; }
  /// The number of the beam of a direction; nothing outside the fan.
  std::optional<std::size_t> beam_of(double angle) const;

 private:
  ScanFan fan_;
  std::vector<float> ranges_;
};

/// The points where the free space ends at an obstacle. Columns that are unknown or free up to range_max give
/// none.
void boundary_points(std::vector<BoundaryPoint>& points, const MetricEstimate& metric);

/// The visible ground as grid cells. The grid covers the whole fan up to range_max and moves with the
/// vehicle.
class FreeSpaceGrid {
 public:
  /// `cell` is the size of a cell in metres. It is doubled until no side has more than most_cells.
  void draw(const MetricEstimate& metric, const Beams& beams, double cell);
  const OccupancyGrid& grid() const { return grid_; } ///< empty before the first draw()

  static constexpr int most_cells = 512;

 private:
  /// A cell whose centre lies in the fan; the others are unknown.
  struct Place {
    std::size_t cell, beam;
    float range, angle; ///< of the centre, from the body's origin
    double across;      ///< cosine of its angle to the camera's axis
  };
  void lay_out(const Beams& beams);

  OccupancyGrid grid_;
  ScanFan fan_;
  std::optional<double> yaw_; ///< of `across`
  std::vector<Place> places_;
  std::vector<std::int8_t> cells_;
  std::vector<BoundaryPoint> points_;
};

} // namespace terrainseg::recording
