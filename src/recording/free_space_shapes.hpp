// SPDX-License-Identifier: LGPL-2.1-or-later
// The boundary in metres in the shapes that robots read: beams of equal angles, points, cells of a grid.
#pragma once

#include <cstdint>
#include <vector>

#include "exchange/metric_estimate.hpp"
#include "recording/ros_messages.hpp"

namespace terrainseg::recording {

/// Beams of equal angles over the view; each is the least of the columns in it.
class Beams {
 public:
  /// A column that is not known makes a beam without an obstacle unknown. The beams are as far apart as the
  /// two neighbouring columns that are farthest apart, so that each has one. Of a frame without any bearing
  /// the beams are those of the last, unknown.
  void take(const MetricEstimate& metric);
  bool empty() const { return ranges_.empty(); }  ///< no bearing was ever known
  double angle_min() const { return angle_min_; } ///< of the rightmost, radians; may be below -pi
  double increment() const { return increment_; } ///< 0 when there is only one
  const std::vector<float>& ranges() const {
    return ranges_;
  } ///< from right to left; NaN, +infinity as there
  /// The beam of a direction; nullptr outside the view.
  const float* at(double angle) const;

 private:
  double angle_min_ = 0, increment_ = 0;
  std::vector<float> ranges_;
  std::vector<std::pair<double, float>> columns_;
};

/// Where the free space ends at something: columns that are free as far as range_max, or unknown, give none.
void boundary_points(std::vector<BoundaryPoint>& points, const MetricEstimate& metric);

/// The ground in view as cells. The grid holds the whole view to range_max and moves with the vehicle.
class FreeSpaceGrid {
 public:
  /// `cell` in metres; doubled until a side has at most most_cells.
  void draw(const MetricEstimate& metric, const Beams& beams, double cell);
  OccupancyGrid grid() const; ///< without cells before a view was known

  static constexpr int most_cells = 512;

 private:
  struct Box {
    double resolution = 0, x = 0, y = 0;
    int width = 0, height = 0;
    bool operator==(const Box&) const = default;
  };
  struct Polar {
    float range, angle;
  };
  static Box box_of(const MetricEstimate& metric, double cell);
  void lay_out(const Box& box);
  void stamp_boundary(const MetricEstimate& metric);

  Box box_;
  std::vector<Polar> places_; ///< of the cells' centres, from the body's origin
  std::vector<std::int8_t> cells_;
};

} // namespace terrainseg::recording
