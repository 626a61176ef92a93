// SPDX-License-Identifier: LGPL-2.1-or-later
#include "overlay_properties.hpp"

#include <cmath>

namespace terrainseg {
namespace {

enum Offset : guint { offset_style, offset_alpha, offset_color };

constexpr auto live = static_cast<GParamFlags>(G_PARAM_READWRITE | G_PARAM_STATIC_STRINGS |
                                               GST_PARAM_CONTROLLABLE | GST_PARAM_MUTABLE_PLAYING);

} // namespace

GType overlay_style_get_type() {
  static const GType type = [] {
    // Two plugins hold this code; the type is one.
    if (const GType known = g_type_from_name("GstTerrainSegOverlayStyle"))
      return known;
    static const GEnumValue values[] = {
        {static_cast<int>(OverlayStyle::tint), "Traversable ground is blended with the colour", "tint"},
        {static_cast<int>(OverlayStyle::contour), "The edge of the traversable ground is drawn", "contour"},
        {static_cast<int>(OverlayStyle::mask), "The mask as a grey picture instead of the frame", "mask"},
        {static_cast<int>(OverlayStyle::models), "Tint, and the learned colours as bars of their mass",
         "models"},
        {0, nullptr, nullptr}};
    return g_enum_register_static("GstTerrainSegOverlayStyle", values);
  }();
  return type;
}

void install_overlay_properties(GObjectClass* object_class, guint first_id) {
  const OverlaySettings defaults;
  g_object_class_install_property(
      object_class, first_id + offset_style,
      g_param_spec_enum(
          "overlay-style", "Overlay style",
          "What is drawn: a tint, the contour, the mask itself, or the tint with the learned colours",
          overlay_style_get_type(), static_cast<int>(defaults.style), live));
  g_object_class_install_property(
      object_class, first_id + offset_alpha,
      g_param_spec_double("overlay-alpha", "Overlay alpha",
                          "Strength of the drawing, as a fraction: 0 = invisible, 1 = opaque", 0, 1,
                          defaults.alpha, live));
  g_object_class_install_property(
      object_class, first_id + offset_color,
      g_param_spec_uint("overlay-color", "Overlay colour",
                        "Colour of the drawing as 0xAARRGGBB in sRGB, AA scales overlay-alpha", 0,
                        G_MAXUINT32, defaults.color, live));
}

PaintStyle OverlaySettings::paint() const {
  constexpr int opaque = 256;
  return {style, static_cast<int>(std::lround(alpha * opaque)), color};
}

void set_overlay_property(OverlaySettings& settings, guint offset, const GValue* value) {
  switch (offset) {
  case offset_style:
    settings.style = static_cast<OverlayStyle>(g_value_get_enum(value));
    break;
  case offset_alpha:
    settings.alpha = g_value_get_double(value);
    break;
  case offset_color:
    settings.color = g_value_get_uint(value);
    break;
  default:
    break;
  }
}

void get_overlay_property(const OverlaySettings& settings, guint offset, GValue* value) {
  switch (offset) {
  case offset_style:
    g_value_set_enum(value, static_cast<int>(settings.style));
    break;
  case offset_alpha:
    g_value_set_double(value, settings.alpha);
    break;
  case offset_color:
    g_value_set_uint(value, settings.color);
    break;
  default:
    break;
  }
}

} // namespace terrainseg
