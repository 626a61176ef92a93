// SPDX-License-Identifier: LGPL-2.1-or-later
// Draws an estimate onto a frame of any format, in place.
#pragma once

#include <cstdint>

#include "terrainseg/estimate.hpp"
#include "terrainseg/frame.hpp"

namespace terrainseg {

enum class OverlayStyle : std::uint8_t {
  tint,    ///< traversable pixels are blended with the colour, doubtful ones half as strongly
  contour, ///< the edge of the traversable area is drawn
  mask,    ///< the frame is replaced by the mask as a grey picture
  models,  ///< tint, and the learned colours as bars as long as their share of the mass (paper, figure 8)
};

struct PaintStyle {
  OverlayStyle style = OverlayStyle::tint;
  int alpha = 102;                  ///< strength of the blend, 0..256
  std::uint32_t color = 0xff00c83c; ///< 0xAARRGGBB, full-range sRGB; AA scales alpha
};

/// Draws. Also draws the window as a rectangle and the horizon as a line, in every style but `mask`. An
/// estimate of another frame size is stretched: rows and rectangles by size, the mask by nearest neighbour.
void paint(const MutableFrame& frame, const Estimate& estimate, const PaintStyle& style);

} // namespace terrainseg
