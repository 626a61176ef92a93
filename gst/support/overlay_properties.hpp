// SPDX-License-Identifier: LGPL-2.1-or-later
// The drawing properties that terrainseg and terrainoverlay share.
#pragma once

#include <array>
#include <cmath>

#include "painter.hpp"
#include "support/properties.hpp"

namespace terrainseg {

/// The properties as set.
struct OverlaySettings {
  OverlayStyle style = OverlayStyle::tint;
  double alpha = 0.4;
  std::uint32_t color = PaintStyle{}.color;
  /// Converts them for the painter.
  PaintStyle paint() const { return {style, static_cast<int>(std::lround(alpha * 256)), color}; }
};

inline constexpr Choice overlay_styles[] = {
    {"tint", "Blend traversable ground with the colour"},
    {"contour", "Draw the edge of the traversable ground"},
    {"mask", "Show the mask in grey instead of the frame"},
    {"models", "Tint, and the learned models as bars of their colour and mass"},
    {"map", "Tint, and a map of the free space where ranges are known"},
};

/// The rows of a table whose struct has OverlaySettings at the end of the path.
template <auto... path> constexpr std::array<Property<OwnerOf<path...>>, 3> overlay_rows() {
  return {{
      {"overlay-style", "Overlay style",
       "What is drawn: a tint, the contour, the mask, or the tint with the learned models or with a map of "
       "the ranges (not by terrainreference)",
       property_controllable,
       field<path..., &OverlaySettings::style>("GstTerrainSegOverlayStyle", overlay_styles)},
      {"overlay-alpha", "Overlay alpha",
       "Opacity of the overlay from 0 = invisible to 1 = opaque. Not used by overlay-style=mask",
       property_controllable, field<path..., &OverlaySettings::alpha>(0, 1)},
      {"overlay-color", "Overlay colour",
       "Colour of the overlay as 0xAARRGGBB in sRGB; AA scales overlay-alpha. Not used by overlay-style=mask",
       property_controllable, field<path..., &OverlaySettings::color>(0, G_MAXUINT32)},
  }};
}

} // namespace terrainseg
