// SPDX-License-Identifier: LGPL-2.1-or-later
// The element terrainreference in a harness.
#include <algorithm>
#include <memory>
#include <string>

#include <gst/check/gstharness.h>
#include <gst/terrainseg/terrainsegmeta.h>
#include <gst/video/video.h>
#include <gtest/gtest.h>

#include "support/estimate_meta.hpp"

namespace terrainseg {
namespace {

constexpr int width = 160, height = 96;

class Harness {
 public:
  explicit Harness(const char* launch, const char* format = "I420")
      : harness_(gst_harness_new_parse(launch)) {
    set_caps(format);
    gst_harness_play(harness_);
  }
  ~Harness() { gst_harness_teardown(harness_); }

  void set_caps(const char* format) {
    GstCaps* caps =
        gst_caps_new_simple("video/x-raw", "format", G_TYPE_STRING, format, "width", G_TYPE_INT, width,
                            "height", G_TYPE_INT, height, "framerate", GST_TYPE_FRACTION, 25, 1, nullptr);
    gst_video_info_from_caps(&info_, caps);
    gst_harness_set_src_caps(harness_, caps);
  }

  /// Bright above row 40, dark ground below; the left fifth is bright all the way down.
  GstBuffer* frame() {
    GstBuffer* buffer = gst_harness_create_buffer(harness_, info_.size);
    GstVideoFrame view;
    EXPECT_TRUE(gst_video_frame_map(&view, &info_, buffer, GST_MAP_WRITE));
    for (guint c = 0; c < GST_VIDEO_INFO_N_COMPONENTS(&info_); ++c)
      for (int y = 0; y < GST_VIDEO_FRAME_COMP_HEIGHT(&view, c); ++y)
        for (int x = 0; x < GST_VIDEO_FRAME_COMP_WIDTH(&view, c); ++x) {
          const int row = y * height / GST_VIDEO_FRAME_COMP_HEIGHT(&view, c);
          const int column = x * width / GST_VIDEO_FRAME_COMP_WIDTH(&view, c);
          const bool chroma = GST_VIDEO_INFO_IS_YUV(&info_) && (c == 1 || c == 2);
          const int value = c == 3                    ? 255
                            : chroma                  ? 128
                            : row < 40 || column < 32 ? 210
                                                      : 70 + (x * 7 + y * 5) % 12;
          auto* data = static_cast<guint8*>(GST_VIDEO_FRAME_COMP_DATA(&view, c));
          data[y * GST_VIDEO_FRAME_COMP_STRIDE(&view, c) + x * GST_VIDEO_FRAME_COMP_PSTRIDE(&view, c)] =
              static_cast<guint8>(value);
        }
    gst_video_frame_unmap(&view);
    GST_BUFFER_PTS(buffer) = frames_++ * 40 * GST_MSECOND;
    return buffer;
  }

  GstBuffer* through(GstBuffer* buffer) { return gst_harness_push_and_pull(harness_, buffer); }
  GstHarness* operator->() { return harness_; }
  GstHarness* get() { return harness_; }

 private:
  GstHarness* harness_;
  GstVideoInfo info_;
  guint64 frames_ = 0;
};

int at(const Estimate& estimate, int x, int y) {
  return estimate.mask.plane.row(y)[x];
}

TEST(TerrainReference, AttachesWhatItFound) {
  Harness h("terrainreference");
  GstBuffer* out = h.through(h.frame());
  const EstimateReader reader(out);
  ASSERT_TRUE(reader) << reader.error();
  const Estimate& e = reader.estimate();
  EXPECT_EQ(e.frame_width, width);
  EXPECT_EQ(e.mask.width, width);
  EXPECT_EQ(e.mask.height, height);
  EXPECT_EQ(e.window, (Rectangle{64, 80, 32, 16}));
  EXPECT_EQ(e.horizon_row, -1);
  EXPECT_EQ(e.flags, flag_learned);
  EXPECT_EQ(at(e, 100, 90), 255);
  EXPECT_EQ(at(e, 10, 90), 0);
  EXPECT_EQ(at(e, 100, 10), 0);
  // Ground is 56 rows of 128 of 160 columns, less a rim of one pixel.
  EXPECT_NEAR(e.traversable_permille, 56 * 128 * 1000 / (96 * 160), 25);
  ASSERT_EQ(e.boundary.size(), 160U);
  EXPECT_EQ(e.boundary[10], 96);
  EXPECT_NEAR(e.boundary[100], 41, 1);
  EXPECT_GE(e.model_count, 1);
  EXPECT_NEAR(e.models[0].rgb[0], 70, 25);
  EXPECT_GT(e.confidence, 200);
  gst_buffer_unref(out);
}

class Formats : public testing::TestWithParam<const char*> {};
TEST_P(Formats, AreAllRead) {
  Harness h("terrainreference overlay=true", GetParam());
  GstBuffer* out = h.through(h.frame());
  const EstimateReader reader(out);
  ASSERT_TRUE(reader);
  EXPECT_NEAR(reader.estimate().traversable_permille, 467, 30);
  gst_buffer_unref(out);
}
INSTANTIATE_TEST_SUITE_P(Native, Formats,
                         testing::Values("I420", "YV12", "NV12", "NV21", "Y42B", "Y444", "YUY2", "UYVY",
                                         "RGB", "BGR", "RGBx", "BGRx", "xRGB", "xBGR", "RGBA", "BGRA", "ARGB",
                                         "ABGR"));

TEST(TerrainReference, PixelsAreTouchedByTheOverlayOnly) {
  for (const bool overlay : {false, true}) {
    Harness h(overlay ? "terrainreference overlay=true" : "terrainreference");
    GstBuffer* in = h.frame();
    GstMemory* memory = gst_buffer_peek_memory(in, 0);
    GstBuffer* kept = gst_buffer_ref(in); // as after a tee
    GstBuffer* out = h.through(in);
    EXPECT_EQ(gst_buffer_peek_memory(out, 0) == memory, !overlay);
    GstMapInfo before, after;
    gst_buffer_map(kept, &before, GST_MAP_READ);
    gst_buffer_map(out, &after, GST_MAP_READ);
    EXPECT_EQ(std::equal(before.data, before.data + before.size, after.data), !overlay);
    gst_buffer_unmap(kept, &before);
    gst_buffer_unmap(out, &after);
    gst_buffer_unref(kept);
    gst_buffer_unref(out);
  }
}

TEST(TerrainReference, UpstreamMaySayWhatTrains) {
  Harness h("terrainreference");
  GstBuffer* in = h.frame();
  gst_buffer_add_video_region_of_interest_meta(in, GST_TERRAIN_TRAINING_ROI, 40, 4, 60, 20); // the "sky"
  GstBuffer* out = h.through(in);
  const EstimateReader reader(out);
  ASSERT_TRUE(reader);
  EXPECT_EQ(at(reader.estimate(), 100, 10), 255);
  EXPECT_EQ(at(reader.estimate(), 10, 90), 255); // the bright strip hangs together with it
  EXPECT_EQ(at(reader.estimate(), 100, 90), 0);
  EXPECT_TRUE(reader.estimate().window.empty());
  gst_buffer_unref(out);
}

TEST(TerrainReference, ATrainingMaskOfAnotherSizeIsStretched) {
  Harness h("terrainreference");
  GstBuffer* in = h.frame();
  GstCustomMeta* meta = gst_buffer_add_custom_meta(in, GST_TERRAIN_TRAINING_META_NAME);
  ASSERT_NE(meta, nullptr);
  GstBuffer* mask = new_mask_buffer(16, 8);
  gst_buffer_memset(mask, 0, 0, 16 * 8);
  gst_buffer_memset(mask, 16, 255, 16); // the second of eight rows: frame rows 12 to 23
  gst_structure_set(gst_custom_meta_get_structure(meta), "mask", GST_TYPE_BUFFER, mask, nullptr);
  gst_buffer_unref(mask);
  GstBuffer* out = h.through(in);
  const EstimateReader reader(out);
  ASSERT_TRUE(reader);
  EXPECT_EQ(at(reader.estimate(), 100, 10), 255);
  EXPECT_EQ(at(reader.estimate(), 100, 90), 0);
  gst_buffer_unref(out);
}

TEST(TerrainReference, NothingIsLearnedWhileTheSensorSaysNo) {
  Harness h("terrainreference near-clear=false");
  GstBuffer* out = h.through(h.frame());
  {
    const EstimateReader reader(out);
    ASSERT_TRUE(reader);
    EXPECT_EQ(reader.estimate().flags, unsigned{flag_frozen | flag_unknown | flag_blocked});
    EXPECT_EQ(at(reader.estimate(), 100, 90), 128);
  }
  gst_buffer_unref(out);
  GstElement* element = gst_harness_find_element(h.get(), "terrainreference");
  g_object_set(element, "near-clear", TRUE, nullptr);
  gst_object_unref(element);
  out = h.through(h.frame());
  EXPECT_EQ(EstimateReader(out).estimate().flags, flag_learned);
  gst_buffer_unref(out);
}

TEST(TerrainReference, AnotherStreamStartsAnew) {
  Harness h("terrainreference");
  gst_buffer_unref(h.through(h.frame()));
  GstBuffer* out = h.through(h.frame());
  EXPECT_EQ(EstimateReader(out).estimate().model_generation, 2U);
  gst_buffer_unref(out);
  ASSERT_TRUE(gst_harness_push_event(h.get(), gst_event_new_stream_start("another")));
  h.set_caps("I420");
  GstSegment segment;
  gst_segment_init(&segment, GST_FORMAT_TIME);
  ASSERT_TRUE(gst_harness_push_event(h.get(), gst_event_new_segment(&segment)));
  out = h.through(h.frame());
  EXPECT_EQ(EstimateReader(out).estimate().model_generation, 1U);
  gst_buffer_unref(out);
}

std::string first_error(GstBus* bus) {
  std::unique_ptr<GstMessage, decltype(&gst_message_unref)> message(
      gst_bus_timed_pop_filtered(bus, GST_SECOND, GST_MESSAGE_ERROR), gst_message_unref);
  if (!message)
    return "no error";
  GError* error = nullptr;
  gst_message_parse_error(message.get(), &error, nullptr);
  const std::string text = error->message;
  g_error_free(error);
  return text;
}

TEST(TerrainReference, ContradictorySettingsAreRefusedByName) {
  GstElement* element = gst_element_factory_make("terrainreference", nullptr);
  ASSERT_NE(element, nullptr);
  GstBus* bus = gst_bus_new();
  gst_element_set_bus(element, bus);
  g_object_set(element, "training-models", 5, "learned-models", 5, nullptr);
  EXPECT_EQ(gst_element_set_state(element, GST_STATE_PAUSED), GST_STATE_CHANGE_FAILURE);
  EXPECT_NE(first_error(bus).find("learned_models = 5"), std::string::npos);
  gst_element_set_state(element, GST_STATE_NULL);
  gst_element_set_bus(element, nullptr);
  gst_object_unref(bus);
  gst_object_unref(element);
}

TEST(TerrainReference, AContradictionWhilePlayingIsToldAndTheOldValuesStay) {
  Harness h("terrainreference");
  GstElement* element = gst_harness_find_element(h.get(), "terrainreference");
  GstBus* bus = gst_bus_new();
  gst_element_set_bus(element, bus);
  const auto step = [&] {
    GstBuffer* out = h.through(h.frame());
    const guint generation = EstimateReader(out).estimate().model_generation;
    gst_buffer_unref(out);
    return generation;
  };
  const auto warnings = [&] {
    int count = 0;
    while (GstMessage* message = gst_bus_pop_filtered(bus, GST_MESSAGE_WARNING)) {
      GError* error = nullptr;
      gst_message_parse_warning(message, &error, nullptr);
      EXPECT_NE(std::string(error->message).find("must be above training_models"), std::string::npos);
      g_error_free(error);
      gst_message_unref(message);
      ++count;
    }
    return count;
  };
  const guint before = step();
  g_object_set(element, "training-models", 5, "learned-models", 5, nullptr);
  EXPECT_EQ(step(), before + 1);
  g_object_set(element, "learning", FALSE, nullptr); // what does not contradict takes effect with the rest
  EXPECT_EQ(step(), before + 1);
  EXPECT_EQ(warnings(), 1) << "once";
  g_object_set(element, "training-models", 2, "learning", TRUE, nullptr);
  EXPECT_EQ(step(), before + 2);
  EXPECT_EQ(warnings(), 0);
  gst_element_set_bus(element, nullptr);
  gst_object_unref(bus);
  gst_object_unref(element);
}

TEST(TerrainReference, PicturesWithoutColourAreToldOnce) {
  Harness h("terrainreference");
  GstElement* element = gst_harness_find_element(h.get(), "terrainreference");
  GstBus* bus = gst_bus_new();
  gst_element_set_bus(element, bus);
  for (int i = 0; i < 70; ++i)
    gst_buffer_unref(h.through(h.frame())); // its chroma is 128
  int count = 0;
  while (GstMessage* message = gst_bus_pop_filtered(bus, GST_MESSAGE_WARNING)) {
    gst_message_unref(message);
    ++count;
  }
  EXPECT_EQ(count, 1);
  gst_element_set_bus(element, nullptr);
  gst_object_unref(bus);
  gst_object_unref(element);
}

TEST(TerrainReference, AShortBufferIsAnErrorNotACrash) {
  Harness h("terrainreference");
  GstElement* element = gst_harness_find_element(h.get(), "terrainreference");
  GstBus* bus = gst_bus_new();
  gst_element_set_bus(element, bus);
  EXPECT_EQ(gst_harness_push(h.get(), gst_harness_create_buffer(h.get(), 100)), GST_FLOW_ERROR);
  EXPECT_NE(first_error(bus), "no error");
  gst_element_set_bus(element, nullptr);
  gst_object_unref(bus);
  gst_object_unref(element);
}

TEST(TerrainReference, GapsPassUntouched) {
  Harness h("terrainreference");
  GstBuffer* in = h.frame();
  GST_BUFFER_FLAG_SET(in, GST_BUFFER_FLAG_GAP);
  GstBuffer* out = h.through(in);
  EXPECT_FALSE(EstimateReader(out));
  gst_buffer_unref(out);
}

TEST(TerrainReference, DamagedFramesPassUntouchedAndNothingIsLearnedBackwards) {
  Harness h("terrainreference");
  const auto generation = [&] {
    GstBuffer* out = h.through(h.frame());
    const guint value = EstimateReader(out).estimate().model_generation;
    gst_buffer_unref(out);
    return value;
  };
  guint learned = generation();
  GstBuffer* damaged = h.frame();
  GST_BUFFER_FLAG_SET(damaged, GST_BUFFER_FLAG_CORRUPTED);
  GstBuffer* out = h.through(damaged);
  EXPECT_FALSE(EstimateReader(out));
  gst_buffer_unref(out);
  const guint next = generation();
  EXPECT_EQ(next, learned + 1) << "the damaged one was not learned";
  learned = next;
  for (const auto& [rate, applied_rate] : {std::pair{-1.0, 1.0}, {1.0, -1.0}}) {
    GstSegment segment;
    gst_segment_init(&segment, GST_FORMAT_TIME);
    segment.rate = rate;
    segment.applied_rate = applied_rate;
    segment.stop = 100 * GST_SECOND;
    EXPECT_TRUE(gst_harness_push_event(h.get(), gst_event_new_segment(&segment)));
    EXPECT_EQ(generation(), learned);
  }
}

TEST(TerrainReference, SharesMetasAndTypesWithTheMainPlugin) {
  GstElement* main = gst_element_factory_make("terrainseg", nullptr);
  GstElement* reference = gst_element_factory_make("terrainreference", nullptr);
  ASSERT_NE(main, nullptr);
  ASSERT_NE(reference, nullptr);
  gst_object_unref(main);
  gst_object_unref(reference);
  Harness h("terrainseg ! terrainreference overlay-style=contour overlay=true");
  GstBuffer* out = h.through(h.frame());
  const EstimateReader reader(out); // the second in the row replaces the first one's answer
  ASSERT_TRUE(reader);
  EXPECT_EQ(reader.estimate().horizon_row, -1);
  EXPECT_EQ(reader.estimate().mask_region, (Rectangle{0, 0, width, height}));
  gst_buffer_unref(out);
}

} // namespace
} // namespace terrainseg

int main(int argc, char** argv) {
  gst_init(&argc, &argv);
  testing::InitGoogleTest(&argc, argv);
  return RUN_ALL_TESTS();
}
