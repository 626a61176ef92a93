// SPDX-License-Identifier: LGPL-2.1-or-later
// How the ground plane moves through the picture. No calibration: the focal length is a guess.
//
// A pixel (u, v) looks along x = (u - (w - 1) / 2) / f, y = (v - y0) / f, y0 the row of the ground's
// vanishing line. A motion maps the (x, y, 1) of a ground point in this frame to the one in an earlier frame:
//
//       | 1    a     b |     a = tx - roll, b = yaw, c = roll, e = ty (the height changes), d = -pitch,
//   G = | c   1+e    d |     h = tz + pitch; t in units of the camera's height
//       | -b   h     1 |
#pragma once

#include <array>
#include <cstdint>

#include "kernels/point_fit.hpp"

namespace terrainseg {

/// The camera at one pyramid level, in its pixels.
struct GroundCamera {
  int width = 0, height = 0;
  int focal = 0;         ///< pixels
  int vanishing_row = 0; ///< Q8 of a pixel; may lie outside the picture
  /// The same at 4 x 4 pixels a cell.
  GroundCamera quarter() const;
  bool operator==(const GroundCamera&) const = default;
};

/// Twice the distance of a column from the middle, and that of a row from the vanishing line in Q8.
constexpr int across(const GroundCamera& view, int u) {
  return 2 * u - (view.width - 1);
}
constexpr int below(const GroundCamera& view, int v) {
  return v * 256 - view.vanishing_row;
}

/// Translation of the camera in units of its height, Q24: to the right, down, forward.
struct Translation {
  std::int64_t x = 0, y = 0, z = 0;
};

inline constexpr std::int64_t one_q24 = 1 << 24;

/// Row-major, Q24, G[0] = 1.
struct PlaneMotion {
  std::array<std::int64_t, 9> g{one_q24, 0, 0, 0, one_q24, 0, 0, 0, one_q24};
  bool operator==(const PlaneMotion&) const = default;
};

/// a after b: maps by b first.
PlaneMotion compose(const PlaneMotion& a, const PlaneMotion& b);
PlaneMotion inverse(const PlaneMotion& motion);
/// To first order.
Translation translation_of(const PlaneMotion& motion);
/// A part of the motion, `part` in Q8 (256 = all of it), to first order.
PlaneMotion part_of(const PlaneMotion& motion, int part);
/// The motion as seen from a vanishing line that lies `rows` (Q8) lower, with the form above.
PlaneMotion with_line_moved(const PlaneMotion& motion, int rows, int focal);

/// A motion as a map between pixels of one level.
class PixelMap {
 public:
  PixelMap(const PlaneMotion& motion, const GroundCamera& view);
  struct Position {
    std::int32_t u, v; ///< Q8; far outside where the point lies behind the camera
  };
  /// Where a pixel lies in the earlier frame; sub-pixels by across() and below() of it.
  Position at(int across, int below) const {
    const std::int64_t x = ((g_[0] * across) << 7) + g_[1] * below + x_offset_; // Q32 of a pixel
    const std::int64_t y = ((g_[3] * across) << 7) + g_[4] * below + y_offset_;
    const std::int64_t w = (across_w_ * across + below_w_ * below + w_offset_) >> 16; // Q24
    if (w < one_q24 / 64)
      return {-outside, -outside};
    const std::int64_t reciprocal = (std::int64_t{1} << 48) / w; // Q24
    return {within(middle_ + times(x, reciprocal)), within(line_ + times(y, reciprocal))};
  }

  /// The same for lists of points.
  kernels::PointMap of_points() const {
    return {g_[0],     g_[1],    g_[3],     g_[4],   x_offset_, y_offset_,
            across_w_, below_w_, w_offset_, middle_, line_,     outside};
  }

  static constexpr std::int32_t outside = 1 << 20;

 private:
  /// Q32 by Q24 as Q8; a position beyond 2^20 pixels is outside anyway.
  static std::int64_t times(std::int64_t position, std::int64_t reciprocal) {
    const std::int64_t limit = std::int64_t{1} << 32;
    const std::int64_t near = position >> 12; // Q20
    return (near < -limit ? -limit : near > limit ? limit : near) * reciprocal >> 36;
  }
  static std::int32_t within(std::int64_t position) {
    return static_cast<std::int32_t>(position < -outside  ? -outside
                                     : position > outside ? outside
                                                          : position);
  }
  std::array<std::int64_t, 9> g_;
  std::int64_t x_offset_, y_offset_, across_w_, below_w_, w_offset_;
  std::int32_t middle_, line_;
};

} // namespace terrainseg
