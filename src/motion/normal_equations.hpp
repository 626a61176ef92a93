// SPDX-License-Identifier: LGPL-2.1-or-later
// Least squares of a few unknowns in integers: J' W J x = J' W e by LDL'.
#pragma once

#include <array>
#include <cstdint>
#include <optional>

namespace terrainseg {

inline constexpr int most_unknowns = 7;

/// The lower triangle of J' W J row by row (element (i, j) at i (i + 1) / 2 + j), below 2^58, and J' W e,
/// below 2^60.
struct NormalEquations {
  int unknowns = 6;
  std::array<std::int64_t, most_unknowns*(most_unknowns + 1) / 2> left{};
  std::array<std::int64_t, most_unknowns> right{};
};

struct LeastSquares {
  std::array<std::int64_t, most_unknowns> x{}; ///< with the fraction bits that were asked for
  std::int64_t last_pivot = 0; ///< what the last unknown is known by: its Schur complement, in units of left
};

/// Solves with the diagonal raised by 1/2048. Nothing where an unknown is in no equation or the solution
/// leaves the numbers that 64 bits hold.
std::optional<LeastSquares> solve(const NormalEquations& equations, int fraction_bits);

} // namespace terrainseg
