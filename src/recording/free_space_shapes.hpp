// SPDX-License-Identifier: LGPL-2.1-or-later
// The boundary in metres in the shapes that robots read: beams of equal angles, points, cells of a grid.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "exchange/metric_estimate.hpp"
#include "recording/ros_messages.hpp"

namespace terrainseg::recording {

/// Beams of equal angles, by REP 117; each is the least of the columns in it.
class Beams {
 public:
  /// The fan is that of the first frame, also for all frames after it; all directions where that one states
  /// none. A beam without a column is NaN, as is one with a column that is not known and no obstacle.
  /// Columns outside the fan are in no beam.
  void take(const MetricEstimate& metric);
  const ScanFan& fan() const { return fan_; }
  const std::vector<float>& ranges() const {
    return ranges_;
  } ///< from right to left; NaN unknown, +infinity free
  /// The beam of a direction; nullptr outside the fan.
  const float* at(double angle) const;
  /// Its number; nothing outside the fan.
  std::optional<std::size_t> beam_of(double angle) const;

 private:
  ScanFan fan_;
  std::vector<float> ranges_;
};

/// Where the free space ends at something: columns that are free as far as range_max, or unknown, give none.
void boundary_points(std::vector<BoundaryPoint>& points, const MetricEstimate& metric);

/// The ground in view as cells. The grid holds the whole fan to range_max and moves with the vehicle.
class FreeSpaceGrid {
 public:
  /// `cell` in metres; doubled until a side has at most most_cells.
  void draw(const MetricEstimate& metric, const Beams& beams, double cell);
  OccupancyGrid grid() const; ///< without cells before the first draw()

  static constexpr int most_cells = 512;

 private:
  struct Box {
    double resolution = 0, x = 0, y = 0;
    int width = 0, height = 0;
    bool operator==(const Box&) const = default;
  };
  /// A cell whose centre lies in the fan; the others are unknown.
  struct Place {
    std::size_t cell, beam;
    float range, angle; ///< of the centre, from the body's origin
    double across;      ///< cosine of its angle to the camera's axis
  };
  static Box box_of(const ScanFan& fan, double range_max, double cell);
  void lay_out(const Box& box, const Beams& beams);
  void turn(double yaw);
  void stamp_boundary(const MetricEstimate& metric);

  Box box_;
  ScanFan fan_;
  std::optional<double> yaw_; ///< of `across`
  std::vector<Place> places_;
  std::vector<std::int8_t> cells_;
};

} // namespace terrainseg::recording
