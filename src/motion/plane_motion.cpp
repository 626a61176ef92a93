// SPDX-License-Identifier: LGPL-2.1-or-later
#include "motion/plane_motion.hpp"

#include <algorithm>
#include <bit>
#include <cstdlib>

#include "base/tuning.hpp"

namespace terrainseg {
namespace {

TERRAINSEG_TUNED(int, normal_equations, diagonal_bits, 30); ///< bits of the scaled diagonal
TERRAINSEG_TUNED(int, normal_equations, factor_bits, 20);   ///< fraction bits of L
TERRAINSEG_TUNED(int, normal_equations, quotient_bits, 24); ///< fraction bits of the scaled solution
constexpr std::int64_t limit = std::int64_t{1} << 36;

constexpr std::int64_t shifted(std::int64_t value, int bits) {
  if (bits >= 0)
    return value * (std::int64_t{1} << std::min(bits, 62));
  return bits < -62 ? 0 : (value + (std::int64_t{1} << (-bits - 1))) >> -bits;
}

int bits_of(std::int64_t value) {
  return static_cast<int>(std::bit_width(static_cast<std::uint64_t>(std::abs(value))));
}

constexpr int at(int i, int j) {
  return i * (i + 1) / 2 + j;
}

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

std::optional<LeastSquares> solve(const NormalEquations& equations, int fraction_bits) {
  const int n = equations.unknowns;
  // Scale each unknown so that the diagonal has 29 or 30 bits; no other element has more.
  std::array<int, most_unknowns> scale{};
  for (int i = 0; i < n; ++i) {
    if (equations.left[at(i, i)] <= 0)
      return std::nullopt;
    const int room = diagonal_bits - bits_of(equations.left[at(i, i)]);
    scale[i] = room >= 0 ? room / 2 : -((1 - room) / 2);
  }
  std::array<std::int64_t, most_unknowns*(most_unknowns + 1) / 2> l{};
  for (int i = 0; i < n; ++i)
    for (int j = 0; j <= i; ++j)
      l[at(i, j)] = shifted(equations.left[at(i, j)], scale[i] + scale[j]);
  int right_bits = -256;
  for (int i = 0; i < n; ++i)
    if (equations.right[i] != 0)
      right_bits = std::max(right_bits, bits_of(equations.right[i]) + scale[i]);
  if (right_bits == -256)
    right_bits = 0; // the right side is 0
  const int common = 28 - right_bits;

  std::array<std::int64_t, most_unknowns> pivot{}, z{};
  for (int i = 0; i < n; ++i) {
    std::int64_t d = l[at(i, i)] + (l[at(i, i)] >> 11);
    for (int j = 0; j < i; ++j) {
      std::int64_t sum = l[at(i, j)]; // L(i, j) D(j)
      for (int k = 0; k < j; ++k)
        sum -= (l[at(i, k)] * (l[at(j, k)] * pivot[k] >> factor_bits)) >> factor_bits;
      l[at(i, j)] = sum * (std::int64_t{1} << factor_bits) / pivot[j];
      if (std::abs(l[at(i, j)]) > std::int64_t{1} << 27)
        return std::nullopt;
      d -= (l[at(i, j)] * sum) >> factor_bits;
    }
    pivot[i] = d;
    if (d < 1 << 12)
      return std::nullopt;
  }
  for (int i = 0; i < n; ++i) {
    z[i] = shifted(equations.right[i], scale[i] + common);
    for (int j = 0; j < i; ++j)
      z[i] -= (l[at(i, j)] * z[j]) >> factor_bits;
    if (std::abs(z[i]) >= limit)
      return std::nullopt;
  }
  LeastSquares found;
  for (int i = n - 1; i >= 0; --i) {
    found.x[i] = z[i] * (std::int64_t{1} << quotient_bits) / pivot[i];
    if (std::abs(found.x[i]) >= limit)
      return std::nullopt;
    for (int j = i + 1; j < n; ++j)
      found.x[i] -= (l[at(j, i)] * found.x[j]) >> factor_bits;
    if (std::abs(found.x[i]) >= limit)
      return std::nullopt;
  }
  for (int i = 0; i < n; ++i) {
    const int bits = scale[i] - common + fraction_bits - quotient_bits;
    if (bits_of(found.x[i]) + bits > 62)
      return std::nullopt;
    found.x[i] = shifted(found.x[i], bits);
  }
  found.last_pivot = shifted(pivot[n - 1], std::clamp(-2 * scale[n - 1], -60, 30));
  return found;
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

kernels::PointMap pixel_map(const PlaneMotion& motion, const GroundCamera& view) {
  const auto& g = motion.g;
  return {.g0 = g[0],
          .g1 = g[1],
          .g3 = g[3],
          .g4 = g[4],
          .x_offset = g[2] * view.focal * 256,
          .y_offset = g[5] * view.focal * 256,
          .across_w = g[6] * 32768 / view.focal,
          .below_w = g[7] * 256 / view.focal,
          .w_offset = g[8] * 65536,
          .middle = (view.width - 1) * 128,
          .line = view.vanishing_row,
          .outside = 1 << 20};
}

} // namespace terrainseg
