// SPDX-License-Identifier: LGPL-2.1-or-later
// The overlay from metadata alone: what the painter draws, in every format and layout, and nothing else.
#include <gst/check/gstharness.h>
#include <gst/terrainseg/terrainsegmeta.h>
#include <gtest/gtest.h>

#include <memory>
#include <string>
#include <vector>

#include "harness.hpp"
#include "painter.hpp"
#include "support/estimate_meta.hpp"
#include "support/meta.hpp"
#include "support/video_frame.hpp"

namespace {

using namespace terrainseg;

using Buffer = test::Owned<GstBuffer>;
using Harness = test::Owned<GstHarness>;

GstVideoInfo info_of(PixelFormat format, int width, int height) {
  GstVideoInfo info;
  gst_video_info_set_format(&info, test::gst_format_of(format), width, height);
  info.fps_n = 30;
  info.fps_d = 1;
  return info;
}

Harness overlay(const GstVideoInfo& info) {
  Harness h(gst_harness_new("terrainoverlay"));
  gst_harness_set_src_caps(h.get(), gst_video_info_to_caps(&info));
  return h;
}

/// A frame of noise; with `padding` its rows are further apart than its caps say.
Buffer frame(const GstVideoInfo& info, int padding = 0) {
  GstVideoInfo padded = info;
  for (int p = 0; p < static_cast<int>(GST_VIDEO_INFO_N_PLANES(&info)) && padding; ++p) {
    const int stride = GST_VIDEO_INFO_PLANE_STRIDE(&info, p) + padding;
    const int rows = GST_VIDEO_INFO_COMP_HEIGHT(&info, p == 0 ? 0 : 1);
    padded.stride[p] = stride;
    padded.offset[p] = p == 0 ? 0 : padded.size;
    padded.size = padded.offset[p] + static_cast<gsize>(stride) * static_cast<gsize>(rows);
  }
  GstBuffer* buffer = gst_buffer_new_allocate(nullptr, padded.size, nullptr);
  GstMapInfo map;
  gst_buffer_map(buffer, &map, GST_MAP_WRITE);
  for (gsize i = 0; i < map.size; ++i)
    map.data[i] = static_cast<guint8>((i * 2654435761U) >> 13);
  gst_buffer_unmap(buffer, &map);
  if (padding)
    gst_buffer_add_video_meta_full(buffer, GST_VIDEO_FRAME_FLAG_NONE, GST_VIDEO_INFO_FORMAT(&info),
                                   GST_VIDEO_INFO_WIDTH(&info), GST_VIDEO_INFO_HEIGHT(&info),
                                   GST_VIDEO_INFO_N_PLANES(&info), padded.offset, padded.stride);
  GST_BUFFER_PTS(buffer) = 0;
  return Buffer(buffer);
}

/// An estimate with everything that is drawn, and the buffer of its mask.
struct Known {
  Estimate estimate;
  GstBuffer* mask;
  Known(int width, int height, int mask_width, int mask_height)
      : mask(new_mask_buffer(mask_width, mask_height)) {
    GstMapInfo map;
    gst_buffer_map(mask, &map, GST_MAP_WRITE);
    for (gsize i = 0; i < map.size; ++i)
      map.data[i] = i % 7 < 3 ? 255 : i % 7 < 5 ? 128 : 0;
    pixels.assign(map.data, map.data + map.size);
    gst_buffer_unmap(mask, &map);
    estimate.frame_width = width;
    estimate.frame_height = height;
    estimate.mask = {{pixels.data(), mask_width}, mask_width, mask_height};
    estimate.mask_region = {0, 0, width, height};
    estimate.window = {width / 4, height / 2, width / 2, height / 4};
    estimate.horizon_row = height / 3;
    estimate.flags = flag_learned;
    estimate.model_count = 2;
    for (int i = 0; i < 2; ++i) {
      estimate.models[i].mass = 100 + 50 * static_cast<std::uint64_t>(i);
      estimate.models[i].rgb = {200, 100, static_cast<std::uint8_t>(90 * i)};
    }
  }
  ~Known() { gst_buffer_unref(mask); }
  Known(const Known&) = delete;
  Known& operator=(const Known&) = delete;

 private:
  std::vector<guint8> pixels;
};

std::vector<guint8> bytes_of(GstBuffer* buffer) {
  GstMapInfo map;
  if (!gst_buffer_map(buffer, &map, GST_MAP_READ))
    return {};
  std::vector<guint8> bytes(map.data, map.data + map.size);
  gst_buffer_unmap(buffer, &map);
  return bytes;
}

class TerrainOverlay : public testing::Test {
 protected:
  void SetUp() override { ASSERT_TRUE(register_metas()); }
};

TEST_F(TerrainOverlay, DrawsWhatThePainterDraws) {
  for (int f = 0; f < pixel_format_count; ++f)
    for (const int padding : {0, 12})
      for (const char* style : {"tint", "contour", "mask", "models"}) {
        const GstVideoInfo info = info_of(static_cast<PixelFormat>(f), 83, 61);
        const Harness h = overlay(info);
        gst_util_set_object_arg(G_OBJECT(h->element), "overlay-style", style);
        g_object_set(h->element, "overlay-alpha", 0.5, "overlay-color", 0xffe01020U, nullptr);
        const Known known(83, 61, 42, 31);
        Buffer in = frame(info, padding), expected = frame(info, padding);
        ASSERT_TRUE(attach(in.get(), known.estimate, known.mask, nullptr));
        int chosen = 0;
        g_object_get(h->element, "overlay-style", &chosen, nullptr);
        {
          const MappedFrame mapped(info, expected.get(), GST_MAP_READWRITE);
          ASSERT_TRUE(mapped);
          paint(mapped.mutable_view(), known.estimate, {static_cast<OverlayStyle>(chosen), 128, 0xffe01020});
        }
        const Buffer out(gst_harness_push_and_pull(h.get(), in.release()));
        ASSERT_TRUE(out);
        EXPECT_EQ(bytes_of(out.get()), bytes_of(expected.get()))
            << gst_video_format_to_string(GST_VIDEO_INFO_FORMAT(&info)) << " " << style << " padding "
            << padding;
        EXPECT_NE(bytes_of(out.get()), bytes_of(frame(info, padding).get()));
        EXPECT_NE(gst_buffer_get_custom_meta(out.get(), GST_TERRAIN_SEG_META_NAME), nullptr)
            << "the metadata goes on";
      }
}

TEST_F(TerrainOverlay, FramesWithoutMetadataPassUntouched) {
  const GstVideoInfo info = info_of(PixelFormat::NV12, 64, 36);
  const Harness h = overlay(info);
  Buffer in = frame(info);
  const auto before = bytes_of(in.get());
  // Somebody else holds the frame too, as after a tee.
  const Buffer held(gst_buffer_ref(in.get()));
  const Buffer out(gst_harness_push_and_pull(h.get(), in.release()));
  EXPECT_EQ(gst_buffer_peek_memory(out.get(), 0), gst_buffer_peek_memory(held.get(), 0))
      << "copied for nothing";
  EXPECT_EQ(bytes_of(out.get()), before);
}

TEST_F(TerrainOverlay, TheOtherHolderKeepsItsPixels) {
  const GstVideoInfo info = info_of(PixelFormat::I420, 64, 36);
  const Harness h = overlay(info);
  const Known known(64, 36, 64, 36);
  Buffer in = frame(info);
  ASSERT_TRUE(attach(in.get(), known.estimate, known.mask, nullptr));
  const auto before = bytes_of(in.get());
  const Buffer held(gst_buffer_ref(in.get()));
  const Buffer out(gst_harness_push_and_pull(h.get(), in.release()));
  EXPECT_EQ(bytes_of(held.get()), before);
  EXPECT_NE(bytes_of(out.get()), before);
}

TEST_F(TerrainOverlay, InvisibleIsNotACopy) {
  const GstVideoInfo info = info_of(PixelFormat::RGB, 64, 36);
  const Harness h = overlay(info);
  g_object_set(h->element, "overlay-alpha", 0.0, nullptr);
  const Known known(64, 36, 64, 36);
  Buffer in = frame(info);
  ASSERT_TRUE(attach(in.get(), known.estimate, known.mask, nullptr));
  const Buffer held(gst_buffer_ref(in.get()));
  const Buffer out(gst_harness_push_and_pull(h.get(), in.release()));
  EXPECT_EQ(gst_buffer_peek_memory(out.get(), 0), gst_buffer_peek_memory(held.get(), 0));
}

TEST_F(TerrainOverlay, AnEstimateOfAnotherSizeIsStretched) {
  const GstVideoInfo info = info_of(PixelFormat::Y444, 64, 36);
  const Harness h = overlay(info);
  const Known half(32, 18, 32, 18);
  Buffer in = frame(info), expected = frame(info);
  ASSERT_TRUE(attach(in.get(), half.estimate, half.mask, nullptr));
  {
    const MappedFrame mapped(info, expected.get(), GST_MAP_READWRITE);
    paint(mapped.mutable_view(), half.estimate, PaintStyle{});
  }
  const Buffer out(gst_harness_push_and_pull(h.get(), in.release()));
  EXPECT_EQ(bytes_of(out.get()), bytes_of(expected.get()));
  // Line of the horizon: row 6 of 18 is row 12 of 36, all across.
  const auto before = bytes_of(frame(info).get()), after = bytes_of(out.get());
  int changed = 0;
  for (int x = 0; x < 64; ++x)
    changed += before[12 * 64 + x] != after[12 * 64 + x];
  EXPECT_GT(changed, 55);
}

TEST_F(TerrainOverlay, PropertiesTakeEffectWhilePlaying) {
  const GstVideoInfo info = info_of(PixelFormat::RGBx, 64, 36);
  const Harness h = overlay(info);
  const Known known(64, 36, 64, 36);
  const auto drawn = [&] {
    Buffer in = frame(info);
    EXPECT_TRUE(attach(in.get(), known.estimate, known.mask, nullptr));
    return bytes_of(Buffer(gst_harness_push_and_pull(h.get(), in.release())).get());
  };
  const auto first = drawn();
  g_object_set(h->element, "overlay-alpha", 0.9, nullptr);
  const auto second = drawn();
  EXPECT_NE(first, second);
  g_object_set(h->element, "overlay-color", 0xff0000ffU, nullptr);
  const auto third = drawn();
  EXPECT_NE(second, third);
  gst_util_set_object_arg(G_OBJECT(h->element), "overlay-style", "contour");
  EXPECT_NE(third, drawn());
  for (const char* name : {"overlay-style", "overlay-alpha", "overlay-color"}) {
    const GParamSpec* spec = g_object_class_find_property(G_OBJECT_GET_CLASS(h->element), name);
    ASSERT_NE(spec, nullptr);
    EXPECT_TRUE(spec->flags & GST_PARAM_CONTROLLABLE);
  }
}

TEST_F(TerrainOverlay, DamagedMetadataIsToldOnceAndNotDrawn) {
  const GstVideoInfo info = info_of(PixelFormat::I420, 64, 36);
  const Harness h = overlay(info);
  GstBus* bus = gst_bus_new();
  gst_element_set_bus(h->element, bus);
  Known known(64, 36, 64, 36);
  known.estimate.horizon_row = 5000;
  for (int n = 0; n < 3; ++n) {
    Buffer in = frame(info);
    const auto before = bytes_of(in.get());
    ASSERT_TRUE(attach(in.get(), known.estimate, known.mask, nullptr));
    const Buffer out(gst_harness_push_and_pull(h.get(), in.release()));
    ASSERT_TRUE(out);
    EXPECT_EQ(bytes_of(out.get()), before);
  }
  int warnings = 0;
  while (GstMessage* message = gst_bus_pop_filtered(bus, GST_MESSAGE_WARNING)) {
    ++warnings;
    gst_message_unref(message);
  }
  EXPECT_EQ(warnings, 1);
  gst_element_set_bus(h->element, nullptr);
  gst_object_unref(bus);
}

TEST_F(TerrainOverlay, NoMetadataAtAllIsOneWarning) {
  const GstVideoInfo info = info_of(PixelFormat::I420, 64, 36);
  const Known known(64, 36, 64, 36);
  // A second of frames; a short stream; one whose second frame has metadata; one of another source.
  struct Stream {
    int frames;
    bool with_metadata;
    const char* source;
    int told_at; // the frame; -1: never
  };
  for (const Stream& stream : {Stream{60, false, "", 24}, Stream{1, false, "", 1}, Stream{2, true, "", -1},
                               Stream{2, true, "rear", 2}}) {
    const char* source = stream.source;
    const Harness h = overlay(info);
    g_object_set(h->element, "source", source, nullptr);
    GstBus* bus = gst_bus_new();
    gst_element_set_bus(h->element, bus);
    int told_at = -1, told = 0;
    const auto listen = [&](int n) {
      while (GstMessage* message = gst_bus_pop_filtered(bus, GST_MESSAGE_WARNING)) {
        GError* error = nullptr;
        gst_message_parse_warning(message, &error, nullptr);
        EXPECT_NE(std::string(error->message).find("No terrain metadata"), std::string::npos)
            << error->message;
        EXPECT_NE(std::string(error->message).find("nothing is drawn"), std::string::npos) << error->message;
        EXPECT_NE(std::string(error->message).find(source), std::string::npos) << error->message;
        g_error_free(error);
        gst_message_unref(message);
        told_at = n;
        ++told;
      }
    };
    for (int n = 0; n < stream.frames; ++n) {
      Buffer in = frame(info);
      if (stream.with_metadata && n == 1) {
        ASSERT_TRUE(attach(in.get(), known.estimate, known.mask, nullptr));
      }
      ASSERT_TRUE(Buffer(gst_harness_push_and_pull(h.get(), in.release())));
      listen(n);
    }
    gst_harness_push_event(h.get(), gst_event_new_eos());
    listen(stream.frames);
    EXPECT_EQ(told_at, stream.told_at) << stream.frames << " frames, source=" << source;
    EXPECT_EQ(told, stream.told_at >= 0);
    gst_element_set_bus(h->element, nullptr);
    gst_object_unref(bus);
  }
}

TEST_F(TerrainOverlay, AShortBufferIsAnError) {
  const GstVideoInfo info = info_of(PixelFormat::I420, 64, 36);
  const Harness h = overlay(info);
  GstBus* bus = gst_bus_new();
  gst_element_set_bus(h->element, bus);
  const Known known(64, 36, 64, 36);
  Buffer in(gst_buffer_new_allocate(nullptr, 100, nullptr));
  ASSERT_TRUE(attach(in.get(), known.estimate, known.mask, nullptr));
  EXPECT_EQ(gst_harness_push(h.get(), in.release()), GST_FLOW_ERROR);
  const test::Owned<GstMessage> message(gst_bus_pop_filtered(bus, GST_MESSAGE_ERROR));
  EXPECT_TRUE(message);
  gst_element_set_bus(h->element, nullptr);
  gst_object_unref(bus);
}

} // namespace
