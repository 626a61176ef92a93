// SPDX-License-Identifier: LGPL-2.1-or-later
// Converts every input colorimetry to full-range BT.601 luma and chroma. Applied only to coarse cells, not to
// the pixels of a frame.
#pragma once

#include <array>
#include <cstdint>

#include "terrainseg/frame.hpp"
#include "terrainseg/terrain.hpp"

namespace terrainseg {

// Converts learned colours to RGB for drawing.

/// Converts a mean (Q8) of a colour space to full-range RGB.
std::array<std::uint8_t, 3> rgb_of(const std::array<std::uint16_t, 3>& mean, const ColorSpace& space);

/// An affine transform of three 8-bit components, Q16.
struct ColorTransform {
  std::array<std::array<std::int32_t, 3>, 3> matrix{};
  std::array<std::int32_t, 3> offset{};
  bool identity = true;
  bool operator==(const ColorTransform&) const = default;
};

/// Returns the transform from the frame's components (Y U V or R G B) to full-range BT.601 Y U V.
ColorTransform color_transform_of(bool rgb, const Colorimetry& colorimetry);

/// Transforms a row of pixels from three sources to three targets of `count` bytes. Sources and targets must
/// not overlap.
void transform_row(const ColorTransform& transform, const std::array<const std::uint8_t*, 3>& source,
                   const std::array<std::uint8_t*, 3>& target, int count);

/// Computes the first component (luma) only.
void transform_luma_row(const ColorTransform& transform, const std::array<const std::uint8_t*, 3>& source,
                        std::uint8_t* target, int count);

} // namespace terrainseg
