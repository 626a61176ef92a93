// SPDX-License-Identifier: LGPL-2.1-or-later
// Percentiles of a set of values.
#pragma once

#include <algorithm>
#include <cstdint>
#include <span>

namespace terrainseg {

/// The value below which `percent` % (0..99) of the values lie; 0 for an empty set. Reorders the values.
inline std::uint16_t percentile(std::span<std::uint16_t> values, int percent) {
  if (values.empty())
    return 0;
  const auto rank = static_cast<std::ptrdiff_t>(values.size() * static_cast<std::size_t>(percent) / 100);
  std::nth_element(values.begin(), values.begin() + rank, values.end());
  return values[static_cast<std::size_t>(rank)];
}

} // namespace terrainseg
