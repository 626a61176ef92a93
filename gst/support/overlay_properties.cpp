// SPDX-License-Identifier: LGPL-2.1-or-later
#include "support/overlay_properties.hpp"

#include <cmath>
#include <iterator>

#include "support/properties.hpp"

namespace terrainseg {
namespace {

const Property<OverlaySettings> table[] = {
    {"overlay-style", "Overlay style",
     "What is drawn: a tint, the contour, the mask itself, or the tint with the learned colours or, where "
     "metres are known, with a map (terrainreference knows none)",
     property_controllable, TERRAINSEG_CHOICE(OverlaySettings, style, overlay_style_get_type)},
    {"overlay-alpha", "Overlay alpha",
     "Strength of the drawing (not of overlay-style=mask), as a fraction: 0 = invisible, 1 = opaque",
     property_controllable,
     NumberField<OverlaySettings, double>{TERRAINSEG_FIELD(OverlaySettings, alpha), 0, 1}},
    {"overlay-color", "Overlay colour",
     "Colour of the drawing (not of overlay-style=mask) as 0xAARRGGBB in sRGB, AA scales overlay-alpha",
     property_controllable,
     NumberField<OverlaySettings, std::uint32_t>{TERRAINSEG_FIELD(OverlaySettings, color), 0, G_MAXUINT32}},
};
static_assert(std::size(table) == overlay_property_count);

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
        {static_cast<int>(OverlayStyle::map), "Tint, and the free space from above where metres are known",
         "map"},
        {0, nullptr, nullptr}};
    const GType made = g_enum_register_static("GstTerrainSegOverlayStyle", values);
    gst_type_mark_as_plugin_api(made, static_cast<GstPluginAPIFlags>(0));
    return made;
  }();
  return type;
}

void install_overlay_properties(GObjectClass* object_class, guint first_id) {
  install_properties<OverlaySettings>(object_class, first_id, table);
}

PaintStyle OverlaySettings::paint() const {
  constexpr int opaque = 256;
  return {style, static_cast<int>(std::lround(alpha * opaque)), color};
}

void set_overlay_property(OverlaySettings& settings, guint offset, const GValue* value) {
  set_field(table[offset], settings, value);
}

void get_overlay_property(const OverlaySettings& settings, guint offset, GValue* value) {
  get_field(table[offset], settings, value);
}

} // namespace terrainseg
