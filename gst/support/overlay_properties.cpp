// SPDX-License-Identifier: LGPL-2.1-or-later
#include "support/overlay_properties.hpp"

#include <cmath>
#include <iterator>

#include "support/properties.hpp"

namespace terrainseg {
namespace {

const Property<OverlaySettings> table[] = {
    {"overlay-style", "Overlay style",
     "What is drawn: a tint, the contour, the mask, or the tint with the learned models or with a map of the "
     "ranges (not by terrainreference)",
     property_controllable, TERRAINSEG_CHOICE(OverlaySettings, style, overlay_style_get_type)},
    {"overlay-alpha", "Overlay alpha",
     "Opacity of the overlay from 0 = invisible to 1 = opaque. Not used by overlay-style=mask",
     property_controllable,
     NumberField<OverlaySettings, double>{TERRAINSEG_FIELD(OverlaySettings, alpha), 0, 1}},
    {"overlay-color", "Overlay colour",
     "Colour of the overlay as 0xAARRGGBB in sRGB; AA scales overlay-alpha. Not used by overlay-style=mask",
     property_controllable,
     NumberField<OverlaySettings, std::uint32_t>{TERRAINSEG_FIELD(OverlaySettings, color), 0, G_MAXUINT32}},
};
static_assert(std::size(table) == overlay_property_count);

} // namespace

GType overlay_style_get_type() {
  static const GType type = [] {
    // Two plugins contain this code, but the type must be registered once.
    if (const GType known = g_type_from_name("GstTerrainSegOverlayStyle"))
      return known;
    static const GEnumValue values[] = {
        {static_cast<int>(OverlayStyle::tint), "Blend traversable ground with the colour", "tint"},
        {static_cast<int>(OverlayStyle::contour), "Draw the edge of the traversable ground", "contour"},
        {static_cast<int>(OverlayStyle::mask), "Show the mask in grey instead of the frame", "mask"},
        {static_cast<int>(OverlayStyle::models),
         "Tint, and the learned models as bars of their colour and mass", "models"},
        {static_cast<int>(OverlayStyle::map), "Tint, and a map of the free space where ranges are known",
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
