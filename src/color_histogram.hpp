// SPDX-License-Identifier: LGPL-2.1-or-later
// Histograms over the colours of cells (indices.hpp).
#pragma once

#include <cstdint>
#include <span>

namespace terrainseg {

/// Smooths a histogram of color_bins bins by 1-2-1 along luma and both chromas, the ends repeated; each sum
/// is divided by 4, rounded down. `between` holds one of the steps. All bins together may hold (2^32 - 1) / 3
/// at most; the three may not overlap.
void blur_colors(std::span<const std::uint32_t> in, std::span<std::uint32_t> between,
                 std::span<std::uint32_t> out);

} // namespace terrainseg
