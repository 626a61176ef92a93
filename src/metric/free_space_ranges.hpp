// SPDX-License-Identifier: LGPL-2.1-or-later
// The free space's boundary in metres: for each of its columns how far one can drive, and in which direction.
//
// Only the boundary is projected: the base of an obstacle stands on the ground plane, the rest of it does
// not.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "metric/mount.hpp"
#include "terrainseg/frame.hpp"

namespace terrainseg::metric {

/// One value a mask column, rounded to millimetres and to 0.001 degrees. Single precision carries both.
struct RangeColumns {
  /// Metres over ground from the body's origin to where the free space ends; +infinity = free as far as
  /// range_max, NaN = unknown. A column without free space ends at the nearest row that is seen; where even
  /// that one is beyond range_max, it is unknown.
  std::vector<float> ranges;
  std::vector<float> bearings; ///< radians, counter-clockwise from straight ahead; NaN = unknown
  /// The range if the ray were one standard deviation steeper and shallower; NaN, +infinity as above.
  std::vector<float> low, high;
};

/// What is not known of a ray's angle, one standard deviation, in radians: the mount's pitch and the
/// boundary's row, `row_error` rows of the frame.
double angle_error(const Mount& mount, const Camera& camera, double row_error);

/// How far a boundary that follows the right edge is off, as a share of the frame's height: assumed. A
/// boundary on the wrong edge is not in it: 47 to 72 % of columns end within 2 % (docs/data/accuracy.csv).
inline constexpr double row_error_of_height = 0.005;

/// Metres at which one standard deviation of the angle is 20 % of the range: d^2 / h * error = 0.2 d.
double expected_range_limit(const Mount& mount, const Camera& camera, int frame_height);

/// What a camera may see of the ground, as directions from the body's origin, radians counter-clockwise.
struct GroundView {
  double right = 0, left = 0;
  double widest_step = 0; ///< between two neighbouring columns on one row
};

/// Columns that are measured at once. They share one arc tangent.
inline constexpr std::size_t block_columns = 64;

/// The rays (x, y, 1) through the ends of neighbouring columns, NaN where the lens has none. The last ray is
/// repeated to fill the block.
struct RayBlock {
  double x[block_columns], y[block_columns];
  float beyond[block_columns]; ///< what stands for a range beyond range_max: +infinity, or NaN
};

class FreeSpaceRanges {
 public:
  /// Takes a calibration for frames of one size and masks of one layout; makes tables only when something
  /// changed.
  void adapt(const Camera& camera, int frame_width, int frame_height, const Rectangle& mask_region,
             int columns);

  /// `boundary` as Estimate::boundary. `unknown`: nothing is known of this frame. `mount` with the attitude
  /// of the moment. Ranges beyond `range_max` (metres) are free.
  const RangeColumns& measure(std::span<const std::uint16_t> boundary, bool unknown, const Mount& mount,
                              double range_max);

  /// Metres of the nearest ground in the picture: what measure() gives where nothing is free. +infinity when
  /// no row of the mask shows ground.
  double nearest(const Mount& mount) const;
  /// Where ground is seen while the vehicle pitches and rolls by up to `sway` about `mount`. The directions
  /// at `mount` alone count for the step. Nothing when no row shows ground.
  std::optional<GroundView> view(const Mount& mount, double sway) const;
  /// The calibration for frames of the size that adapt() was told.
  const Camera& camera() const { return camera_; }

 private:
  ImagePoint ray(std::size_t column, int row) const;
  RayBlock rays(std::size_t first, std::size_t columns, std::span<const std::uint16_t> boundary) const;

  Camera calibration_, camera_;
  Rectangle region_;
  /// (rows / node_rows + 2) x columns: rays, NaN where there is none. Row by row, as a boundary runs.
  std::vector<ImagePoint> nodes_;
  RangeColumns result_;
};

} // namespace terrainseg::metric
