// SPDX-License-Identifier: LGPL-2.1-or-later
// Motion of the ground plane through the picture. Needs no calibration: the focal length is a guess.
//
// A pixel (u, v) has the direction x = (u - (w - 1) / 2) / f, y = (v - y0) / f, where y0 is the row of the
// ground's vanishing line. A motion maps (x, y, 1) of a ground point in this frame to that in an earlier
// frame:
//
//       | 1    a     b |     a = tx - roll, b = yaw, c = roll, e = ty (change of height), d = -pitch,
//   G = | c   1+e    d |     h = tz + pitch; t in units of the camera's height
//       | -b   h     1 |
#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "kernels/point_fit.hpp"

namespace terrainseg {

// Integer least squares with few unknowns: solves J' W J x = J' W e by LDL' decomposition.

inline constexpr int most_unknowns = 7;

/// The lower triangle of J' W J, row by row (element (i, j) at index i (i + 1) / 2 + j), below 2^58, and J' W
/// e, below 2^60.
struct NormalEquations {
  int unknowns = 6;
  std::array<std::int64_t, most_unknowns*(most_unknowns + 1) / 2> left{};
  std::array<std::int64_t, most_unknowns> right{};
};

struct LeastSquares {
  std::array<std::int64_t, most_unknowns> x{}; ///< with the requested number of fraction bits
  std::int64_t last_pivot = 0; ///< Schur complement of the last unknown, in units of `left`: the information
                               ///< on it
};

/// Solves the equations with the diagonal increased by 1/2048. Returns nothing when an unknown occurs in no
/// equation or the solution exceeds 64 bits.
std::optional<LeastSquares> solve(const NormalEquations& equations, int fraction_bits);

/// The camera at one pyramid level, in its pixels.
struct GroundCamera {
  int width = 0, height = 0;
  int focal = 0;         ///< pixels
  int vanishing_row = 0; ///< Q8 of a pixel; may lie outside the picture
  /// The same camera for pictures reduced by 4 x 4.
  GroundCamera quarter() const { return {width / 4, height / 4, focal / 4, (vanishing_row - 384) / 4}; }
  bool operator==(const GroundCamera&) const = default;
};

/// across(): twice the distance of a column from the middle. below(): distance of a row from the vanishing
/// line, Q8.
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

/// a after b: applies b first.
PlaneMotion compose(const PlaneMotion& a, const PlaneMotion& b);
PlaneMotion inverse(const PlaneMotion& motion);
/// First-order approximation.
Translation translation_of(const PlaneMotion& motion);
/// A fraction of the motion, `part` in Q8 (256 = 1), first-order approximation.
PlaneMotion part_of(const PlaneMotion& motion, int part);
/// The same motion for a vanishing line that lies `rows` (Q8) lower, in the form above.
PlaneMotion with_line_moved(const PlaneMotion& motion, int rows, int focal);

/// A motion as a map between pixels of one level: at(across, below) is the position of a pixel in the earlier
/// frame.
kernels::PointMap pixel_map(const PlaneMotion& motion, const GroundCamera& view);

} // namespace terrainseg
