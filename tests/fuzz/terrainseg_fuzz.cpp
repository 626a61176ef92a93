// SPDX-License-Identifier: LGPL-2.1-or-later
// What a pipeline may do to terrainseg, in any order: caps of all formats and sizes, frames with paddings and
// metas of their own, training pixels, gaps, flushes, segments, events, properties.
#include <gst/terrainseg/terrainsegmeta.h>

#include <glib/gstdio.h>

#include <cmath>
#include <cstdlib>
#include <cstring>
#include <iterator>
#include <string>

#include "element_input.hpp"
#include "elements/terrainseg.hpp"
#include "support/estimate_meta.hpp"

namespace {

using namespace terrainseg;
using namespace terrainseg::fuzz;

bool may_set(const GParamSpec* spec) {
  return std::strcmp(spec->name, "n-threads") != 0 && std::strcmp(spec->name, "qos") != 0 &&
         std::strcmp(spec->name, "name") != 0 && std::strcmp(spec->name, "parent") != 0;
}

class Session {
 public:
  explicit Session(Input& in) : in_(in), element_(gst_element_factory_make("terrainseg", nullptr)) {
    require(element_ != nullptr);
    for (int i = in_.byte() % 4; i > 0; --i)
      set_property_from(in_, G_OBJECT(element_), may_set);
    if (in_.chance(2))
      calibrate();
    harness_ = gst_harness_new_with_element(element_, "sink", "src");
    gst_object_unref(element_);
    set_caps();
  }
  ~Session() { gst_harness_teardown(harness_); }

  void step() {
    switch (in_.byte() % 16) {
    case 0:
      set_caps();
      break;
    case 1:
      set_property_from(in_, G_OBJECT(element_), may_set);
      break;
    case 2:
      flush(harness_, in_);
      break;
    case 3:
      gst_harness_push_event(harness_, segment_from(in_));
      break;
    case 4:
      gst_harness_push_event(harness_, gst_event_new_gap(in_.number(5), time_from(in_, 1)));
      break;
    case 5:
      push_near();
      break;
    case 6:
      gst_harness_push_event(harness_, gst_event_new_stream_start(in_.byte() & 1 ? "a" : "b"));
      break;
    case 7:
      ask();
      break;
    case 8:
      push_pose();
      break;
    default:
      push_frame();
      break;
    }
  }

 private:
  void set_caps() {
    GstCaps* caps = gst_caps_from_string(caps_from(in_).c_str());
    if (calibrated_ && !in_.chance(4)) // the camera's shape
      gst_caps_set_simple(caps, "width", G_TYPE_INT, 48, "height", G_TYPE_INT, 48, nullptr);
    require(gst_video_info_from_caps(&info_, caps));
    gst_harness_set_src_caps(harness_, caps);
  }

  void push_near() {
    GstStructure* fields = gst_structure_new_empty(GST_TERRAIN_SEG_NEAR_EVENT);
    if (!in_.chance(4))
      gst_structure_set(fields, "clear", G_TYPE_BOOLEAN, in_.byte() & 1, nullptr);
    GstEvent* event = gst_event_new_custom(
        in_.byte() & 1 ? GST_EVENT_CUSTOM_UPSTREAM : GST_EVENT_CUSTOM_DOWNSTREAM, fields);
    if (GST_EVENT_IS_UPSTREAM(event))
      gst_harness_push_upstream_event(harness_, event);
    else
      gst_harness_push_event(harness_, event);
  }

  /// A double that may be any: what radians are, or what none can be.
  double angle() {
    constexpr double odd[] = {NAN, HUGE_VAL, -HUGE_VAL, 1e308, -1e-308, 1.5707963267948966};
    return in_.chance(4) ? odd[in_.byte() % std::size(odd)] : (in_.byte() - 128) / 100.0;
  }

  void push_pose() {
    GstStructure* fields = gst_structure_new_empty(GST_TERRAIN_SEG_POSE_EVENT);
    for (const char* name : {"roll", "pitch"})
      if (!in_.chance(16))
        gst_structure_set(fields, name, G_TYPE_DOUBLE, angle(), nullptr);
    for (const char* name : {"yaw", "height"})
      if (in_.chance(3))
        gst_structure_set(fields, name, G_TYPE_DOUBLE, angle(), nullptr);
    if (in_.chance(16)) // of another type
      gst_structure_set(fields, "running-time", G_TYPE_INT, static_cast<gint>(in_.byte()), nullptr);
    else if (!in_.chance(16))
      gst_structure_set(fields, "running-time", G_TYPE_UINT64, time_from(in_, in_.number(4)), nullptr);
    if (in_.byte() & 1)
      gst_harness_push_upstream_event(harness_, gst_event_new_custom(GST_EVENT_CUSTOM_UPSTREAM, fields));
    else
      gst_harness_push_event(harness_, gst_event_new_custom(GST_EVENT_CUSTOM_DOWNSTREAM_OOB, fields));
  }

  /// A camera of one of the shapes that caps have, so that there are metres.
  void calibrate() {
    calibrated_ = true;
    static const std::string path = [] {
      gchar* name = nullptr;
      const int handle = g_file_open_tmp("terrainseg-fuzz-XXXXXX.yaml", &name, nullptr);
      require(handle >= 0 && g_close(handle, nullptr));
      require(g_file_set_contents(name,
                                  "{image_width: 64, image_height: 64, camera_matrix: {data: "
                                  "[60, 0, 31.5, 0, 60, 31.5, 0, 0, 1]}}",
                                  -1, nullptr));
      const std::string kept = name;
      g_free(name);
      static const std::string gone = kept;
      std::atexit([] { g_unlink(gone.c_str()); });
      return kept;
    }();
    g_object_set(element_, "camera-info", path.c_str(), "mount", "height=0.5,pitch=20deg,yaw=3deg,x=0.1",
                 nullptr);
  }

  void ask() {
    GstStructure* stats = nullptr;
    g_object_get(element_, "stats", &stats, nullptr);
    require(stats != nullptr);
    gst_structure_free(stats);
    if (in_.byte() & 1)
      g_signal_emit_by_name(element_, "reset");
    gst_harness_query_latency(harness_);
  }

  /// A frame of the caps' size: rows with padding, planes with gaps, one memory or two. Its meta may claim
  /// another size, other strides and other places than there are.
  GstBuffer* new_frame() {
    const guint planes = GST_VIDEO_INFO_N_PLANES(&info_);
    gsize offset[GST_VIDEO_MAX_PLANES] = {};
    gint stride[GST_VIDEO_MAX_PLANES] = {};
    const bool plain = !in_.chance(3);
    gsize size = plain ? 0 : in_.byte();
    for (guint plane = 0; plane < planes; ++plane) {
      gint components[GST_VIDEO_MAX_COMPONENTS];
      gst_video_format_info_component(info_.finfo, plane, components);
      stride[plane] = GST_VIDEO_INFO_PLANE_STRIDE(&info_, plane) + (plain ? 0 : in_.byte());
      offset[plane] = plain ? GST_VIDEO_INFO_PLANE_OFFSET(&info_, plane) : size;
      size += static_cast<gsize>(stride[plane]) * GST_VIDEO_INFO_COMP_HEIGHT(&info_, components[0]);
    }
    if (plain)
      size = GST_VIDEO_INFO_SIZE(&info_);
    if (in_.chance(16))
      size -= size > 4 ? in_.below(static_cast<int>(std::min<gsize>(size, 30000))) : 0; // cut short
    GstBuffer* buffer = gst_buffer_new_allocate(nullptr, size, nullptr);
    fill(buffer, size);
    if (in_.chance(4) && size > 2) { // in two memories
      GstBuffer* rest = gst_buffer_copy_region(buffer, GST_BUFFER_COPY_MEMORY, size / 2, size - size / 2);
      gst_buffer_resize(buffer, 0, static_cast<gssize>(size / 2));
      buffer = gst_buffer_append(buffer, rest);
    }
    const bool lies = in_.chance(8);
    if (!plain || lies)
      describe(buffer, lies, offset, stride);
    return buffer;
  }

  void describe(GstBuffer* buffer, bool lies, gsize (&offset)[GST_VIDEO_MAX_PLANES],
                gint (&stride)[GST_VIDEO_MAX_PLANES]) {
    auto width = static_cast<guint>(GST_VIDEO_INFO_WIDTH(&info_)),
         height = static_cast<guint>(GST_VIDEO_INFO_HEIGHT(&info_));
    if (lies) {
      const int what = in_.byte();
      if (what & 1)
        width = what & 16 ? static_cast<guint>(in_.number(4)) : width + in_.byte();
      if (what & 2)
        height = what & 32 ? static_cast<guint>(in_.number(4)) : height + in_.byte();
      for (guint plane = 0; plane < GST_VIDEO_INFO_N_PLANES(&info_); ++plane) {
        if (what & 4)
          stride[plane] = what & 64 ? static_cast<gint>(in_.number(4)) : in_.byte() - 128;
        if (what & 8)
          offset[plane] = in_.number(what & 128 ? 8 : 2);
      }
    }
    gst_buffer_add_video_meta_full(buffer, GST_VIDEO_FRAME_FLAG_NONE, GST_VIDEO_INFO_FORMAT(&info_), width,
                                   height, GST_VIDEO_INFO_N_PLANES(&info_), offset, stride);
  }

  void fill(GstBuffer* buffer, gsize size) {
    const auto pattern = in_.take(in_.byte() % 32);
    const std::uint8_t upper = in_.byte(), lower = in_.byte();
    GstMapInfo map;
    if (!gst_buffer_map(buffer, &map, GST_MAP_WRITE))
      return;
    for (gsize i = 0; i < size; ++i)
      map.data[i] = static_cast<std::uint8_t>((i * 2 < size ? upper : lower) +
                                              (pattern.empty() ? i * 7 % 5 : pattern[i % pattern.size()]));
    gst_buffer_unmap(buffer, &map);
  }

  void add_training(GstBuffer* buffer) {
    if (in_.byte() & 1) {
      gst_buffer_add_video_region_of_interest_meta(buffer, GST_TERRAIN_TRAINING_ROI, in_.byte(), in_.byte(),
                                                   static_cast<guint>(in_.number(in_.chance(8) ? 4 : 1)),
                                                   static_cast<guint>(in_.number(in_.chance(8) ? 4 : 1)));
      return;
    }
    const bool fits = !in_.chance(4);
    const int width = fits ? GST_VIDEO_INFO_WIDTH(&info_) : 1 + in_.byte(),
              height = fits ? GST_VIDEO_INFO_HEIGHT(&info_) : 1 + in_.byte();
    GstBuffer* mask = new_mask_buffer(width, height);
    gst_buffer_memset(mask, 0, in_.byte(), static_cast<gsize>(width) * static_cast<gsize>(height) / 2);
    GstCustomMeta* meta = gst_buffer_add_custom_meta(buffer, GST_TERRAIN_TRAINING_META_NAME);
    gst_structure_set(gst_custom_meta_get_structure(meta), "mask", GST_TYPE_BUFFER, mask, nullptr);
    gst_buffer_unref(mask);
  }

  void push_frame() {
    GstBuffer* buffer = new_frame();
    if (in_.chance(6))
      add_training(buffer);
    static constexpr guint flags[] = {0, GST_BUFFER_FLAG_DISCONT, GST_BUFFER_FLAG_GAP,
                                      GST_BUFFER_FLAG_CORRUPTED};
    GST_BUFFER_FLAG_SET(buffer, flags[in_.byte() % 8 < 4 ? 0 : in_.byte() % 4]);
    GST_BUFFER_PTS(buffer) = time_from(in_, frames_ * 33 * GST_MSECOND);
    GST_BUFFER_DURATION(buffer) = time_from(in_, 33 * GST_MSECOND);
    ++frames_;
    gst_harness_push(harness_, buffer);
    while (GstBuffer* out = gst_harness_try_pull(harness_)) {
      const EstimateReader reader(out);
      require(reader || reader.error() == nullptr);
      gst_buffer_unref(out);
    }
    while (GstEvent* event = gst_harness_try_pull_event(harness_))
      gst_event_unref(event);
  }

  Input& in_;
  bool calibrated_ = false;
  GstElement* element_;
  GstHarness* harness_ = nullptr;
  GstVideoInfo info_;
  GstClockTime frames_ = 0;
};

} // namespace

extern "C" int LLVMFuzzerInitialize(int*, char***) {
  start_gstreamer();
  require(GST_ELEMENT_REGISTER(terrainseg, nullptr));
  return 0;
}

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  Input in(data, size);
  Session session(in);
  for (int i = 0; i < 24 && !in.done(); ++i)
    session.step();
  return 0;
}
