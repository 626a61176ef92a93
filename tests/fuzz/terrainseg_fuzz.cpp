// SPDX-License-Identifier: LGPL-2.1-or-later
// What a pipeline may do to terrainseg, in any order: caps of all formats and sizes, frames with paddings and
// metas of their own, training and vetoed pixels, gaps, flushes, segments, events, properties.
#include <gst/terrainseg/terrainsegmeta.h>

#include <glib/gstdio.h>

#include <cmath>
#include <cstdlib>
#include <cstring>
#include <iterator>
#include <string>
#include <vector>

#include "element_input.hpp"
#include "support/elements.hpp"
#include "support/estimate_meta.hpp"

namespace {

using namespace terrainseg;
using namespace terrainseg::fuzz;

/// Threads take the time of an input; files have fuzzers of their own (settings, model_file, metric).
bool may_set(const GParamSpec* spec) {
  for (const char* name :
       {"n-threads", "qos", "name", "parent", "model-location", "settings-location", "camera-info", "mount"})
    if (std::strcmp(spec->name, name) == 0)
      return false;
  return true;
}

class Session {
 public:
  explicit Session(Input& in) : in_(in), element_(gst_element_factory_make("terrainseg", nullptr)) {
    require(element_ != nullptr);
    for (int i = in_.byte() % 4; i > 0; --i)
      set_property_from(in_, G_OBJECT(element_), may_set);
    if (in_.chance(2))
      calibrate();
    // A text that is no time, say, is refused at the start; the harness would take that for a failure.
    if (gst_element_set_state(element_, GST_STATE_PAUSED) == GST_STATE_CHANGE_FAILURE) {
      gboolean done = FALSE;
      g_signal_emit_by_name(element_, "unset-property", nullptr, &done);
      calibrated_ = false;
    }
    gst_element_set_state(element_, GST_STATE_NULL);
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
      flush(harness_->srcpad, in_);
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
    case 9:
      in_.byte() & 1 ? point() : learn_elsewhere();
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

  /// A pointer in a window behind the filter: the training window and ignored regions are drawn with it.
  void point() {
    static constexpr const char* kinds[] = {"mouse-button-press", "mouse-button-release", "mouse-move",
                                            "key-press"};
    g_object_set(element_, "navigation", in_.byte() != 1, nullptr);
    for (int i = 1 + in_.byte() % 4; i > 0; --i) {
      const bool odd = in_.chance(8);
      GstStructure* fields = gst_structure_new(
          "application/x-gst-navigation", "event", G_TYPE_STRING, kinds[i % 2 ? 1 : 0], "button", G_TYPE_INT,
          in_.byte() & 1 ? 1 : 3, "pointer_x", G_TYPE_DOUBLE, odd ? angle() * 1e9 : in_.byte() / 2.0,
          "pointer_y", G_TYPE_DOUBLE, odd ? angle() : in_.byte() / 2.0, nullptr);
      if (in_.chance(8))
        gst_structure_set(fields, "event", G_TYPE_STRING, kinds[in_.byte() % 4], nullptr);
      gst_harness_push_upstream_event(harness_, gst_event_new_navigation(fields));
    }
  }

  /// What is learned is kept in a file and taken again, perhaps by another state of the element; a property
  /// is given back; the element stops and starts.
  void learn_elsewhere() {
    static const std::string path = temporary("terrain");
    gboolean done = FALSE;
    switch (in_.byte() % 5) {
    case 0:
      g_signal_emit_by_name(element_, "save-model", path.c_str(), &done);
      break;
    case 1:
      g_signal_emit_by_name(element_, "load-model", path.c_str(), &done);
      break;
    case 2: {
      guint count = 0;
      GParamSpec** specs = g_object_class_list_properties(G_OBJECT_GET_CLASS(element_), &count);
      const char* const name = in_.chance(8) ? nullptr : specs[in_.byte() % count]->name;
      g_signal_emit_by_name(element_, "unset-property", name, &done);
      g_free(specs);
      break;
    }
    case 3:
      gst_element_set_state(element_, in_.byte() & 1 ? GST_STATE_READY : GST_STATE_NULL);
      gst_element_set_state(element_, GST_STATE_PLAYING);
      set_caps();
      break;
    default:
      g_signal_emit_by_name(element_, "reset");
      break;
    }
  }

  /// A camera of one of the shapes that caps have, so that there are metres.
  void calibrate() {
    calibrated_ = true;
    g_object_set(element_, "camera-info", camera_info_file().c_str(), "mount",
                 "height=0.5,pitch=20deg,yaw=3deg,x=0.1", nullptr);
    if (in_.chance(3)) // metres are drawn
      gst_util_set_object_arg(G_OBJECT(element_), "overlay-style", "map");
    if (in_.chance(2))
      g_object_set(element_, "overlay", TRUE, nullptr);
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

  /// Training pixels, or vetoed ones.
  void add_pixels(GstBuffer* buffer, const char* roi, const char* name) {
    if (in_.byte() & 1) {
      gst_buffer_add_video_region_of_interest_meta(buffer, roi, in_.byte(), in_.byte(),
                                                   static_cast<guint>(in_.number(in_.chance(8) ? 4 : 1)),
                                                   static_cast<guint>(in_.number(in_.chance(8) ? 4 : 1)));
      return;
    }
    const bool fits = !in_.chance(4);
    const int width = fits ? GST_VIDEO_INFO_WIDTH(&info_) : 1 + in_.byte(),
              height = fits ? GST_VIDEO_INFO_HEIGHT(&info_) : 1 + in_.byte();
    GstBuffer* mask = new_mask_buffer(width, height);
    gst_buffer_memset(mask, 0, in_.byte(), static_cast<gsize>(width) * static_cast<gsize>(height) / 2);
    GstCustomMeta* meta = gst_buffer_add_custom_meta(buffer, name);
    gst_structure_set(gst_custom_meta_get_structure(meta), "mask", GST_TYPE_BUFFER, mask, nullptr);
    gst_buffer_unref(mask);
  }

  void push_frame() {
    GstBuffer* buffer = frame_from(in_, info_);
    if (in_.chance(6))
      add_pixels(buffer, GST_TERRAIN_TRAINING_ROI, GST_TERRAIN_TRAINING_META_NAME);
    if (in_.chance(6))
      add_pixels(buffer, GST_TERRAIN_VETO_ROI, GST_TERRAIN_VETO_META_NAME);
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
      const MetricReader metres(out);
      require(metres || metres.error() == nullptr);
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
  return play<Session>(data, size, 24);
}
