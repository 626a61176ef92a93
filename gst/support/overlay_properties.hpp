// SPDX-License-Identifier: LGPL-2.1-or-later
// The drawing properties that terrainseg and terrainoverlay share.
#pragma once

#include <gst/gst.h>

#include "painter.hpp"

namespace terrainseg {

/// The properties as set.
struct OverlaySettings {
  OverlayStyle style = OverlayStyle::tint;
  double alpha = 0.4;
  std::uint32_t color = PaintStyle{}.color;
  /// Converts them for the painter.
  PaintStyle paint() const;
};

/// Number of property ids that install_overlay_properties() uses.
inline constexpr guint overlay_property_count = 3;

/// Installs overlay-style, overlay-alpha and overlay-color with the ids first_id .. first_id + 2.
void install_overlay_properties(GObjectClass* object_class, guint first_id);
/// `offset` is the property's id minus first_id. The caller holds the object lock.
void set_overlay_property(OverlaySettings& settings, guint offset, const GValue* value);
void get_overlay_property(const OverlaySettings& settings, guint offset, GValue* value);

/// GType of the enumeration of overlay-style.
GType overlay_style_get_type();

} // namespace terrainseg
