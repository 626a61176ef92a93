// SPDX-License-Identifier: LGPL-2.1-or-later
// Integer least squares with few unknowns: solves J' W J x = J' W e by LDL' decomposition.
#pragma once

#include <array>
#include <cstdint>
#include <optional>

namespace terrainseg {

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

} // namespace terrainseg
