// SPDX-License-Identifier: LGPL-2.1-or-later
// What the element tests share: an element between two pads, frames of a simple road, messages.
#pragma once

#include <gst/check/gstharness.h>
#include <gst/gst.h>
#include <gst/video/video.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <cstring>
#include <string>
#include <vector>

#include "../support/road.hpp"
#include "owned.hpp"
#include "support/estimate_meta.hpp"
#include "support/video_frame.hpp"

namespace terrainseg::test {

/// The reverse of pixel_format_of().
inline GstVideoFormat gst_format_of(PixelFormat format) {
  int i = 0;
  while (pixel_format_of(static_cast<GstVideoFormat>(i)) != format)
    ++i;
  return static_cast<GstVideoFormat>(i);
}

inline const char* format_name(int format) {
  return gst_video_format_to_string(gst_format_of(static_cast<PixelFormat>(format)));
}

inline std::string caps_text(const std::string& format, int width, int height, const std::string& more = "") {
  return "video/x-raw,format=" + format + ",width=" + std::to_string(width) +
         ",height=" + std::to_string(height) + ",framerate=30/1" + more;
}

inline GstVideoInfo info_of(const std::string& caps) {
  Owned<GstCaps> parsed(gst_caps_from_string(caps.c_str()));
  GstVideoInfo info;
  EXPECT_TRUE(gst_video_info_from_caps(&info, parsed.get())) << caps;
  return info;
}

/// The road and the times of frame `index`.
inline void fill_with_road(GstBuffer* buffer, const GstVideoInfo& info, int index, unsigned seed) {
  GstVideoFrame frame;
  EXPECT_TRUE(gst_video_frame_map(&frame, &info, buffer, GST_MAP_WRITE));
  paint_road(frame, seed);
  gst_video_frame_unmap(&frame);
  GST_BUFFER_PTS(buffer) = gst_util_uint64_scale(index, GST_SECOND, 30);
  GST_BUFFER_DURATION(buffer) = GST_SECOND / 30;
}

/// A frame with GStreamer's own strides.
inline GstBuffer* new_frame(const GstVideoInfo& info, int index = 0, unsigned seed = 1) {
  GstBuffer* buffer = gst_buffer_new_allocate(nullptr, GST_VIDEO_INFO_SIZE(&info), nullptr);
  gst_buffer_memset(buffer, 0, 0, GST_VIDEO_INFO_SIZE(&info));
  fill_with_road(buffer, info, index, seed);
  return buffer;
}

/// The same picture with padded rows, planes at odd offsets and rubbish between them, described by a
/// GstVideoMeta.
inline GstBuffer* new_padded_frame(const GstVideoInfo& info, int index = 0, unsigned seed = 1) {
  gsize offset[GST_VIDEO_MAX_PLANES] = {};
  gint stride[GST_VIDEO_MAX_PLANES] = {};
  gsize size = 37;
  for (guint plane = 0; plane < GST_VIDEO_INFO_N_PLANES(&info); ++plane) {
    gint components[GST_VIDEO_MAX_COMPONENTS];
    gst_video_format_info_component(info.finfo, plane, components);
    stride[plane] = GST_VIDEO_INFO_PLANE_STRIDE(&info, plane) + 13 + 6 * static_cast<gint>(plane);
    offset[plane] = size;
    size += static_cast<gsize>(stride[plane]) * GST_VIDEO_INFO_COMP_HEIGHT(&info, components[0]) + 11;
  }
  GstBuffer* buffer = gst_buffer_new_allocate(nullptr, size, nullptr);
  gst_buffer_memset(buffer, 0, 0x5a, size);
  gst_buffer_add_video_meta_full(buffer, GST_VIDEO_FRAME_FLAG_NONE, GST_VIDEO_INFO_FORMAT(&info),
                                 GST_VIDEO_INFO_WIDTH(&info), GST_VIDEO_INFO_HEIGHT(&info),
                                 GST_VIDEO_INFO_N_PLANES(&info), offset, stride);
  fill_with_road(buffer, info, index, seed);
  return buffer;
}

inline std::vector<guint8> bytes_of(GstBuffer* buffer) {
  std::vector<guint8> bytes(gst_buffer_get_size(buffer));
  gst_buffer_extract(buffer, 0, bytes.data(), bytes.size());
  return bytes;
}

inline std::vector<guint8> bytes_of(const GrayView& view) {
  std::vector<guint8> bytes;
  for (int y = 0; y < view.height; ++y)
    bytes.insert(bytes.end(), view.plane.row(y), view.plane.row(y) + view.width);
  return bytes;
}

inline Owned<GstElement> make_element(const std::string& description) {
  GError* error = nullptr;
  GstElement* element = gst_parse_launch(description.c_str(), &error);
  EXPECT_EQ(error, nullptr) << (error ? error->message : "");
  g_clear_error(&error);
  return Owned<GstElement>(element ? GST_ELEMENT(gst_object_ref_sink(element)) : nullptr);
}

/// Texts of an error or a warning.
struct Report {
  std::string user, developer;
  bool contains(const char* text) const {
    return user.find(text) != std::string::npos || developer.find(text) != std::string::npos;
  }
};

inline std::vector<Report> reports(GstBus* bus, GstMessageType type) {
  std::vector<Report> found;
  while (GstMessage* message = gst_bus_pop_filtered(bus, type)) {
    GError* error = nullptr;
    gchar* debug = nullptr;
    if (type == GST_MESSAGE_ERROR)
      gst_message_parse_error(message, &error, &debug);
    else
      gst_message_parse_warning(message, &error, &debug);
    found.push_back({error->message, debug ? debug : ""});
    g_clear_error(&error);
    g_free(debug);
    gst_message_unref(message);
  }
  return found;
}

/// An element between two pads of the test, with a bus.
class Rig {
 public:
  explicit Rig(const std::string& description, const std::string& caps = "")
      : element_(make_element(description)), bus_(gst_bus_new()) {
    gst_element_set_bus(element_.get(), bus_.get());
    harness_ = gst_harness_new_with_element(element_.get(), "sink", "src");
    if (!caps.empty())
      set_caps(caps);
  }
  ~Rig() {
    gst_harness_teardown(harness_);
    gst_element_set_bus(element_.get(), nullptr);
  }
  Rig(const Rig&) = delete;
  Rig& operator=(const Rig&) = delete;

  void set_caps(const std::string& caps) {
    info_ = info_of(caps);
    gst_harness_set_src_caps(harness_, gst_caps_from_string(caps.c_str()));
  }
  /// Down to NULL or READY and up again, as a new stream of the same caps.
  void restart(GstState through, const std::string& caps) {
    EXPECT_NE(gst_element_set_state(element_.get(), through), GST_STATE_CHANGE_FAILURE);
    EXPECT_NE(gst_element_set_state(element_.get(), GST_STATE_PLAYING), GST_STATE_CHANGE_FAILURE);
    gst_harness_push_event(harness_, gst_event_new_stream_start("again"));
    set_caps(caps);
    GstSegment segment;
    gst_segment_init(&segment, GST_FORMAT_TIME);
    gst_harness_push_event(harness_, gst_event_new_segment(&segment));
  }
  GstFlowReturn push(GstBuffer* buffer) { return gst_harness_push(harness_, buffer); }
  Owned<GstBuffer> pull() { return Owned<GstBuffer>(gst_harness_try_pull(harness_)); }
  /// Pushes the next frame of the road and gives what came out.
  Owned<GstBuffer> step(GstBufferFlags flags = GST_BUFFER_FLAG_LIVE) {
    GstBuffer* buffer = new_frame(info_, index_++);
    if (flags != GST_BUFFER_FLAG_LIVE)
      GST_BUFFER_FLAG_SET(buffer, flags);
    EXPECT_EQ(push(buffer), GST_FLOW_OK);
    return pull();
  }
  guint generation_after(int frames) {
    guint generation = 0;
    for (int i = 0; i < frames; ++i)
      generation = EstimateReader(step().get()).estimate().model_generation;
    return generation;
  }
  guint64 counter(const char* name) {
    GstStructure* stats = nullptr;
    g_object_get(element_.get(), "stats", &stats, nullptr);
    guint64 value = 0;
    EXPECT_TRUE(gst_structure_get_uint64(stats, name, &value)) << name;
    gst_structure_free(stats);
    return value;
  }
  std::vector<Report> errors() { return reports(bus_.get(), GST_MESSAGE_ERROR); }
  std::vector<Report> warnings() { return reports(bus_.get(), GST_MESSAGE_WARNING); }
  GstHarness* harness() { return harness_; }
  GstElement* element() { return element_.get(); }
  GstBus* bus() { return bus_.get(); }
  const GstVideoInfo& info() const { return info_; }

 private:
  Owned<GstElement> element_;
  Owned<GstBus> bus_;
  GstHarness* harness_ = nullptr;
  GstVideoInfo info_;
  int index_ = 0;
};

/// How long a step may take: with a sanitizer TERRAINSEG_PATIENCE times as long.
inline GstClockTime patient(GstClockTime time) {
  const char* times = std::getenv("TERRAINSEG_PATIENCE");
  return times ? time * std::max(1, std::atoi(times)) : time;
}

/// Runs a pipeline to its end; the error when it did not get there.
inline std::string run_pipeline(GstElement* pipeline, GstClockTime timeout = 20 * GST_SECOND) {
  gst_element_set_state(pipeline, GST_STATE_PLAYING);
  Owned<GstBus> bus(gst_element_get_bus(pipeline));
  Owned<GstMessage> message(gst_bus_timed_pop_filtered(
      bus.get(), patient(timeout), static_cast<GstMessageType>(GST_MESSAGE_EOS | GST_MESSAGE_ERROR)));
  std::string result = message ? "" : "timeout";
  if (message && GST_MESSAGE_TYPE(message.get()) == GST_MESSAGE_ERROR) {
    GError* error = nullptr;
    gst_message_parse_error(message.get(), &error, nullptr);
    result = error->message;
    g_clear_error(&error);
  }
  gst_element_set_state(pipeline, GST_STATE_NULL);
  return result;
}

inline bool have(const char* factory) {
  GstElementFactory* found = gst_element_factory_find(factory);
  if (found)
    gst_object_unref(found);
  return found != nullptr;
}

class GstEnvironment : public testing::Environment {
 public:
  void SetUp() override { gst_init(nullptr, nullptr); }
};
inline const auto* const gst_environment = testing::AddGlobalTestEnvironment(new GstEnvironment);

} // namespace terrainseg::test
