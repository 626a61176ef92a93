// SPDX-License-Identifier: LGPL-2.1-or-later
// Loops of the octave pyramid: one 1-4-6-4-1 reduction of a plane (paper, equations (1) and (2)).
#pragma once

#include <cstdint>

#include "terrainseg/frame.hpp"

namespace terrainseg::kernels {

/// Halves a width x height plane in both directions into ceil(width / 2) x ceil(height / 2): separable
/// 1-4-6-4-1, reflect-101 borders, one rounding (s + 128) >> 8; the bits of 8-bit cv::pyrDown. `columns`
/// holds at least width elements of working memory.
void reduce(const Plane& source, int width, int height, const MutablePlane& target, std::uint16_t* columns);

/// The same in the vertical direction only, (s + 8) >> 4: width x height into width x ceil(height / 2).
void reduce_rows(const Plane& source, int width, int height, const MutablePlane& target);

} // namespace terrainseg::kernels
