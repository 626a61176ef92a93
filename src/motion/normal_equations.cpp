// SPDX-License-Identifier: LGPL-2.1-or-later
#include "motion/normal_equations.hpp"

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

} // namespace terrainseg
