// SPDX-License-Identifier: LGPL-2.1-or-later
// Draws an estimate onto a frame of any format, in place.
#pragma once

#include <array>
#include <cstdint>

#include "terrainseg/estimate.hpp"
#include "terrainseg/frame.hpp"

namespace terrainseg {

enum class OverlayStyle : std::uint8_t {
  tint,    ///< traversable pixels are blended with the colour, doubtful ones half as strongly
  contour, ///< the edge of the traversable area is drawn; where it is doubtful, half as strongly
  mask,    ///< the frame is replaced by the mask as a grey picture, 128 where the mask does not reach
  models,  ///< tint, and the learned colours as bars as long as their share of the mass (paper, figure 8)
  map,     ///< tint, and where there are metres the free space from above in a corner (painter/metric_marks)
};

struct PaintStyle {
  OverlayStyle style = OverlayStyle::tint;
  /// Strength of the blend, 0..256: 0 draws nothing, 256 replaces. Lines are drawn twice as strong (at most
  /// opaque), bars opaque. The style `mask` does not use it.
  int alpha = 102;
  std::uint32_t color = 0xff00c83c; ///< 0xAARRGGBB, full-range sRGB; AA scales alpha
};

/// Draws. In pictures without colour the tint is a hatch of white and black lines. Also draws the window as a
/// rectangle and the horizon as a line (dashed where it is held from an earlier frame), in every style but
/// `mask`. An estimate of another frame size is stretched: rows and rectangles by size, the mask by nearest
/// neighbour. Pixels outside the frame, bytes between rows and the alpha channel stay as they are. A
/// subsampled chroma sample takes as much colour as the mean of its pixels. Allocates nothing.
void paint(const MutableFrame& frame, const Estimate& estimate, const PaintStyle& style);

/// A full-range sRGB colour as the components (Y, U, V or R, G, B) of a format, each rounded to nearest.
std::array<std::uint8_t, 3> color_in(PixelFormat format, const Colorimetry& colorimetry,
                                     const std::array<std::uint8_t, 3>& rgb);

} // namespace terrainseg
