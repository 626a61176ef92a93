// SPDX-License-Identifier: LGPL-2.1-or-later
#include "motion/plane_motion.hpp"

#include <algorithm>

#include "base/tuning.hpp"

namespace terrainseg {
namespace {

using Matrix = std::array<std::int64_t, 9>;

TERRAINSEG_TUNED(std::int64_t, plane_motion, largest,
                 64 * one_q24); ///< limit of an element: keeps products of two within 63 bits

Matrix product(const Matrix& a, const Matrix& b) {
  Matrix c{};
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) {
      std::int64_t sum = one_q24 / 2;
      for (int k = 0; k < 3; ++k)
        sum += a[3 * i + k] * b[3 * k + j];
      c[3 * i + j] = sum >> 24;
    }
  return c;
}

/// Divides by the first element. Returns the identity when the matrix is not the motion of a camera that
/// views the ground.
PlaneMotion normalised(Matrix m) {
  if (m[0] < one_q24 / 16)
    return {};
  for (std::int64_t& element : m)
    element = std::clamp(element, -largest, largest);
  PlaneMotion motion;
  for (int i = 0; i < 9; ++i)
    motion.g[i] = std::clamp(m[i] * one_q24 / m[0], -largest, largest);
  return motion;
}

} // namespace

GroundCamera GroundCamera::quarter() const {
  return {width / 4, height / 4, focal / 4, (vanishing_row - 384) / 4};
}

PlaneMotion compose(const PlaneMotion& a, const PlaneMotion& b) {
  return normalised(product(a.g, b.g));
}

PlaneMotion inverse(const PlaneMotion& motion) {
  const Matrix& m = motion.g;
  const auto minor = [&m](int a, int b, int c, int d) {
    return (m[a] * m[d] - m[b] * m[c] + one_q24 / 2) >> 24;
  };
  return normalised({minor(4, 5, 7, 8), -minor(1, 2, 7, 8), minor(1, 2, 4, 5),  //
                     -minor(3, 5, 6, 8), minor(0, 2, 6, 8), -minor(0, 2, 3, 5), //
                     minor(3, 4, 6, 7), -minor(0, 1, 6, 7), minor(0, 1, 3, 4)});
}

Translation translation_of(const PlaneMotion& motion) {
  return {motion.g[1] + motion.g[3], motion.g[4] - one_q24, motion.g[7] + motion.g[5]};
}

PlaneMotion part_of(const PlaneMotion& motion, int part) {
  PlaneMotion scaled;
  for (int i = 0; i < 9; ++i)
    scaled.g[i] += (motion.g[i] - scaled.g[i]) * part >> 8;
  return scaled;
}

PlaneMotion with_line_moved(const PlaneMotion& motion, int rows, int focal) {
  const std::int64_t shift = std::int64_t{rows} * (one_q24 >> 8) / focal;
  const Matrix down{one_q24, 0, 0, 0, one_q24, shift, 0, 0, one_q24},
      up{one_q24, 0, 0, 0, one_q24, -shift, 0, 0, one_q24};
  PlaneMotion moved = normalised(product(up, product(motion.g, down)));
  moved.g[8] = one_q24;
  moved.g[6] = -moved.g[2];
  return moved;
}

PixelMap::PixelMap(const PlaneMotion& motion, const GroundCamera& view)
    : map_{motion.g[0],
           motion.g[1],
           motion.g[3],
           motion.g[4],
           motion.g[2] * view.focal * 256,
           motion.g[5] * view.focal * 256,
           motion.g[6] * 32768 / view.focal,
           motion.g[7] * 256 / view.focal,
           motion.g[8] * 65536,
           (view.width - 1) * 128,
           view.vanishing_row,
           outside} {}

} // namespace terrainseg
