// SPDX-License-Identifier: LGPL-2.1-or-later
// The metadata on its way through other elements, and what a reader makes of it.
#include <gst/terrainseg/terrainsegmeta.h>

#include <cmath>
#include <cstring>
#include <limits>

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
  Owned<GstBuffer> mask, boundary_buffer, confidence_map;

  Sample(int mask_width = width, int mask_height = height) {
    Estimate& e = estimate;
    e.frame = 123456789012;
    e.frame_width = width;
    e.frame_height = height;
    e.horizon_row = 90;
    e.horizon_confidence = 200;
    e.vanishing_row = 85 * 65536 + 16384;
    e.speed_over_height = -3 * 65536 / 2;
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
    confidence_map.reset(new_mask_buffer(5, 3));
    for (guint8 i = 0; i < 15; ++i)
      gst_buffer_memset(confidence_map.get(), i, static_cast<guint8>(17 * i), 1);
  }
  bool attach_to(GstBuffer* buffer) const {
    return attach(buffer, estimate, mask.get(), boundary_buffer.get(), "", confidence_map.get());
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
  EXPECT_EQ(b.vanishing_row, a.vanishing_row);
  EXPECT_EQ(b.speed_over_height, a.speed_over_height);
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
  EXPECT_EQ(b.confidence_map.width, 5);
  EXPECT_EQ(b.confidence_map.height, 3);
  EXPECT_EQ(bytes_of(b.confidence_map), bytes_of(sample.confidence_map.get()));
}

TEST_F(MetaTest, AConfidenceMapNeedNotBeThereAndMustMakeSense) {
  Sample sample;
  Owned<GstBuffer> without(gst_buffer_new()), broken(gst_buffer_new());
  ASSERT_TRUE(attach(without.get(), sample.estimate, sample.mask.get(), nullptr));
  const EstimateReader reader(without.get());
  ASSERT_TRUE(reader) << reader.error();
  EXPECT_TRUE(reader.estimate().confidence_map.empty());
  EXPECT_EQ(gst_terrain_seg_meta_get_confidence_map(gst_buffer_get_terrain_seg_structure(without.get())),
            nullptr);
  gst_buffer_set_size(sample.confidence_map.get(), 14); // of 5 x 3
  ASSERT_TRUE(sample.attach_to(broken.get()));
  const EstimateReader none(broken.get());
  EXPECT_FALSE(none);
  ASSERT_NE(none.error(), nullptr);
  EXPECT_NE(std::string(none.error()).find("confidence map"), std::string::npos) << none.error();
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
  EXPECT_EQ(gst_terrain_seg_meta_get_confidence_map(meta), sample.confidence_map.get());
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

/// The metas of estimates on a buffer.
guint count_on(GstBuffer* buffer) {
  return gst_buffer_get_n_meta(buffer, gst_meta_get_info(GST_TERRAIN_SEG_META_NAME)->api);
}

TEST_F(MetaTest, InstancesCoexistAndReplaceTheirOwnOnly) {
  Owned<GstBuffer> buffer(gst_buffer_new());
  Sample sample;
  const auto attach_as = [&](const char* instance, int frame) {
    sample.estimate.frame = static_cast<std::uint64_t>(frame);
    EXPECT_TRUE(attach(buffer.get(), sample.estimate, sample.mask.get(), nullptr, instance));
  };
  const auto frame_of = [&](const char* source) -> std::int64_t {
    const EstimateReader reader(buffer.get(), source);
    return reader ? static_cast<std::int64_t>(reader.estimate().frame) : -1;
  };
  attach_as("", 1);
  attach_as("left", 2);
  attach_as("right", 3);
  EXPECT_EQ(count_on(buffer.get()), 3u);
  EXPECT_EQ(frame_of("left"), 2);
  EXPECT_EQ(frame_of("right"), 3);
  EXPECT_EQ(frame_of("lef"), -1);
  EXPECT_EQ(frame_of(""), 3) << "the last";
  attach_as("left", 4);
  EXPECT_EQ(count_on(buffer.get()), 3u);
  EXPECT_EQ(frame_of("left"), 4);
  EXPECT_EQ(frame_of("right"), 3);
  EXPECT_EQ(frame_of(""), 4);
  const auto in_c = [&](const char* instance) -> std::int64_t {
    const GstStructure* meta = gst_buffer_get_terrain_seg_structure_of(buffer.get(), instance);
    return meta ? static_cast<std::int64_t>(gst_terrain_seg_meta_get_frame(meta)) : -1;
  };
  EXPECT_EQ(in_c(nullptr), 4);
  EXPECT_EQ(in_c(""), 1) << "the one without a name";
  EXPECT_EQ(in_c("right"), 3);
  EXPECT_STREQ(gst_terrain_seg_meta_get_instance(gst_buffer_get_terrain_seg_structure(buffer.get())), "left");
  // A copy, as behind a tee and a converter, keeps all of them and their names.
  const Owned<GstBuffer> copy(gst_buffer_copy_deep(buffer.get()));
  buffer.reset(gst_buffer_ref(copy.get()));
  EXPECT_EQ(count_on(buffer.get()), 3u);
  EXPECT_EQ(frame_of("right"), 3);
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
  EXPECT_EQ(e.vanishing_row, 170 * 65536 + 32768);
  EXPECT_EQ(e.speed_over_height, -3 * 65536 / 2);
  EXPECT_EQ(e.mask_region, (Rectangle{0, 0, 160, 480}));
  EXPECT_EQ(e.window, (Rectangle{56, 384, 48, 72}));
  EXPECT_EQ(reader.mask(), sample.mask.get()); // the very buffer
  EXPECT_EQ(gst_terrain_seg_meta_get_confidence_map(gst_buffer_get_terrain_seg_structure(to.get())),
            sample.confidence_map.get());
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
       {GST_TERRAIN_SEG_META_NAME, GST_TERRAIN_METRIC_META_NAME, GST_TERRAIN_TRAINING_META_NAME,
        GST_TERRAIN_VETO_META_NAME, GST_TERRAIN_TRUTH_META_NAME}) {
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
  Owned<GstBuffer> pieces(gst_buffer_new_allocate(nullptr, width * height / 2, nullptr));
  gst_buffer_append_memory(pieces.get(), gst_allocator_alloc(nullptr, width * height / 2, nullptr));
  describe_mask(pieces.get(), width, height);
  EXPECT_TRUE(refused(set("mask", GST_TYPE_BUFFER, pieces.get())));
  Owned<GstBuffer> low(new_boundary_buffer(std::vector<std::uint16_t>(width, height + 1)));
  EXPECT_TRUE(refused(set("boundary", GST_TYPE_BUFFER, low.get()))) << "rows below the frame";
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

// ---- metres ----------------------------------------------------------------------------------------------

/// Metres of six columns with a value of its own in every field.
struct Metres {
  static constexpr float unknown = std::numeric_limits<float>::quiet_NaN();
  static constexpr float free = std::numeric_limits<float>::infinity();
  std::vector<float> ranges{1.5F, 2.25F, free, unknown, 7.125F, 0.75F};
  std::vector<float> bearings{0.5F, 0.25F, 0, unknown, -0.25F, -0.5F};
  std::vector<float> low{1.25F, 2, 9, unknown, 5, 0.5F};
  std::vector<float> high{1.75F, 2.5F, free, unknown, free, 1};
  MetricEstimate metric;

  Metres() {
    metric = {ranges,
              bearings,
              low,
              high,
              0.5,
              0.125,
              -0.25,
              0.0625,
              0.375,
              8.5,
              metric_flag_pose | metric_flag_horizon};
  }
};

/// Bit by bit, because NaN is no equal of itself.
std::vector<std::uint32_t> bits(std::span<const float> values) {
  std::vector<std::uint32_t> found(values.size());
  std::memcpy(found.data(), values.data(), values.size_bytes());
  return found;
}

TEST_F(MetaTest, MetresComeBack) {
  const Metres sent;
  Owned<GstBuffer> buffer(gst_buffer_new());
  EXPECT_FALSE(MetricReader(buffer.get()));
  EXPECT_EQ(MetricReader(buffer.get()).error(), nullptr) << "none is no mistake";
  MetricWriter writer;
  ASSERT_TRUE(writer.attach(buffer.get(), sent.metric));
  ASSERT_TRUE(writer.attach(buffer.get(), sent.metric)); // replaces
  EXPECT_EQ(gst_buffer_get_n_meta(buffer.get(), gst_meta_get_info(GST_TERRAIN_METRIC_META_NAME)->api), 1u);
  const MetricReader reader(buffer.get());
  ASSERT_TRUE(reader) << reader.error();
  buffer.reset(); // the reader holds what it shows
  const MetricEstimate& m = reader.metric();
  EXPECT_EQ(bits(m.ranges), bits(sent.ranges));
  EXPECT_EQ(bits(m.bearings), bits(sent.bearings));
  EXPECT_EQ(bits(m.low), bits(sent.low));
  EXPECT_EQ(bits(m.high), bits(sent.high));
  EXPECT_EQ(m.height, 0.5);
  EXPECT_EQ(m.pitch, 0.125);
  EXPECT_EQ(m.roll, -0.25);
  EXPECT_EQ(m.yaw, 0.0625);
  EXPECT_EQ(m.range_min, 0.375);
  EXPECT_EQ(m.range_max, 8.5);
  EXPECT_EQ(m.flags, 3u);
}

TEST_F(MetaTest, TheAccessorsInCReadMetres) {
  const Metres sent;
  Owned<GstBuffer> buffer(gst_buffer_new());
  EXPECT_EQ(gst_buffer_get_terrain_metric_structure(buffer.get(), nullptr), nullptr);
  MetricWriter writer;
  ASSERT_TRUE(writer.attach(buffer.get(), sent.metric, "left"));
  const GstStructure* meta = gst_buffer_get_terrain_metric_structure(buffer.get(), nullptr);
  ASSERT_NE(meta, nullptr);
  EXPECT_EQ(gst_buffer_get_terrain_metric_structure(buffer.get(), "left"), meta);
  EXPECT_EQ(gst_buffer_get_terrain_metric_structure(buffer.get(), "right"), nullptr);
  EXPECT_EQ(gst_terrain_metric_meta_get_version(meta), 1u);
  const GstBuffer* ranges = gst_terrain_metric_meta_get_ranges(meta);
  // The layout that docs/metadata.md promises, written out: 1.5 is 0x3fc00000.
  const std::vector<guint8> bytes = bytes_of(const_cast<GstBuffer*>(ranges));
  ASSERT_EQ(bytes.size(), 24u);
  EXPECT_EQ((std::vector<guint8>{bytes.begin(), bytes.begin() + 4}), (std::vector<guint8>{0, 0, 0xc0, 0x3f}));
  EXPECT_EQ(gst_terrain_metric_meta_get_value(gst_terrain_metric_meta_get_bearings(meta), 4), -0.25F);
  EXPECT_EQ(gst_terrain_metric_meta_get_value(gst_terrain_metric_meta_get_low(meta), 5), 0.5F);
  EXPECT_EQ(gst_terrain_metric_meta_get_value(gst_terrain_metric_meta_get_high(meta), 4), Metres::free);
  EXPECT_TRUE(std::isnan(gst_terrain_metric_meta_get_value(gst_terrain_metric_meta_get_high(meta), 6)));
  EXPECT_TRUE(std::isnan(gst_terrain_metric_meta_get_value(nullptr, 0)));
  EXPECT_EQ(gst_terrain_metric_meta_get_height(meta), 0.5);
  EXPECT_EQ(gst_terrain_metric_meta_get_pitch(meta), 0.125);
  EXPECT_EQ(gst_terrain_metric_meta_get_roll(meta), -0.25);
  EXPECT_EQ(gst_terrain_metric_meta_get_yaw(meta), 0.0625);
  EXPECT_EQ(gst_terrain_metric_meta_get_range_min(meta), 0.375);
  EXPECT_EQ(gst_terrain_metric_meta_get_range_max(meta), 8.5);
  EXPECT_EQ(gst_terrain_metric_meta_get_flags(meta), 3u);
}

TEST_F(MetaTest, TicksGoWithTheMetres) {
  const std::array<RangeTick, 2> ticks{{{1, 0.5F, 0.75F}, {2.5F, 0.25F, 0.5F}}};
  Metres sent;
  const auto attached = [&](std::span<const RangeTick> some) {
    sent.metric.ticks = some;
    Owned<GstBuffer> buffer(gst_buffer_new());
    MetricWriter writer;
    EXPECT_TRUE(writer.attach(buffer.get(), sent.metric));
    return buffer;
  };
  const auto buffer = attached(ticks);
  const MetricReader reader(buffer.get());
  ASSERT_TRUE(reader) << reader.error();
  ASSERT_EQ(reader.metric().ticks.size(), 2u);
  EXPECT_EQ(reader.metric().ticks[1].range, 2.5F);
  EXPECT_EQ(reader.metric().ticks[1].column, 0.25F);
  EXPECT_EQ(reader.metric().ticks[1].row, 0.5F);
  GstBuffer* bytes =
      gst_terrain_metric_meta_get_ticks(gst_buffer_get_terrain_metric_structure(buffer.get(), nullptr));
  EXPECT_EQ(gst_buffer_get_size(bytes), 24u);
  EXPECT_EQ(gst_terrain_metric_meta_get_value(bytes, 3), 2.5F);
  const auto none = attached({});
  EXPECT_EQ(gst_terrain_metric_meta_get_ticks(gst_buffer_get_terrain_metric_structure(none.get(), nullptr)),
            nullptr);
  EXPECT_TRUE(MetricReader(none.get()));
  constexpr float nan = std::numeric_limits<float>::quiet_NaN();
  for (const RangeTick& wrong :
       {RangeTick{0, 0.5F, 0.5F}, RangeTick{1, nan, 0.5F}, RangeTick{1, 0.5F, 1e9F}}) {
    const auto refused = attached({&wrong, 1});
    const MetricReader bad(refused.get());
    EXPECT_TRUE(!bad && bad.error());
  }
}

/// The same bytes at an odd address, as a program may cut them out of a message.
Owned<GstBuffer> at_odd_address(GstBuffer* buffer) {
  const std::vector<guint8> bytes = bytes_of(buffer);
  Owned<GstBuffer> moved(gst_buffer_new_allocate(nullptr, bytes.size() + 1, nullptr));
  gst_buffer_resize(moved.get(), 1, -1);
  gst_buffer_fill(moved.get(), 0, bytes.data(), bytes.size());
  return moved;
}

// Reading them as if they were aligned is what UndefinedBehaviorSanitizer finds.
TEST_F(MetaTest, RowsAndMetresAtOddAddressesAreRead) {
  Sample sample;
  sample.boundary_buffer = at_odd_address(sample.boundary_buffer.get());
  Owned<GstBuffer> buffer(gst_buffer_new()), scaled(gst_buffer_new());
  ASSERT_TRUE(sample.attach_to(buffer.get()));
  const EstimateReader reader(buffer.get());
  ASSERT_TRUE(reader) << reader.error();
  EXPECT_EQ(std::vector(reader.estimate().boundary.begin(), reader.estimate().boundary.end()),
            sample.boundary);
  GstVideoInfo in = info_of(caps_text("I420", width, height)), out = info_of(caps_text("RGB", 160, 480));
  GstVideoMetaTransform scale = {&in, &out};
  GstMeta* meta = &gst_buffer_get_custom_meta(buffer.get(), GST_TERRAIN_SEG_META_NAME)->meta;
  ASSERT_TRUE(meta->info->transform_func(scaled.get(), meta, buffer.get(),
                                         g_quark_from_string("gst-video-scale"), &scale));
  EXPECT_EQ(EstimateReader(scaled.get()).estimate().boundary[1], 2);

  const Metres sent;
  Owned<GstBuffer> measured(gst_buffer_new());
  MetricWriter writer;
  ASSERT_TRUE(writer.attach(measured.get(), sent.metric));
  GstStructure* fields =
      gst_custom_meta_get_structure(gst_buffer_get_custom_meta(measured.get(), GST_TERRAIN_METRIC_META_NAME));
  for (const char* name : {"ranges", "bearings", "low", "high"}) {
    GstBuffer* column = nullptr;
    ASSERT_TRUE(gst_structure_get(fields, name, GST_TYPE_BUFFER, &column, nullptr));
    const Owned<GstBuffer> owned(column), moved = at_odd_address(column);
    gst_structure_set(fields, name, GST_TYPE_BUFFER, moved.get(), nullptr);
  }
  const MetricReader metres(measured.get());
  ASSERT_TRUE(metres) << metres.error();
  EXPECT_EQ(bits(metres.metric().ranges), bits(sent.ranges));
  EXPECT_EQ(bits(metres.metric().high), bits(sent.high));
  EXPECT_EQ(gst_terrain_metric_meta_get_value(gst_terrain_metric_meta_get_ranges(fields), 4), 7.125F);
}

TEST_F(MetaTest, MetresThatMakeNoSenseAreRefused) {
  const auto refused = [](auto spoil) {
    const Metres sent;
    Owned<GstBuffer> buffer(gst_buffer_new());
    MetricWriter writer;
    EXPECT_TRUE(writer.attach(buffer.get(), sent.metric));
    spoil(gst_custom_meta_get_structure(
        gst_buffer_get_custom_meta(buffer.get(), GST_TERRAIN_METRIC_META_NAME)));
    const MetricReader reader(buffer.get());
    return !reader && reader.error();
  };
  const auto set = [](const char* field, GType type, auto value) {
    return [=](GstStructure* s) { gst_structure_set(s, field, type, value, nullptr); };
  };
  const auto number = [&](const char* field, double value) { return set(field, G_TYPE_DOUBLE, value); };
  const auto column = [&](const char* field, std::vector<float> values) {
    return [=](GstStructure* s) {
      GstBuffer* buffer =
          values.empty() ? gst_buffer_new() : gst_buffer_new_memdup(values.data(), values.size() * 4);
      gst_structure_set(s, field, GST_TYPE_BUFFER, buffer, nullptr);
      gst_buffer_unref(buffer);
    };
  };
  EXPECT_FALSE(refused([](GstStructure*) {}));
  for (const char* field :
       {"ranges", "bearings", "low", "high", "height", "pitch", "roll", "yaw", "range-max", "range-min"})
    EXPECT_TRUE(refused([=](GstStructure* s) { gst_structure_remove_field(s, field); })) << field;
  for (const char* field : {"ranges", "bearings", "low", "high"}) {
    EXPECT_TRUE(refused(column(field, {1, 1, 1, 1, 1}))) << field << ": a column less";
    EXPECT_TRUE(refused(column(field, {1, 1, 1, 1, 1, 1, 1}))) << field << ": a column more";
    EXPECT_TRUE(refused(column(field, {}))) << field;
    Owned<GstBuffer> odd(gst_buffer_new_allocate(nullptr, 23, nullptr));
    EXPECT_TRUE(refused(set(field, GST_TYPE_BUFFER, odd.get()))) << field;
    EXPECT_TRUE(refused(set(field, G_TYPE_INT, 5))) << field << ": of another type";
  }
  EXPECT_TRUE(refused(column("ranges", {1, 1, 1, -1, 1, 1})));
  EXPECT_TRUE(refused(column("low", {1, 1, 1, -Metres::free, 1, 1})));
  EXPECT_TRUE(refused(column("bearings", {0, 0, 0, 3.2F, 0, 0})));
  EXPECT_TRUE(refused(column("bearings", {0, 0, 0, Metres::free, 0, 0})));
  EXPECT_TRUE(refused(number("height", 0)));
  EXPECT_TRUE(refused(number("height", HUGE_VAL)));
  for (const char* field : {"height", "range-min", "range-max"}) {
    EXPECT_TRUE(refused(number(field, 1e17))) << field << ": beyond 2^63 thousandths";
    EXPECT_FALSE(refused(number(field, 1e6))) << field;
  }
  EXPECT_TRUE(refused(number("pitch", NAN)));
  EXPECT_TRUE(refused(number("roll", 7)));
  EXPECT_TRUE(refused(number("range-max", 0)));
  EXPECT_TRUE(refused(number("range-max", HUGE_VAL)));
  EXPECT_TRUE(refused(number("range-min", -1)));
}

TEST_F(MetaTest, MetresBelongToTheEstimateOfTheirInstance) {
  const Metres sent;
  Metres other;
  other.metric.height = 2;
  MetricWriter writer;
  Owned<GstBuffer> buffer(gst_buffer_new());
  Sample six(6, 4);
  ASSERT_TRUE(attach(buffer.get(), six.estimate, six.mask.get(), six.boundary_buffer.get(), "left"));
  ASSERT_TRUE(writer.attach(buffer.get(), sent.metric, "left"));
  ASSERT_TRUE(writer.attach(buffer.get(), other.metric, "right"));
  EXPECT_EQ(MetricReader(buffer.get(), "left").metric().height, 0.5);
  EXPECT_EQ(MetricReader(buffer.get(), "right").metric().height, 2);
  EXPECT_EQ(MetricReader(buffer.get()).metric().height, 0.5) << "those of the last estimate";
  EXPECT_FALSE(MetricReader(buffer.get(), "middle"));
  // An estimate without metres has none, whatever another filter measured.
  ASSERT_TRUE(attach(buffer.get(), six.estimate, six.mask.get(), six.boundary_buffer.get(), "bold"));
  EXPECT_FALSE(MetricReader(buffer.get()));
  EXPECT_EQ(MetricReader(buffer.get()).error(), nullptr);
  // Metres of another number of columns than the boundary's are no metres of it.
  Sample five(5, 4);
  ASSERT_TRUE(attach(buffer.get(), five.estimate, five.mask.get(), five.boundary_buffer.get(), "left"));
  EXPECT_FALSE(MetricReader(buffer.get(), "left"));
  EXPECT_NE(MetricReader(buffer.get(), "left").error(), nullptr);
}

TEST_F(MetaTest, ScalingLeavesMetresAsTheyAreAndCropsDropThem) {
  const Metres sent;
  MetricWriter writer;
  Owned<GstBuffer> from(gst_buffer_new_allocate(nullptr, 100, nullptr)), to(gst_buffer_new());
  ASSERT_TRUE(writer.attach(from.get(), sent.metric));
  GstVideoInfo in = info_of(caps_text("I420", width, height)), out = info_of(caps_text("RGB", 160, 480));
  GstVideoMetaTransform scale = {&in, &out};
  GstMeta* meta = &gst_buffer_get_custom_meta(from.get(), GST_TERRAIN_METRIC_META_NAME)->meta;
  ASSERT_TRUE(
      meta->info->transform_func(to.get(), meta, from.get(), g_quark_from_string("gst-video-scale"), &scale));
  const MetricReader reader(to.get());
  ASSERT_TRUE(reader) << reader.error();
  EXPECT_EQ(bits(reader.metric().ranges), bits(sent.ranges));
  EXPECT_EQ(reader.metric().height, 0.5);
  EXPECT_FALSE(
      meta->info->transform_func(to.get(), meta, from.get(), g_quark_from_string("gst-video-flip"), nullptr));
  Owned<GstBuffer> part(gst_buffer_copy_region(from.get(), GST_BUFFER_COPY_ALL, 10, 20));
  EXPECT_EQ(gst_buffer_get_terrain_metric_structure(part.get(), nullptr), nullptr);
}

} // namespace
} // namespace terrainseg::test
