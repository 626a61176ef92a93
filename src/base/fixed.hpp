// SPDX-License-Identifier: LGPL-2.1-or-later
// Shared integer arithmetic: rounding, logarithms, percentiles. Qn = a fixed-point number with n fraction
// bits.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstdint>
#include <span>

namespace terrainseg {

/// value / count rounded to the nearest integer, halves up. Divides by a power of two with a shift, as in the
/// paper's equation (5).
constexpr std::uint64_t rounded_quotient(std::uint64_t value, std::uint64_t count) {
  const std::uint64_t rounded = value + count / 2;
  return std::has_single_bit(count) ? rounded >> std::countr_zero(count) : rounded / count;
}

/// value / divisor rounded up.
constexpr std::uint64_t ceiled_quotient(std::uint64_t value, std::uint64_t divisor) {
  return value / divisor + (value % divisor != 0);
}

/// Table of log2(1 + i / 256) in Q8 (256 = one octave). Computed bit by bit: squaring a number in [1, 2)
/// yields the next bit of its logarithm.
inline constexpr auto log_fractions = [] {
  std::array<std::uint8_t, 256> table{};
  for (std::uint64_t i = 0; i < 256; ++i) {
    std::uint64_t x = (256 + i) << 23; // Q31
    unsigned bits = 0;
    for (int bit = 0; bit < 9; ++bit) {
      x = (x * x) >> 31;
      bits <<= 1;
      if (x >= std::uint64_t{1} << 32) {
        x >>= 1;
        bits |= 1;
      }
    }
    table[i] = static_cast<std::uint8_t>(std::min((bits + 1) >> 1, 255u));
  }
  return table;
}();

/// log2(x) in Q8, at most 2/256 below the exact value; -256 for 0.
constexpr int log2_q8(std::uint64_t x) {
  if (x == 0)
    return -256;
  const int exponent = std::bit_width(x) - 1;
  const std::uint64_t fraction = exponent >= 8 ? x >> (exponent - 8) : x << (8 - exponent);
  return exponent * 256 + log_fractions[fraction & 255];
}

/// The value below which `percent` % (0..99) of the values lie; 0 for an empty set. Reorders the values.
inline std::uint16_t percentile(std::span<std::uint16_t> values, int percent) {
  if (values.empty())
    return 0;
  const auto rank = static_cast<std::ptrdiff_t>(values.size() * static_cast<std::size_t>(percent) / 100);
  std::nth_element(values.begin(), values.begin() + rank, values.end());
  return values[rank];
}

} // namespace terrainseg
