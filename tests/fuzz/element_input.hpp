// SPDX-License-Identifier: LGPL-2.1-or-later
// What the fuzzers of elements share: GStreamer without its plugins, segments, caps, properties.
#pragma once

#include <gst/check/gstharness.h>
#include <gst/gst.h>
#include <gst/video/video.h>

#include <array>
#include <string>

#include "input.hpp"
#include "support/meta.hpp"

namespace terrainseg::fuzz {

/// Once, before the first input. A critical is a failure; messages of errors that the input deserves are not
/// printed.
inline void start_gstreamer() {
  g_setenv("GST_PLUGIN_SYSTEM_PATH", "", TRUE);
  g_setenv("GST_PLUGIN_PATH", "", TRUE);
  g_setenv("GST_REGISTRY_UPDATE", "no", TRUE);
  gst_registry_fork_set_enabled(FALSE);
  gst_init(nullptr, nullptr);
  g_log_set_always_fatal(static_cast<GLogLevelFlags>(G_LOG_LEVEL_CRITICAL | G_LOG_LEVEL_ERROR));
  gst_debug_set_default_threshold(GST_LEVEL_NONE);
  for (const char* domain : {"GStreamer", "GLib-GObject"})
    g_log_set_handler(
        domain, G_LOG_LEVEL_WARNING, [](const gchar*, GLogLevelFlags, const gchar*, gpointer) {}, nullptr);
  require(register_metas());
}

/// Times that break sums: none, 0, the usual, and the ends of the range.
inline GstClockTime time_from(Input& in, GstClockTime usual) {
  switch (in.byte() % 16) {
  case 1:
    return GST_CLOCK_TIME_NONE;
  case 2:
    return G_MAXUINT64 - 1;
  case 3:
    return (G_MAXUINT64 >> 1) + in.byte();
  case 4:
    return in.number(8);
  case 5:
    return 0;
  case 6:
    return usual + in.byte() * GST_MSECOND;
  case 7:
    return usual > 255 * GST_MSECOND ? usual - in.byte() * GST_MSECOND : 0;
  default:
    return usual;
  }
}

inline GstEvent* segment_from(Input& in) {
  GstSegment segment;
  gst_segment_init(&segment, in.chance(8) ? GST_FORMAT_BYTES : GST_FORMAT_TIME);
  if (in.chance(4))
    segment.rate = in.chance(2) ? -1.0 : 2.0;
  if (in.chance(4))
    segment.start = segment.position = in.number(in.chance(4) ? 8 : 5);
  if (in.chance(4))
    segment.base = in.number(in.chance(4) ? 8 : 5);
  if (segment.rate < 0 || in.chance(6))
    segment.stop = segment.start > G_MAXUINT64 / 2 ? segment.start : segment.start + in.number(5);
  return gst_event_new_segment(&segment);
}

inline std::string caps_from(Input& in) {
  static constexpr const char* formats[] = {"I420", "YV12", "NV12", "NV21", "Y42B", "Y444",
                                            "YUY2", "UYVY", "RGB",  "BGR",  "RGBx", "BGRx",
                                            "xRGB", "xBGR", "RGBA", "BGRA", "ARGB", "ABGR"};
  static constexpr const char* rates[] = {"30/1", "25/1", "0/1", "1/3600", "2000000000/1", "1/2000000000"};
  static constexpr const char* colors[] = {"", ",colorimetry=bt601", ",colorimetry=bt709",
                                           ",colorimetry=1:4:7:1", ",colorimetry=bt2020"};
  return std::string("video/x-raw,format=") + formats[in.byte() % 18] +
         ",width=" + std::to_string(1 + in.below(96)) + ",height=" + std::to_string(1 + in.below(72)) +
         ",framerate=" + rates[in.byte() % 6] + colors[in.byte() % 5];
}

/// Sets one property to a value of its type; which ones are left alone is the caller's choice.
inline void set_property_from(Input& in, GObject* object, bool (*allowed)(const GParamSpec*)) {
  guint count = 0;
  GParamSpec** specs = g_object_class_list_properties(G_OBJECT_GET_CLASS(object), &count);
  const GParamSpec* const spec = specs[in.byte() % count];
  g_free(specs);
  if (!(spec->flags & G_PARAM_WRITABLE) || (spec->flags & G_PARAM_CONSTRUCT_ONLY) || !allowed(spec))
    return;
  GValue value = G_VALUE_INIT;
  g_value_init(&value, G_PARAM_SPEC_VALUE_TYPE(spec));
  const bool wild = in.chance(8);
  if (G_VALUE_HOLDS_BOOLEAN(&value))
    g_value_set_boolean(&value, in.byte() & 1);
  else if (G_VALUE_HOLDS_INT(&value))
    g_value_set_int(&value, wild ? static_cast<gint>(in.number(4)) : static_cast<gint>(in.byte()) - 64);
  else if (G_VALUE_HOLDS_UINT(&value))
    g_value_set_uint(&value, wild ? static_cast<guint>(in.number(4)) : in.byte());
  else if (G_VALUE_HOLDS_DOUBLE(&value))
    g_value_set_double(&value, wild ? static_cast<double>(in.number(4)) : in.byte() / 64.0);
  else if (G_VALUE_HOLDS_ENUM(&value)) {
    const GEnumClass* const values = G_PARAM_SPEC_ENUM(spec)->enum_class;
    g_value_set_enum(&value, values->values[in.byte() % values->n_values].value);
  } else {
    g_value_unset(&value);
    return;
  }
  g_object_set_property(object, spec->name, &value);
  g_value_unset(&value);
}

/// A flush as after a seek: a segment follows.
inline void flush(GstHarness* h, Input& in) {
  gst_harness_push_event(h, gst_event_new_flush_start());
  gst_harness_push_event(h, gst_event_new_flush_stop(TRUE));
  gst_harness_push_event(h, segment_from(in));
}

} // namespace terrainseg::fuzz
