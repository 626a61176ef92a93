// SPDX-License-Identifier: LGPL-2.1-or-later
// Registers and fills the custom metas of the plugin: GstTerrainSegMeta, GstTerrainMetricMeta,
// GstTerrainTrainingMeta, GstTerrainVetoMeta, GstTerrainTruthMeta.
#pragma once

#include <gst/gst.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>

namespace terrainseg {

/// Registers the metas that are not registered yet. Only plugin_init calls it; consumers look the metas up.
/// Returns false if GStreamer refuses.
bool register_metas();

/// Removes the custom metas `name` of the filter `instance` from a buffer; "" = filters without a name.
void remove_metas(GstBuffer* buffer, const char* name, const char* instance);
/// Adds the custom meta `name` of the filter `instance` (static or interned) instead of those, with its
/// version. Returns its fields; nullptr if the meta is not registered.
GstStructure* replace_meta(GstBuffer* buffer, const char* name, const char* instance, guint version);

/// How the coordinates of one axis change when a picture is scaled from one size to another.
struct Axis {
  int from, to;
  int edge(int position) const {
    return static_cast<int>(std::min<guint64>(gst_util_uint64_scale_int(position, to, from), G_MAXINT));
  }
  int row(int position) const {
    return std::min(static_cast<int>(gst_util_uint64_scale_int_round(position, to, from)), to - 1);
  }
};

} // namespace terrainseg

/// Sets fields of a custom meta's structure by quark, which is faster than variadic calls with names.
namespace terrainseg::fields {

template <std::size_t size> struct FieldName {
  char text[size];
  consteval FieldName(const char (&name)[size]) { std::copy_n(name, size, text); }
};
/// The quark of a field's name, looked up once.
template <FieldName name> GQuark operator""_field() {
  static const GQuark quark = g_quark_from_static_string(name.text);
  return quark;
}

template <class Store> void set(GstStructure* fields, GQuark name, GType type, Store store) {
  GValue value = G_VALUE_INIT;
  g_value_init(&value, type);
  store(&value);
  gst_structure_id_take_value(fields, name, &value);
}
inline void set_int(GstStructure* fields, GQuark name, int v) {
  set(fields, name, G_TYPE_INT, [&](GValue* value) { g_value_set_int(value, v); });
}
inline void set_uint(GstStructure* fields, GQuark name, unsigned v) {
  set(fields, name, G_TYPE_UINT, [&](GValue* value) { g_value_set_uint(value, v); });
}
inline void set_uint64(GstStructure* fields, GQuark name, std::uint64_t v) {
  set(fields, name, G_TYPE_UINT64, [&](GValue* value) { g_value_set_uint64(value, v); });
}
inline void set_double(GstStructure* fields, GQuark name, double v) {
  set(fields, name, G_TYPE_DOUBLE, [&](GValue* value) { g_value_set_double(value, v); });
}
/// Nothing for nullptr. The structure takes its own reference.
inline void set_buffer(GstStructure* fields, GQuark name, GstBuffer* v) {
  if (v)
    set(fields, name, GST_TYPE_BUFFER, [&](GValue* value) { g_value_set_boxed(value, v); });
}
/// `v` must be static or interned.
inline void set_static_string(GstStructure* fields, GQuark name, const char* v) {
  set(fields, name, G_TYPE_STRING, [&](GValue* value) { g_value_set_static_string(value, v); });
}

} // namespace terrainseg::fields
