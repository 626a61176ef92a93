// SPDX-License-Identifier: LGPL-2.1-or-later
// Integer arithmetic that several stages share. Qn = a fixed-point number with n fraction bits.
#pragma once

#include <bit>
#include <cstdint>

namespace terrainseg {

/// value / count to the nearest integer, halves up. A power of two is divided by a shift, as in the paper's
/// equation (5).
constexpr std::uint64_t rounded_quotient(std::uint64_t value, std::uint64_t count) {
  const std::uint64_t rounded = value + count / 2;
  return std::has_single_bit(count) ? rounded >> std::countr_zero(count) : rounded / count;
}

/// value / divisor rounded up.
constexpr std::uint64_t ceiled_quotient(std::uint64_t value, std::uint64_t divisor) {
  return value / divisor + (value % divisor != 0);
}

} // namespace terrainseg
