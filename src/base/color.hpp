// SPDX-License-Identifier: LGPL-2.1-or-later
// Converts learned colours to RGB for drawing.
#pragma once

#include <array>
#include <cstdint>

#include "terrainseg/terrain.hpp"

namespace terrainseg {

/// Converts a mean (Q8) of a colour space to full-range RGB.
std::array<std::uint8_t, 3> rgb_of(const std::array<std::uint16_t, 3>& mean, const ColorSpace& space);

} // namespace terrainseg
