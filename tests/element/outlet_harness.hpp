// SPDX-License-Identifier: LGPL-2.1-or-later
// Frames that carry an estimate, and what the tests of terrainextract and terraincombine ask of buffers.
#pragma once

#include <gst/check/gstharness.h>
#include <gst/gst.h>
#include <gst/terrainseg/terrainsegmeta.h>
#include <gst/video/video.h>

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "../support/same_estimate.hpp"
#include "../unit/exchange_estimates.hpp"
#include "exchange/vmti_klv.hpp"
#include "owned.hpp"
#include "support/estimate_meta.hpp"

namespace terrainseg::test {

constexpr GstClockTime frame_time = GST_SECOND / 25;

/// GStreamer with the plugin loaded, which registers the metadata.
class GStreamer : public testing::Environment {
 public:
  void SetUp() override {
    gst_init(nullptr, nullptr);
    GstPlugin* plugin = gst_plugin_load_by_name("terrainseg");
    ASSERT_NE(plugin, nullptr) << "the plugin is not in GST_PLUGIN_PATH";
    gst_object_unref(plugin);
  }
};

/// The mask as a buffer of its own.
inline Owned<GstBuffer> mask_buffer(const Estimate& e) {
  Owned<GstBuffer> buffer(new_mask_buffer(e.mask.width, e.mask.height));
  for (int y = 0; y < e.mask.height; ++y)
    gst_buffer_fill(buffer.get(), static_cast<gsize>(y) * e.mask.width, e.mask.plane.row(y), e.mask.width);
  return buffer;
}

inline Owned<GstBuffer> frame(gsize bytes, int index) {
  Owned<GstBuffer> buffer(gst_buffer_new_allocate(nullptr, bytes, nullptr));
  gst_buffer_memset(buffer.get(), 0, static_cast<guint8>(index), bytes);
  GST_BUFFER_PTS(buffer.get()) = index * frame_time;
  GST_BUFFER_DURATION(buffer.get()) = frame_time;
  return buffer;
}

inline Owned<GstBuffer> frame_with(const Estimate& e, gsize bytes, int index) {
  Owned<GstBuffer> buffer = frame(bytes, index);
  const Owned<GstBuffer> mask = mask_buffer(e), boundary(new_boundary_buffer(e.boundary));
  EXPECT_TRUE(attach(buffer.get(), e, mask.get(), boundary.get()));
  return buffer;
}

inline std::string text_of(GstBuffer* buffer) {
  std::string text(gst_buffer_get_size(buffer), '\0');
  gst_buffer_extract(buffer, 0, text.data(), text.size());
  return text;
}

/// The next event of a type that came out; others are dropped.
inline Owned<GstEvent> next_event(GstHarness* h, GstEventType type) {
  while (GstEvent* event = gst_harness_try_pull_event(h)) {
    if (GST_EVENT_TYPE(event) == type)
      return Owned<GstEvent>(event);
    gst_event_unref(event);
  }
  return nullptr;
}

/// Text of the first message of a type on the bus of a harness, without waiting; empty when there is none.
class Bus {
 public:
  explicit Bus(GstHarness* h) : element_(h->element), bus_(gst_bus_new()) {
    gst_element_set_bus(element_, bus_);
  }
  ~Bus() {
    gst_element_set_bus(element_, nullptr);
    gst_object_unref(bus_);
  }
  Bus(const Bus&) = delete;
  Bus& operator=(const Bus&) = delete;
  std::string text(GstMessageType type) {
    const Owned<GstMessage> message(gst_bus_pop_filtered(bus_, type));
    if (!message)
      return {};
    GError* error = nullptr;
    if (type == GST_MESSAGE_ERROR)
      gst_message_parse_error(message.get(), &error, nullptr);
    else
      gst_message_parse_warning(message.get(), &error, nullptr);
    std::string text = error->message;
    g_error_free(error);
    return text;
  }

 private:
  GstElement* element_;
  GstBus* bus_;
};

} // namespace terrainseg::test
