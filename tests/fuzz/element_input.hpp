// SPDX-License-Identifier: LGPL-2.1-or-later
// What the fuzzers of elements share: GStreamer without its plugins, segments, caps, frames, properties.
#pragma once

#include <gst/check/gstharness.h>
#include <gst/gst.h>
#include <gst/video/video.h>

#include <glib/gstdio.h>

#include <algorithm>
#include <array>
#include <cstdlib>
#include <iterator>
#include <string>
#include <vector>

#include "input.hpp"
#include "support/meta.hpp"

namespace terrainseg::fuzz {

/// Once, before the first input. A critical is a failure, by the signal that has the input kept; messages of
/// errors that the input deserves are not printed.
inline void start_gstreamer() {
  g_setenv("GST_PLUGIN_SYSTEM_PATH", "", TRUE);
  g_setenv("GST_PLUGIN_PATH", "", TRUE);
  g_setenv("GST_REGISTRY_UPDATE", "no", TRUE);
  gst_registry_fork_set_enabled(FALSE);
  gst_init(nullptr, nullptr);
  g_log_set_default_handler(
      [](const gchar* domain, GLogLevelFlags level, const gchar* message, gpointer data) {
        g_log_default_handler(domain, level, message, data);
        if (level & (G_LOG_LEVEL_CRITICAL | G_LOG_LEVEL_ERROR))
          std::abort();
      },
      nullptr);
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

/// One that GStreamer itself allows: with a start, and backwards with a stop.
inline GstEvent* segment_from(Input& in) {
  GstSegment segment;
  gst_segment_init(&segment, in.chance(8) ? GST_FORMAT_BYTES : GST_FORMAT_TIME);
  if (in.chance(4))
    segment.rate = in.chance(2) ? -1.0 : 2.0;
  if (in.chance(4))
    segment.start = segment.position = std::min<guint64>(in.number(in.chance(4) ? 8 : 5), G_MAXUINT64 - 1);
  if (in.chance(4))
    segment.base = in.number(in.chance(4) ? 8 : 5);
  if (segment.rate < 0 || in.chance(6))
    segment.stop = segment.start > G_MAXUINT64 / 2 ? segment.start : segment.start + in.number(5);
  return gst_event_new_segment(&segment);
}

inline std::string caps_from(Input& in) {
  static constexpr const char* formats[] = {
      "I420", "YV12", "NV12", "NV21",  "Y42B",      "Y444",      "YUY2",      "UYVY",     "RGB",  "BGR",
      "RGBx", "BGRx", "xRGB", "xBGR",  "RGBA",      "BGRA",      "ARGB",      "ABGR",     "NV16", "NV61",
      "NV24", "YVYU", "VYUY", "GRAY8", "GRAY16_LE", "P010_10LE", "I420_10LE", "I422_10LE"};
  static constexpr const char* rates[] = {"30/1", "25/1", "0/1", "1/3600", "2000000000/1", "1/2000000000"};
  static constexpr const char* colors[] = {"", ",colorimetry=bt601", ",colorimetry=bt709",
                                           ",colorimetry=1:4:7:1", ",colorimetry=bt2020"};
  const char* const format = formats[in.byte() % std::size(formats)];
  int width = 1 + in.below(96), height = 1 + in.below(72);
  const char* const rate = rates[in.byte() % std::size(rates)];
  const std::uint8_t more = in.byte();
  if (more >= 240) { // as large as motion needs it
    width += 160;
    height += 160;
  }
  return std::string("video/x-raw,format=") + format + ",width=" + std::to_string(width) +
         ",height=" + std::to_string(height) + ",framerate=" + rate + colors[more % std::size(colors)] +
         (more / 16 == 14 ? ",interlace-mode=mixed" : "");
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
  } else if (G_VALUE_HOLDS_FLAGS(&value)) {
    g_value_set_flags(&value, static_cast<guint>(in.number(4)) & G_PARAM_SPEC_FLAGS(spec)->flags_class->mask);
  } else if (G_VALUE_HOLDS_STRING(&value)) { // a few words of the input's, or what the property may hold
    static constexpr const char* texts[] = {"",
                                            "0.2,0.6,0.6,0.4",
                                            "0,0,1,1",
                                            "0.5,0.5,0.001,0.001",
                                            "1e300,nan,-1,inf",
                                            "9223372036854775807",
                                            "2026-11-22T20:00:00Z",
                                            "front"};
    const auto own = in.chance(4) ? in.take(in.byte() % 32) : std::span<const std::uint8_t>();
    const std::string text =
        own.empty() ? texts[in.byte() % std::size(texts)] : std::string(own.begin(), own.end());
    gchar* valid = g_utf8_make_valid(text.c_str(), -1);
    g_value_take_string(&value, valid);
  } else if (GST_VALUE_HOLDS_ARRAY(&value)) { // rectangles, seldom some other lists
    for (int i = in.byte() % 4; i > 0; --i) {
      GValue inner = G_VALUE_INIT;
      g_value_init(&inner, GST_TYPE_ARRAY);
      for (int numbers = in.chance(16) ? in.byte() % 8 : 4; numbers > 0; --numbers) {
        GValue number = G_VALUE_INIT;
        g_value_init(&number, G_TYPE_INT);
        g_value_set_int(&number, wild ? static_cast<gint>(in.number(4)) : in.byte());
        gst_value_array_append_and_take_value(&inner, &number);
      }
      gst_value_array_append_and_take_value(&value, &inner);
    }
  } else {
    g_value_unset(&value);
    return;
  }
  g_object_set_property(object, spec->name, &value);
  g_value_unset(&value);
}

/// A flush as after a seek, from the pad in front of an element: a segment follows.
inline void flush(GstPad* pad, Input& in) {
  gst_pad_push_event(pad, gst_event_new_flush_start());
  gst_pad_push_event(pad, gst_event_new_flush_stop(TRUE));
  gst_pad_push_event(pad, segment_from(in));
}

/// A name for a file that goes with the process.
inline std::string temporary(const char* suffix) {
  gchar* made = nullptr;
  const int handle =
      g_file_open_tmp((std::string("terrainseg-fuzz-XXXXXX.") + suffix).c_str(), &made, nullptr);
  require(handle >= 0 && g_close(handle, nullptr));
  const std::string name = made;
  g_free(made);
  static std::vector<std::string> all;
  all.push_back(name);
  static const bool gone = std::atexit([] {
                             for (const std::string& each : all)
                               g_unlink(each.c_str());
                           }) == 0;
  require(gone);
  return name;
}

/// A calibration of a camera of 64 x 64 pixels.
inline const std::string& camera_info_file() {
  static const std::string path = [] {
    const std::string name = temporary("yaml");
    require(g_file_set_contents(name.c_str(),
                                "{image_width: 64, image_height: 64, camera_matrix: {data: "
                                "[60, 0, 31.5, 0, 60, 31.5, 0, 0, 1]}}",
                                -1, nullptr));
    return name;
  }();
  return path;
}

inline void fill(Input& in, GstBuffer* buffer, gsize size) {
  const auto pattern = in.take(in.byte() % 32);
  const std::uint8_t upper = in.byte(), lower = in.byte();
  GstMapInfo map;
  if (!gst_buffer_map(buffer, &map, GST_MAP_WRITE))
    return;
  for (gsize i = 0; i < size; ++i)
    map.data[i] = static_cast<std::uint8_t>((i * 2 < size ? upper : lower) +
                                            (pattern.empty() ? i * 7 % 5 : pattern[i % pattern.size()]));
  gst_buffer_unmap(buffer, &map);
}

inline void describe(Input& in, const GstVideoInfo& info, GstBuffer* buffer, bool lies,
                     gsize (&offset)[GST_VIDEO_MAX_PLANES], gint (&stride)[GST_VIDEO_MAX_PLANES]) {
  auto width = static_cast<guint>(GST_VIDEO_INFO_WIDTH(&info)),
       height = static_cast<guint>(GST_VIDEO_INFO_HEIGHT(&info));
  if (lies) {
    const int what = in.byte();
    if (what & 1)
      width = what & 16 ? static_cast<guint>(in.number(4)) : width + in.byte();
    if (what & 2)
      height = what & 32 ? static_cast<guint>(in.number(4)) : height + in.byte();
    for (guint plane = 0; plane < GST_VIDEO_INFO_N_PLANES(&info); ++plane) {
      if (what & 4)
        stride[plane] = what & 64 ? static_cast<gint>(in.number(4)) : in.byte() - 128;
      if (what & 8)
        offset[plane] = in.number(what & 128 ? 8 : 2);
    }
  }
  gst_buffer_add_video_meta_full(buffer, GST_VIDEO_FRAME_FLAG_NONE, GST_VIDEO_INFO_FORMAT(&info), width,
                                 height, GST_VIDEO_INFO_N_PLANES(&info), offset, stride);
}

/// A frame of the caps' size: rows with padding, planes with gaps, one memory or two. Its meta may claim
/// another size, other strides and other places than there are.
inline GstBuffer* frame_from(Input& in, const GstVideoInfo& info) {
  const guint planes = GST_VIDEO_INFO_N_PLANES(&info);
  gsize offset[GST_VIDEO_MAX_PLANES] = {};
  gint stride[GST_VIDEO_MAX_PLANES] = {};
  const bool plain = !in.chance(3);
  gsize size = plain ? 0 : in.byte();
  for (guint plane = 0; plane < planes; ++plane) {
    gint components[GST_VIDEO_MAX_COMPONENTS];
    gst_video_format_info_component(info.finfo, plane, components);
    stride[plane] = GST_VIDEO_INFO_PLANE_STRIDE(&info, plane) + (plain ? 0 : in.byte());
    offset[plane] = plain ? GST_VIDEO_INFO_PLANE_OFFSET(&info, plane) : size;
    size += static_cast<gsize>(stride[plane]) * GST_VIDEO_INFO_COMP_HEIGHT(&info, components[0]);
  }
  if (plain)
    size = GST_VIDEO_INFO_SIZE(&info);
  if (in.chance(16))
    size -= size > 4 ? in.below(static_cast<int>(std::min<gsize>(size, 30000))) : 0; // cut short
  GstBuffer* buffer = gst_buffer_new_allocate(nullptr, size, nullptr);
  fill(in, buffer, size);
  if (in.chance(4) && size > 2) { // in two memories
    GstBuffer* rest = gst_buffer_copy_region(buffer, GST_BUFFER_COPY_MEMORY, size / 2, size - size / 2);
    gst_buffer_resize(buffer, 0, static_cast<gssize>(size / 2));
    buffer = gst_buffer_append(buffer, rest);
  }
  const bool lies = in.chance(8);
  if (!plain || lies)
    describe(in, info, buffer, lies, offset, stride);
  return buffer;
}

/// Takes the events that have come to either end of a harness.
inline void drain_events(GstHarness* h) {
  while (GstEvent* event = gst_harness_try_pull_event(h))
    gst_event_unref(event);
  while (GstEvent* event = gst_harness_try_pull_upstream_event(h))
    gst_event_unref(event);
}

/// One input of a fuzzer: a session of as many steps as it has decisions for, `most_steps` at most.
template <typename Session> int play(const std::uint8_t* data, std::size_t size, int most_steps) {
  Input in(data, size);
  Session session(in);
  for (int i = 0; i < most_steps && !in.done(); ++i)
    session.step();
  return 0;
}

} // namespace terrainseg::fuzz
