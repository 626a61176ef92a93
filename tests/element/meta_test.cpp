// SPDX-License-Identifier: LGPL-2.1-or-later
// The metadata on its way through other elements, and what a reader makes of it.
#include <gst/terrainseg/terrainsegmeta.h>

#include <cstring>

#include "harness.hpp"

namespace terrainseg::test {
namespace {

class MetaTest : public testing::Test {
 protected:
  static void SetUpTestSuite() { make_element("terrainseg"); } // loads the plugin, which registers the meta
};

constexpr int width = 320, height = 240;

/// An estimate with a value of its own in every field.
struct Sample {
  Estimate estimate;
  std::vector<std::uint16_t> boundary;
  Owned<GstBuffer> mask, boundary_buffer;

  Sample(int mask_width = width, int mask_height = height) {
    Estimate& e = estimate;
    e.frame = 123456789012;
    e.frame_width = width;
    e.frame_height = height;
    e.horizon_row = 90;
    e.horizon_confidence = 200;
    e.mask_region = {0, 0, width, height};
    e.confidence = 77;
    e.traversable_permille = 432;
    e.window = {112, 192, 96, 36};
    e.model_generation = 17;
    e.flags = flag_learned | flag_blocked;
    e.model_count = 2;
    e.models[0] = {{1, 2 * 256 + 128, 65535}, {3, 1u << 20, 0xffffffffu}, 1ull << 40, {10, 20, 30}};
    e.models[1] = {{256, 512, 768}, {256, 512, 768}, 7, {1, 2, 3}};
    mask.reset(new_mask_buffer(mask_width, mask_height));
    GstMapInfo map;
    gst_buffer_map(mask.get(), &map, GST_MAP_WRITE);
    for (gsize i = 0; i < map.size; ++i)
      map.data[i] = static_cast<guint8>(i % 3 == 0 ? 0 : i % 3 == 1 ? 128 : 255);
    gst_buffer_unmap(mask.get(), &map);
    for (int x = 0; x < mask_width; ++x)
      boundary.push_back(static_cast<std::uint16_t>(x % 7 == 0 ? height : x % height));
    boundary_buffer.reset(new_boundary_buffer(boundary));
  }
  bool attach_to(GstBuffer* buffer) const {
    return attach(buffer, estimate, mask.get(), boundary_buffer.get());
  }
};

TEST_F(MetaTest, EveryFieldComesBack) {
  Sample sample(33, 17); // odd: rows have no padding
  Owned<GstBuffer> buffer(gst_buffer_new());
  ASSERT_TRUE(sample.attach_to(buffer.get()));
  const EstimateReader reader(buffer.get());
  ASSERT_TRUE(reader) << (reader.error() ? reader.error() : "no meta");
  const Estimate &a = sample.estimate, &b = reader.estimate();
  EXPECT_EQ(b.frame, a.frame);
  EXPECT_EQ(b.frame_width, a.frame_width);
  EXPECT_EQ(b.frame_height, a.frame_height);
  EXPECT_EQ(b.horizon_row, a.horizon_row);
  EXPECT_EQ(b.horizon_confidence, a.horizon_confidence);
  EXPECT_EQ(b.mask_region, a.mask_region);
  EXPECT_EQ(b.confidence, a.confidence);
  EXPECT_EQ(b.traversable_permille, a.traversable_permille);
  EXPECT_EQ(b.window, a.window);
  EXPECT_EQ(b.model_generation, a.model_generation);
  EXPECT_EQ(b.flags, a.flags);
  ASSERT_EQ(b.model_count, 2);
  for (int i = 0; i < 2; ++i) {
    EXPECT_EQ(b.models[i].mean, a.models[i].mean);
    EXPECT_EQ(b.models[i].variance, a.models[i].variance);
    EXPECT_EQ(b.models[i].mass, a.models[i].mass);
    EXPECT_EQ(b.models[i].rgb, a.models[i].rgb);
  }
  EXPECT_EQ(b.mask.width, 33);
  EXPECT_EQ(b.mask.height, 17);
  EXPECT_EQ(bytes_of(b.mask), bytes_of(sample.mask.get()));
  EXPECT_EQ(std::vector(b.boundary.begin(), b.boundary.end()), sample.boundary);
}

TEST_F(MetaTest, TheAccessorsInCSayTheSame) {
  Sample sample;
  Owned<GstBuffer> buffer(gst_buffer_new());
  EXPECT_EQ(gst_buffer_get_terrain_seg_structure(buffer.get()), nullptr);
  ASSERT_TRUE(sample.attach_to(buffer.get()));
  const GstStructure* meta = gst_buffer_get_terrain_seg_structure(buffer.get());
  ASSERT_NE(meta, nullptr);
  EXPECT_EQ(gst_terrain_seg_meta_get_version(meta), 1u);
  EXPECT_EQ(gst_terrain_seg_meta_get_frame(meta), 123456789012u);
  EXPECT_EQ(gst_terrain_seg_meta_get_horizon_row(meta), 90);
  EXPECT_EQ(gst_terrain_seg_meta_get_mask(meta), sample.mask.get());
  EXPECT_EQ(gst_terrain_seg_meta_get_boundary(meta), sample.boundary_buffer.get());
  GstVideoRectangle window;
  gst_terrain_seg_meta_get_window(meta, &window);
  EXPECT_EQ(window.x, 112);
  EXPECT_EQ(window.h, 36);
  ASSERT_EQ(gst_terrain_seg_meta_get_model_count(meta), 2u);
  EXPECT_EQ(gst_terrain_seg_meta_get_model(meta, 2), nullptr);
  const GstStructure* model = gst_terrain_seg_meta_get_model(meta, 1);
  ASSERT_NE(model, nullptr);
  const GValue* mean = gst_structure_get_value(model, "mean");
  ASSERT_EQ(gst_value_array_get_size(mean), 3u);
  EXPECT_EQ(g_value_get_double(gst_value_array_get_value(mean, 2)), 3.0);
}

TEST_F(MetaTest, AttachingAgainReplaces) {
  Sample sample;
  Owned<GstBuffer> buffer(gst_buffer_new());
  ASSERT_TRUE(sample.attach_to(buffer.get()));
  sample.estimate.horizon_row = 5;
  ASSERT_TRUE(sample.attach_to(buffer.get()));
  EXPECT_EQ(gst_buffer_get_n_meta(buffer.get(), gst_meta_get_info(GST_TERRAIN_SEG_META_NAME)->api), 1u);
  EXPECT_EQ(EstimateReader(buffer.get()).estimate().horizon_row, 5);
}

TEST_F(MetaTest, ScalingRewritesRowsAndReferencesTheMask) {
  Sample sample;
  Owned<GstBuffer> from(gst_buffer_new()), to(gst_buffer_new());
  ASSERT_TRUE(sample.attach_to(from.get()));
  GstVideoInfo in = info_of(caps_text("I420", width, height)), out = info_of(caps_text("RGB", 160, 480));
  GstVideoMetaTransform scale = {&in, &out};
  GstMeta* meta = &gst_buffer_get_custom_meta(from.get(), GST_TERRAIN_SEG_META_NAME)->meta;
  ASSERT_TRUE(
      meta->info->transform_func(to.get(), meta, from.get(), g_quark_from_string("gst-video-scale"), &scale));
  const EstimateReader reader(to.get());
  ASSERT_TRUE(reader) << reader.error();
  const Estimate& e = reader.estimate();
  EXPECT_EQ(e.frame_width, 160);
  EXPECT_EQ(e.frame_height, 480);
  EXPECT_EQ(e.horizon_row, 180);
  EXPECT_EQ(e.mask_region, (Rectangle{0, 0, 160, 480}));
  EXPECT_EQ(e.window, (Rectangle{56, 384, 48, 72}));
  EXPECT_EQ(reader.mask(), sample.mask.get()); // the very buffer
  ASSERT_EQ(e.boundary.size(), sample.boundary.size());
  for (std::size_t x = 0; x < e.boundary.size(); ++x)
    EXPECT_EQ(e.boundary[x], sample.boundary[x] == height ? 480 : sample.boundary[x] * 2) << x;
  // The original stays as it was.
  EXPECT_EQ(EstimateReader(from.get()).estimate().horizon_row, 90);
}

TEST_F(MetaTest, OtherTransformsAndPartsOfBuffersAreRefused) {
  Sample sample;
  Owned<GstBuffer> from(gst_buffer_new_allocate(nullptr, 100, nullptr)), to(gst_buffer_new());
  ASSERT_TRUE(sample.attach_to(from.get()));
  GstMeta* meta = &gst_buffer_get_custom_meta(from.get(), GST_TERRAIN_SEG_META_NAME)->meta;
  EXPECT_FALSE(
      meta->info->transform_func(to.get(), meta, from.get(), g_quark_from_string("gst-video-flip"), nullptr));
  Owned<GstBuffer> part(gst_buffer_copy_region(from.get(), GST_BUFFER_COPY_ALL, 10, 20));
  EXPECT_EQ(gst_buffer_get_terrain_seg_structure(part.get()), nullptr);
  Owned<GstBuffer> whole(gst_buffer_copy(from.get()));
  EXPECT_NE(gst_buffer_get_terrain_seg_structure(whole.get()), nullptr);
  EXPECT_EQ(EstimateReader(whole.get()).mask(), sample.mask.get());
}

TEST_F(MetaTest, TagsAreExactlyVideoOrientationSize) {
  for (const char* name :
       {GST_TERRAIN_SEG_META_NAME, GST_TERRAIN_TRAINING_META_NAME, GST_TERRAIN_TRUTH_META_NAME}) {
    const GstMetaInfo* info = gst_meta_get_info(name);
    ASSERT_NE(info, nullptr) << name;
    EXPECT_TRUE(gst_meta_info_is_custom(info));
    const gchar* const* tags = gst_meta_api_type_get_tags(info->api);
    std::string all;
    for (; *tags; ++tags)
      all += std::string(*tags) + " ";
    EXPECT_EQ(all, "video orientation size ") << name;
  }
}

TEST_F(MetaTest, MetadataThatMakesNoSenseIsRefused) {
  const auto refused = [](auto spoil) {
    Sample sample;
    Owned<GstBuffer> buffer(gst_buffer_new());
    EXPECT_TRUE(sample.attach_to(buffer.get()));
    spoil(gst_custom_meta_get_structure(gst_buffer_get_custom_meta(buffer.get(), GST_TERRAIN_SEG_META_NAME)));
    const EstimateReader reader(buffer.get());
    return !reader && reader.error();
  };
  const auto set = [](const char* field, GType type, auto value) {
    return [=](GstStructure* s) { gst_structure_set(s, field, type, value, nullptr); };
  };
  EXPECT_TRUE(refused(set("frame-width", G_TYPE_INT, 0)));
  EXPECT_TRUE(refused(set("frame-height", G_TYPE_INT, 1 << 20)));
  EXPECT_TRUE(refused(set("horizon-row", G_TYPE_INT, height)));
  EXPECT_TRUE(refused(set("horizon-row", G_TYPE_INT, -2)));
  EXPECT_TRUE(refused(set("mask-w", G_TYPE_INT, width + 1)));
  EXPECT_TRUE(refused(set("mask-x", G_TYPE_INT, G_MAXINT)));
  EXPECT_TRUE(refused(set("window-h", G_TYPE_INT, -1)));
  Owned<GstBuffer> plain(gst_buffer_new_allocate(nullptr, 10, nullptr)); // no GstVideoMeta
  EXPECT_TRUE(refused(set("mask", GST_TYPE_BUFFER, plain.get())));
  EXPECT_TRUE(refused(set("boundary", GST_TYPE_BUFFER, plain.get()))); // 5 columns for 320
  Owned<GstBuffer> shorter(gst_buffer_new_allocate(nullptr, 100, nullptr));
  describe_mask(shorter.get(), width, height);
  EXPECT_TRUE(refused(set("mask", GST_TYPE_BUFFER, shorter.get())));
  EXPECT_TRUE(refused([](GstStructure* s) { gst_structure_remove_field(s, "frame-width"); }));
  EXPECT_FALSE(refused([](GstStructure*) {}));
}

/// Sends I420 frames with the sample's metadata through `elements` and gives what arrives.
std::vector<Owned<GstBuffer>> sent_through(const std::string& elements, const Sample& sample,
                                           int frames = 5) {
  auto pipeline = make_element("videotestsrc name=source num-buffers=" + std::to_string(frames) + " ! " +
                               caps_text("I420", width, height) + " ! identity name=tap ! " + elements +
                               " ! fakesink name=sink sync=false signal-handoffs=true");
  Owned<GstElement> tap(gst_bin_get_by_name(GST_BIN(pipeline.get()), "tap"));
  Owned<GstElement> sink(gst_bin_get_by_name(GST_BIN(pipeline.get()), "sink"));
  GstPad* pad = gst_element_get_static_pad(tap.get(), "src");
  gst_pad_add_probe(
      pad, GST_PAD_PROBE_TYPE_BUFFER,
      [](GstPad*, GstPadProbeInfo* info, gpointer data) -> GstPadProbeReturn {
        GstBuffer* buffer = gst_buffer_make_writable(GST_PAD_PROBE_INFO_BUFFER(info));
        EXPECT_TRUE(static_cast<const Sample*>(data)->attach_to(buffer));
        GST_PAD_PROBE_INFO_DATA(info) = buffer;
        return GST_PAD_PROBE_OK;
      },
      const_cast<Sample*>(&sample), nullptr);
  gst_object_unref(pad);
  std::vector<Owned<GstBuffer>> arrived;
  g_signal_connect(
      sink.get(), "handoff",
      G_CALLBACK(+[](GstElement*, GstBuffer* buffer, GstPad*, std::vector<Owned<GstBuffer>>* to) {
        to->emplace_back(gst_buffer_ref(buffer));
      }),
      &arrived);
  EXPECT_EQ(run_pipeline(pipeline.get()), "") << elements;
  EXPECT_EQ(arrived.size(), static_cast<std::size_t>(frames)) << elements;
  return arrived;
}

TEST_F(MetaTest, SurvivesConversionScalingAndH264) {
  if (!have("x264enc") || !have("avdec_h264"))
    GTEST_SKIP() << "x264enc or avdec_h264 is not here";
  const Sample sample;
  const auto arrived = sent_through(
      "videoconvert ! video/x-raw,format=BGRx ! videoscale ! video/x-raw,width=160,height=120 ! "
      "videoconvert ! video/x-raw,format=I420 ! x264enc bframes=2 speed-preset=ultrafast ! h264parse ! "
      "avdec_h264",
      sample, 12);
  for (const auto& buffer : arrived) {
    const EstimateReader reader(buffer.get());
    ASSERT_TRUE(reader);
    EXPECT_EQ(reader.estimate().frame_height, 120);
    EXPECT_EQ(reader.estimate().horizon_row, 45);
    EXPECT_EQ(reader.estimate().mask.width, width);
    EXPECT_EQ(bytes_of(reader.estimate().mask), bytes_of(sample.mask.get()));
    EXPECT_EQ(reader.estimate().window, (Rectangle{56, 96, 48, 18}));
  }
}

TEST_F(MetaTest, IsDroppedWhereItWouldBeWrong) {
  const Sample sample;
  for (const char* element : {"videocrop top=10", "videoflip video-direction=90r", "videobox left=-8"}) {
    if (!have(std::string(element, std::strcspn(element, " ")).c_str()))
      continue;
    for (const auto& buffer : sent_through(element, sample))
      EXPECT_EQ(gst_buffer_get_terrain_seg_structure(buffer.get()), nullptr) << element;
  }
}

TEST_F(MetaTest, SurvivesAChangeOfColourAndOfRate) {
  const Sample sample;
  for (const char* element :
       {"videoconvert ! video/x-raw,format=NV12", "videorate", "identity", "tee ! queue"})
    for (const auto& buffer : sent_through(element, sample)) {
      const EstimateReader reader(buffer.get());
      ASSERT_TRUE(reader) << element;
      EXPECT_EQ(reader.estimate().horizon_row, 90) << element;
      EXPECT_EQ(reader.mask(), sample.mask.get()) << element;
    }
}

} // namespace
} // namespace terrainseg::test
