// SPDX-License-Identifier: LGPL-2.1-or-later
// Shared integer arithmetic. Qn = a fixed-point number with n fraction bits.
#pragma once

#include <bit>
#include <cstdint>

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

} // namespace terrainseg
