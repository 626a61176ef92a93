// SPDX-License-Identifier: LGPL-2.1-or-later
// Logarithms to base 2 in Q8 (256 = one octave), by table.
#pragma once

#include <array>
#include <bit>
#include <cstdint>

namespace terrainseg {

namespace detail {

// Table of log2(1 + i / 256) in Q8. Computed bit by bit: squaring a number in [1, 2) yields the next bit of
// its logarithm.
constexpr std::array<std::uint8_t, 256> log_fractions() {
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
    const unsigned rounded = (bits + 1) >> 1;
    table[i] = static_cast<std::uint8_t>(rounded > 255 ? 255 : rounded);
  }
  return table;
}

inline constexpr std::array<std::uint8_t, 256> log_table = log_fractions();

} // namespace detail

/// log2(x) in Q8, at most 2/256 below the exact value; -256 for 0.
constexpr int log2_q8(std::uint64_t x) {
  if (x == 0)
    return -256;
  const int exponent = std::bit_width(x) - 1;
  const std::uint64_t fraction = exponent >= 8 ? x >> (exponent - 8) : x << (8 - exponent);
  return exponent * 256 + detail::log_table[fraction & 255];
}

} // namespace terrainseg
