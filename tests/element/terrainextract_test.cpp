// SPDX-License-Identifier: LGPL-2.1-or-later
#include "outlet_harness.hpp"

#include <gst/app/gstappsink.h>
#include <gst/app/gstappsrc.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <map>
#include <utility>

#include "exchange/json_lines.hpp"

namespace terrainseg::test {
namespace {

const testing::Environment* const gstreamer = testing::AddGlobalTestEnvironment(new GStreamer);

constexpr const char* raw_caps = "video/x-raw,format=I420,width=64,height=48,framerate=25/1";
constexpr gsize raw_size = 64 * 48 * 3 / 2;

Owned<GstHarness> harness(const char* in, const char* out) {
  Owned<GstHarness> h(gst_harness_new("terrainextract"));
  if (out)
    gst_harness_set_sink_caps_str(h.get(), out);
  gst_harness_set_src_caps_str(h.get(), in);
  return h;
}

OwnedEstimate some(unsigned seed, int mask_width = 64, int mask_height = 48) {
  std::mt19937 random(seed);
  return noisy(64, 48, mask_width, mask_height, 20, random);
}

/// Pushes and takes what came out of it at once: the element has no thread of its own.
Owned<GstBuffer> through(GstHarness* h, Owned<GstBuffer> buffer) {
  EXPECT_EQ(gst_harness_push(h, buffer.release()), GST_FLOW_OK);
  return Owned<GstBuffer>(gst_harness_try_pull(h));
}

std::vector<std::uint8_t> picture_of(GstHarness* h, GstBuffer* buffer, int& width, int& height) {
  const Owned<GstCaps> caps(gst_pad_get_current_caps(h->sinkpad));
  GstVideoInfo info;
  GstVideoFrame f;
  EXPECT_TRUE(gst_video_info_from_caps(&info, caps.get()));
  EXPECT_TRUE(gst_video_frame_map(&f, &info, buffer, GST_MAP_READ));
  width = GST_VIDEO_INFO_WIDTH(&info);
  height = GST_VIDEO_INFO_HEIGHT(&info);
  std::vector<std::uint8_t> pixels;
  for (int y = 0; y < height; ++y) {
    const auto* row = static_cast<const std::uint8_t*>(GST_VIDEO_FRAME_PLANE_DATA(&f, 0)) +
                      std::ptrdiff_t{y} * GST_VIDEO_FRAME_PLANE_STRIDE(&f, 0);
    pixels.insert(pixels.end(), row, row + width);
  }
  gst_video_frame_unmap(&f);
  return pixels;
}

TEST(TerrainExtract, OneLineForEveryFrameWithItsTimes) {
  const auto h = harness(raw_caps, "application/x-ndjson");
  for (int i = 0; i < 5; ++i) {
    const OwnedEstimate o = some(static_cast<unsigned>(i));
    const auto unit = through(h.get(), frame_with(o.estimate, raw_size, i));
    ASSERT_TRUE(unit);
    EXPECT_EQ(GST_BUFFER_PTS(unit.get()), i * frame_time);
    EXPECT_EQ(GST_BUFFER_DURATION(unit.get()), frame_time);
    std::string expected;
    append_json_line(expected, o.estimate, static_cast<std::int64_t>(i * frame_time), false);
    EXPECT_EQ(text_of(unit.get()), expected);
  }
}

TEST(TerrainExtract, JsonMaskIsSwitchedWhilePlaying) {
  const auto h = harness(raw_caps, "application/x-ndjson");
  const OwnedEstimate o = some(1);
  EXPECT_EQ(text_of(through(h.get(), frame_with(o.estimate, raw_size, 0)).get()).find("\"mask\""),
            std::string::npos);
  g_object_set(h->element, "json-mask", TRUE, nullptr);
  EXPECT_NE(text_of(through(h.get(), frame_with(o.estimate, raw_size, 1)).get()).find("\"mask\""),
            std::string::npos);
  gboolean on = FALSE;
  g_object_get(h->element, "json-mask", &on, nullptr);
  EXPECT_TRUE(on);
}

TEST(TerrainExtract, GapOnlyWhereAFrameHasNoMetadata) {
  for (const char* out : {"video/x-raw,format=GRAY8", "application/x-ndjson", "meta/x-klv,parsed=true"}) {
    const auto h = harness(raw_caps, out);
    const OwnedEstimate o = some(2);
    EXPECT_TRUE(through(h.get(), frame_with(o.estimate, raw_size, 0)));
    EXPECT_FALSE(next_event(h.get(), GST_EVENT_GAP));
    EXPECT_FALSE(through(h.get(), frame(raw_size, 1)));
    const auto gap = next_event(h.get(), GST_EVENT_GAP);
    ASSERT_TRUE(gap) << out;
    GstClockTime start = 0, duration = 0;
    gst_event_parse_gap(gap.get(), &start, &duration);
    EXPECT_EQ(start, frame_time);
    EXPECT_EQ(duration, frame_time);
    EXPECT_TRUE(through(h.get(), frame_with(o.estimate, raw_size, 2)));
    EXPECT_FALSE(next_event(h.get(), GST_EVENT_GAP));
  }
}

TEST(TerrainExtract, UnknownIs128) {
  OwnedEstimate o = blank(64, 48, 64, 48);
  std::fill(o.pixels.begin(), o.pixels.end(), mask_doubtful);
  const auto h = harness(raw_caps, "video/x-raw,format=GRAY8");
  const auto unit = through(h.get(), frame_with(o.estimate, raw_size, 0));
  int w = 0, height = 0;
  EXPECT_EQ(picture_of(h.get(), unit.get(), w, height), std::vector<std::uint8_t>(64 * 48, 128));
}

TEST(TerrainExtract, GrayIsTheDefaultAndTheMasksOwnMemory) {
  const auto h = harness(raw_caps, nullptr);
  const OwnedEstimate o = some(3);
  auto in = frame_with(o.estimate, raw_size, 0);
  const EstimateReader reader(in.get());
  GstMemory* const memory = gst_buffer_peek_memory(reader.mask(), 0);
  const auto unit = through(h.get(), std::move(in));
  const Owned<GstCaps> caps(gst_pad_get_current_caps(h->sinkpad));
  const GstStructure* s = gst_caps_get_structure(caps.get(), 0);
  EXPECT_STREQ(gst_structure_get_string(s, "format"), "GRAY8");
  int n = 0, d = 0;
  EXPECT_TRUE(gst_structure_get_fraction(s, "framerate", &n, &d));
  EXPECT_EQ(n, 25);
  EXPECT_TRUE(gst_structure_get_fraction(s, "pixel-aspect-ratio", &n, &d));
  EXPECT_EQ(n, d);
  EXPECT_EQ(gst_buffer_peek_memory(unit.get(), 0), memory) << "pixels were copied";
  EXPECT_FALSE(gst_buffer_is_memory_range_writable(unit.get(), 0, 1))
      << "nobody may draw on the frame's mask";
  int w = 0, height = 0;
  EXPECT_EQ(picture_of(h.get(), unit.get(), w, height), packed(o.estimate.mask));
}

// 61 columns: the mask has no padding, plain GRAY8 rows have 64 bytes.
TEST(TerrainExtract, OddWidthIsRightWithAndWithoutVideoMeta) {
  for (const bool video_meta : {false, true}) {
    Owned<GstHarness> h(gst_harness_new("terrainextract"));
    if (video_meta)
      gst_harness_add_propose_allocation_meta(h.get(), GST_VIDEO_META_API_TYPE, nullptr);
    gst_harness_set_sink_caps_str(h.get(), "video/x-raw,format=GRAY8");
    gst_harness_set_src_caps_str(h.get(), "video/x-raw,format=I420,width=61,height=47,framerate=25/1");
    std::mt19937 random(4);
    const OwnedEstimate o = noisy(61, 47, 61, 47, 9, random);
    auto in = frame_with(o.estimate, 100, 0);
    const EstimateReader reader(in.get());
    GstMemory* const memory = gst_buffer_peek_memory(reader.mask(), 0);
    const auto unit = through(h.get(), std::move(in));
    EXPECT_EQ(gst_buffer_peek_memory(unit.get(), 0) == memory, video_meta);
    if (!video_meta) {
      EXPECT_EQ(gst_buffer_get_size(unit.get()), 64u * 47u) << "without GstVideoMeta rows are 64 bytes";
      std::string bytes = text_of(unit.get());
      for (int y = 0; y < 47; ++y)
        EXPECT_EQ(std::memcmp(bytes.data() + y * 64, o.estimate.mask.plane.row(y), 61), 0) << y;
    }
    int w = 0, height = 0;
    EXPECT_EQ(picture_of(h.get(), unit.get(), w, height), packed(o.estimate.mask));
  }
}

// Against the definition in doubles: the mask pixel under the middle of each picture pixel.
TEST(TerrainExtract, OtherSizesAreNearestNeighbour) {
  struct Case {
    int mask_width, mask_height, width, height;
    Rectangle region;
  };
  for (const Case& c :
       {Case{64, 48, 32, 24, {}}, Case{64, 48, 127, 31, {}}, Case{16, 12, 64, 48, {}},
        Case{13, 7, 64, 48, {}}, Case{20, 20, 64, 48, {10, 5, 31, 40}}, Case{1, 1, 5, 5, {}}}) {
    std::mt19937 random(5);
    OwnedEstimate o = noisy(64, 48, c.mask_width, c.mask_height, 2, random);
    if (!c.region.empty())
      o.estimate.mask_region = c.region;
    const std::string out =
        "video/x-raw,format=GRAY8,width=" + std::to_string(c.width) + ",height=" + std::to_string(c.height);
    const auto h = harness(raw_caps, out.c_str());
    const auto unit = through(h.get(), frame_with(o.estimate, raw_size, 0));
    ASSERT_TRUE(unit);
    int w = 0, height = 0;
    const auto pixels = picture_of(h.get(), unit.get(), w, height);
    ASSERT_EQ(w, c.width);
    ASSERT_EQ(height, c.height);
    const Rectangle& r = o.estimate.mask_region;
    for (int y = 0; y < height; ++y)
      for (int x = 0; x < w; ++x) {
        const double u = ((x + 0.5) * 64 / w - r.x) * c.mask_width / r.width;
        const double v = ((y + 0.5) * 48 / height - r.y) * c.mask_height / r.height;
        const bool outside = u < 0 || v < 0 || u >= c.mask_width || v >= c.mask_height;
        const int expected = outside ? 128 : o.pixel(static_cast<int>(u + 1e-9), static_cast<int>(v + 1e-9));
        ASSERT_EQ(pixels[static_cast<std::size_t>(y * w + x)], expected) << x << " " << y << " in " << out;
      }
    const Owned<GstCaps> caps(gst_pad_get_current_caps(h->sinkpad));
    int n = 0, d = 0;
    gst_structure_get_fraction(gst_caps_get_structure(caps.get(), 0), "pixel-aspect-ratio", &n, &d);
    EXPECT_EQ(n * 48 * w, d * 64 * height) << "the picture keeps the frame's proportions";
  }
}

TEST(TerrainExtract, AFreeSideFollowsTheOther) {
  const auto h = harness(raw_caps, "video/x-raw,format=GRAY8,width=32");
  const OwnedEstimate o = some(6);
  const auto unit = through(h.get(), frame_with(o.estimate, raw_size, 0));
  int w = 0, height = 0;
  picture_of(h.get(), unit.get(), w, height);
  EXPECT_EQ(w, 32);
  EXPECT_EQ(height, 24);
}

TEST(TerrainExtract, EncodedVideoWithoutASizeInItsCaps) {
  const auto h = harness("video/x-h264,stream-format=byte-stream,alignment=au", "video/x-raw,format=GRAY8");
  EXPECT_FALSE(through(h.get(), frame(10, 0))) << "nothing tells the size yet";
  const OwnedEstimate o = some(7);
  const auto unit = through(h.get(), frame_with(o.estimate, 10, 1));
  ASSERT_TRUE(unit);
  int w = 0, height = 0;
  EXPECT_EQ(picture_of(h.get(), unit.get(), w, height), packed(o.estimate.mask));
  EXPECT_TRUE(next_event(h.get(), GST_EVENT_SEGMENT)) << "held back until the caps, not lost";

  std::mt19937 random(1);
  const OwnedEstimate larger = noisy(100, 60, 100, 60, 20, random);
  EXPECT_TRUE(through(h.get(), frame_with(larger.estimate, 10, 2)));
  const Owned<GstCaps> caps(gst_pad_get_current_caps(h->sinkpad));
  gst_structure_get_int(gst_caps_get_structure(caps.get(), 0), "width", &w);
  EXPECT_EQ(w, 100);
}

TEST(TerrainExtract, CapsChangeInTheStream) {
  const auto h = harness(raw_caps, "video/x-raw,format=GRAY8");
  EXPECT_TRUE(through(h.get(), frame_with(some(8).estimate, raw_size, 0)));
  gst_harness_set_src_caps_str(h.get(), "video/x-raw,format=NV12,width=80,height=50,framerate=25/1");
  std::mt19937 random(2);
  const OwnedEstimate o = noisy(80, 50, 80, 50, 20, random);
  const auto unit = through(h.get(), frame_with(o.estimate, 80 * 50 * 3 / 2, 1));
  int w = 0, height = 0;
  EXPECT_EQ(picture_of(h.get(), unit.get(), w, height), packed(o.estimate.mask));
  EXPECT_EQ(w, 80);
}

TEST(TerrainExtract, DownstreamMayAskForSomethingElseInTheStream) {
  const auto h = harness(raw_caps, "application/x-ndjson");
  const OwnedEstimate o = some(9);
  EXPECT_EQ(text_of(through(h.get(), frame_with(o.estimate, raw_size, 0)).get())[0], '{');
  gst_harness_set_sink_caps_str(h.get(), "meta/x-klv,parsed=true");
  gst_pad_push_event(h->sinkpad, gst_event_new_reconfigure());
  EXPECT_EQ(text_of(through(h.get(), frame_with(o.estimate, raw_size, 1)).get())[0], '\x06');
}

TEST(TerrainExtract, KlvHoldsTheEstimateAndTheTime) {
  const auto h = harness(raw_caps, "meta/x-klv,parsed=true");
  const OwnedEstimate o = some(10);
  const auto decode = [&](Owned<GstBuffer> in, KlvUnit& unit) {
    const std::string bytes = text_of(through(h.get(), std::move(in)).get());
    ASSERT_EQ(unit.decode({reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size()}),
              KlvVerdict::ok);
  };
  KlvUnit unit;
  decode(frame_with(o.estimate, raw_size, 3), unit);
  EXPECT_EQ(unit.time_us(), 3 * frame_time / 1000) << "without a clock the PTS, so that a run repeats";
  EXPECT_EQ(unit.estimate().frame, o.estimate.frame);

  const guint64 now = 1700000000 * GST_SECOND + 123456 * GST_USECOND;
  for (const bool ntp : {false, true}) {
    auto in = frame_with(o.estimate, raw_size, 4);
    const Owned<GstCaps> other(gst_caps_new_empty_simple("timestamp/x-mine"));
    const Owned<GstCaps> caps(gst_caps_new_empty_simple(ntp ? "timestamp/x-ntp" : "timestamp/x-unix"));
    gst_buffer_add_reference_timestamp_meta(in.get(), other.get(), 5, GST_CLOCK_TIME_NONE);
    gst_buffer_add_reference_timestamp_meta(in.get(), caps.get(), now + (ntp ? 2208988800 * GST_SECOND : 0),
                                            GST_CLOCK_TIME_NONE);
    decode(std::move(in), unit);
    EXPECT_EQ(unit.time_us(), now / 1000) << ntp;
  }
}

/// Items of the UAS Datalink Local Set that a buffer is, by tag; written apart from the decoder.
std::map<int, std::string> uas_items(GstBuffer* buffer) {
  const std::string unit = text_of(buffer);
  const auto byte = [&](std::size_t at) {
    return static_cast<std::size_t>(static_cast<unsigned char>(unit.at(at)));
  };
  std::size_t at = 16;
  const auto length = [&] {
    std::size_t n = byte(at++);
    if (n >= 128)
      for (std::size_t bytes = std::exchange(n, 0) - 128; bytes > 0; --bytes)
        n = n << 8 | byte(at++);
    return n;
  };
  EXPECT_EQ(unit.substr(0, 16),
            std::string("\x06\x0e\x2b\x34\x02\x0b\x01\x01\x0e\x01\x03\x01\x01\0\0\0", 16));
  const std::size_t size = length(), end = at + size;
  EXPECT_EQ(end, unit.size());
  std::map<int, std::string> items;
  while (at < end) {
    const auto tag = static_cast<int>(byte(at++));
    const std::size_t n = length();
    items[tag] = unit.substr(at, n);
    at += n;
  }
  return items;
}

/// A frame whose boundary was measured by a camera that looks 5 degrees down, 0.2 to the left, right side 3
/// down.
Owned<GstBuffer> measured_frame(const Estimate& e, int index) {
  auto buffer = frame_with(e, raw_size, index);
  const std::vector<float> columns(e.boundary.size(), 1.0F), bearings(e.boundary.size(), 0.0F);
  MetricEstimate metric;
  metric.ranges = metric.low = metric.high = columns;
  metric.bearings = bearings;
  metric.height = 0.5;
  metric.range_max = 8;
  metric.pitch = 5 * G_PI / 180;
  metric.roll = 3 * G_PI / 180;
  metric.yaw = 0.2 * G_PI / 180;
  MetricWriter writer;
  EXPECT_TRUE(writer.attach(buffer.get(), metric));
  return buffer;
}

TEST(TerrainExtract, KlvInAUasDatalinkLocalSet) {
  const auto h = harness(raw_caps, "meta/x-klv,parsed=true");
  const Bus bus(h.get());
  const OwnedEstimate o = some(10);
  const std::string alone = text_of(through(h.get(), frame_with(o.estimate, raw_size, 3)).get());
  gst_util_set_object_arg(G_OBJECT(h->element), "klv-form", "uas-datalink");
  const auto plain = uas_items(through(h.get(), frame_with(o.estimate, raw_size, 3)).get());
  std::vector<int> tags;
  for (const auto& [tag, value] : plain)
    tags.push_back(tag);
  EXPECT_EQ(tags, (std::vector{1, 2, 65, 74})) << "nothing is known of the platform, so nothing is said";
  EXPECT_EQ(plain.at(2), std::string("\0\0\0\0\0\x01\xd4\xc0", 8)) << "120000 us";
  EXPECT_EQ(plain.at(74), alone.substr(19, alone.size() - 19 - 4));

  g_object_set(h->element, "klv-position", "60.1768229669783,128.426759042045,14190.7195,160.1744", nullptr);
  const auto unit = through(h.get(), measured_frame(o.estimate, 4));
  const auto items = uas_items(unit.get());
  EXPECT_EQ(items.at(5), "\x71\xc2")
      << "160.1744 - 0.2 degrees: a camera turned left looks less far clockwise";
  EXPECT_EQ(items.at(6), std::string("\xe0\0", 2)) << "-5 / 20 * 32767 = -8191.75: down is negative";
  EXPECT_EQ(items.at(7), std::string("\x07\xae")) << "3 / 50 * 32767 = 1966.02";
  EXPECT_EQ(items.at(13), "\x55\x95\xb6\x6d");
  EXPECT_EQ(items.at(14), "\x5b\x53\x60\xc4");
  EXPECT_EQ(items.at(15), "\xc2\x21");
  const std::string bytes = text_of(unit.get());
  KlvUnit decoded;
  ASSERT_EQ(decoded.decode({reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size()}),
            KlvVerdict::ok)
      << decoded.error();
  EXPECT_EQ(decoded.estimate().frame, o.estimate.frame);

  // Back to the set alone, while it runs: the same bytes as ever.
  gst_util_set_object_arg(G_OBJECT(h->element), "klv-form", "vmti");
  EXPECT_EQ(text_of(through(h.get(), measured_frame(o.estimate, 3)).get()), alone);
}

TEST(TerrainExtract, APositionThatCannotBeReadIsToldOnceAndLeftOut) {
  const auto h = harness(raw_caps, "meta/x-klv,parsed=true");
  Bus bus(h.get());
  gst_util_set_object_arg(G_OBJECT(h->element), "klv-form", "uas-datalink");
  g_object_set(h->element, "klv-position", "95,13,34", nullptr);
  for (int i = 0; i < 3; ++i)
    EXPECT_EQ(uas_items(through(h.get(), frame_with(some(10).estimate, raw_size, i)).get()).count(13), 0u);
  const std::string told = bus.text(GST_MESSAGE_WARNING);
  EXPECT_NE(told.find("klv-position=\"95,13,34\""), std::string::npos) << told;
  EXPECT_NE(told.find("latitude is not within"), std::string::npos) << told;
  EXPECT_EQ(bus.text(GST_MESSAGE_WARNING), "");
  g_object_set(h->element, "klv-position", "52.5,13,34", nullptr);
  EXPECT_EQ(uas_items(through(h.get(), frame_with(some(10).estimate, raw_size, 4)).get()).count(13), 1u);
  g_object_set(h->element, "klv-position", nullptr, nullptr);
  EXPECT_EQ(uas_items(through(h.get(), frame_with(some(10).estimate, raw_size, 5)).get()).count(13), 0u);
  EXPECT_EQ(bus.text(GST_MESSAGE_WARNING), "");
}

TEST(TerrainExtract, TheTimesThatUpstreamNotedGoWithTheUnit) {
  const Owned<GstCaps> ntp(gst_caps_new_empty_simple("timestamp/x-ntp")),
      mine(gst_caps_new_empty_simple("timestamp/x-mine"));
  for (const char* output : {"video/x-raw,format=GRAY8", "application/x-ndjson", "meta/x-klv,parsed=true"}) {
    const auto h = harness(raw_caps, output);
    for (int index = 0; index < 3; ++index) { // masks come from a pool: nothing may pile up
      auto in = frame_with(some(10).estimate, raw_size, index);
      gst_buffer_add_reference_timestamp_meta(in.get(), ntp.get(), 100 + index, 7);
      gst_buffer_add_reference_timestamp_meta(in.get(), mine.get(), 5, GST_CLOCK_TIME_NONE);
      const auto unit = through(h.get(), std::move(in));
      ASSERT_TRUE(unit) << output;
      EXPECT_EQ(gst_buffer_get_n_meta(unit.get(), GST_REFERENCE_TIMESTAMP_META_API_TYPE), 2u) << output;
      const auto* meta = gst_buffer_get_reference_timestamp_meta(unit.get(), ntp.get());
      ASSERT_NE(meta, nullptr) << output;
      EXPECT_EQ(meta->timestamp, static_cast<guint64>(100 + index));
      EXPECT_EQ(meta->duration, 7u);
    }
  }
}

TEST(TerrainExtract, EventsPassAndTheStreamIsItsOwn) {
  const auto h = harness(raw_caps, "application/x-ndjson");
  EXPECT_TRUE(through(h.get(), frame_with(some(11).estimate, raw_size, 0)));
  const auto start = next_event(h.get(), GST_EVENT_STREAM_START);
  ASSERT_TRUE(start);
  const gchar *id = nullptr, *video_id = nullptr;
  gst_event_parse_stream_start(start.get(), &id);
  const Owned<GstEvent> video_start(gst_pad_get_sticky_event(h->srcpad, GST_EVENT_STREAM_START, 0));
  gst_event_parse_stream_start(video_start.get(), &video_id);
  EXPECT_STRNE(id, video_id);
  EXPECT_TRUE(next_event(h.get(), GST_EVENT_SEGMENT));

  EXPECT_TRUE(gst_harness_push_event(
      h.get(), gst_event_new_tag(gst_tag_list_new(GST_TAG_VIDEO_CODEC, "H.264", nullptr))));
  EXPECT_FALSE(next_event(h.get(), GST_EVENT_TAG)) << "the video's codec is none of the units'";

  EXPECT_TRUE(gst_harness_push_event(h.get(), gst_event_new_flush_start()));
  EXPECT_TRUE(gst_harness_push_event(h.get(), gst_event_new_flush_stop(TRUE)));
  EXPECT_TRUE(next_event(h.get(), GST_EVENT_FLUSH_STOP));
  GstSegment segment;
  gst_segment_init(&segment, GST_FORMAT_TIME);
  segment.start = segment.time = 100 * frame_time;
  EXPECT_TRUE(gst_harness_push_event(h.get(), gst_event_new_segment(&segment)));
  EXPECT_TRUE(through(h.get(), frame_with(some(12).estimate, raw_size, 100)));
  const auto seeked = next_event(h.get(), GST_EVENT_SEGMENT);
  ASSERT_TRUE(seeked);
  const GstSegment* passed = nullptr;
  gst_event_parse_segment(seeked.get(), &passed);
  EXPECT_EQ(passed->start, 100 * frame_time);

  EXPECT_TRUE(gst_harness_push_event(h.get(), gst_event_new_eos()));
  EXPECT_TRUE(next_event(h.get(), GST_EVENT_EOS));
}

TEST(TerrainExtract, SlowReadersDoNotSlowTheVideo) {
  const auto h = harness(raw_caps, "application/x-ndjson");
  EXPECT_TRUE(through(h.get(), frame_with(some(13).estimate, raw_size, 0)));
  while (GstEvent* event = gst_harness_try_pull_upstream_event(h.get()))
    gst_event_unref(event);
  gst_harness_push_upstream_event(h.get(), gst_event_new_qos(GST_QOS_TYPE_UNDERFLOW, 2.0, 5, 5));
  EXPECT_EQ(gst_harness_upstream_events_in_queue(h.get()), 0u);
}

TEST(TerrainExtract, RefusalsNameTheCause) {
  {
    Owned<GstHarness> h(gst_harness_new("terrainextract"));
    Bus bus(h.get());
    gst_harness_set_src_caps_str(h.get(), "audio/x-raw,format=S16LE,rate=8000,channels=1,layout=interleaved");
    EXPECT_NE(bus.text(GST_MESSAGE_ERROR).find("audio/x-raw"), std::string::npos);
  }
  Owned<GstHarness> h(gst_harness_new("terrainextract"));
  Bus bus(h.get());
  gst_harness_set_sink_caps_str(h.get(), "video/x-raw,format=GRAY8,framerate=7/1");
  gst_harness_set_src_caps_str(h.get(), raw_caps);
  EXPECT_EQ(gst_harness_push(h.get(), frame_with(some(14).estimate, raw_size, 0).release()),
            GST_FLOW_NOT_NEGOTIATED);
  EXPECT_NE(bus.text(GST_MESSAGE_ERROR).find("frame rate of its input"), std::string::npos);
}

TEST(TerrainExtract, MetadataThatMakesNoSenseIsAGapAndOneWarning) {
  const auto h = harness(raw_caps, "application/x-ndjson");
  Bus bus(h.get());
  for (int i = 0; i < 3; ++i) {
    const OwnedEstimate o = some(15);
    auto in = frame(raw_size, i);
    const Owned<GstBuffer> mask(gst_buffer_new_allocate(nullptr, 5, nullptr)); // no GstVideoMeta
    attach(in.get(), o.estimate, mask.get(), nullptr);
    EXPECT_FALSE(through(h.get(), std::move(in)));
    EXPECT_TRUE(next_event(h.get(), GST_EVENT_GAP));
    EXPECT_EQ(bus.text(GST_MESSAGE_WARNING).find("Invalid") != std::string::npos, i == 0);
  }
}

TEST(TerrainExtract, NoMetadataAtAllIsOneWarning) {
  const auto told = [](Bus& bus) {
    return bus.text(GST_MESSAGE_WARNING).find("No terrain metadata") != std::string::npos;
  };
  { // a second of frames
    const auto h = harness(raw_caps, "application/x-ndjson");
    Bus bus(h.get());
    for (int i = 0; i < 60; ++i) {
      EXPECT_FALSE(through(h.get(), frame(raw_size, i)));
      EXPECT_EQ(told(bus), i == 24) << i;
    }
    gst_harness_push_event(h.get(), gst_event_new_eos());
    EXPECT_FALSE(told(bus));
  }
  for (const bool with_metadata : {false, true}) { // a short file
    const auto h = harness(raw_caps, "application/x-ndjson");
    Bus bus(h.get());
    EXPECT_FALSE(through(h.get(), frame(raw_size, 0)));
    if (with_metadata) {
      EXPECT_TRUE(through(h.get(), frame_with(some(2).estimate, raw_size, 1)));
    }
    gst_harness_push_event(h.get(), gst_event_new_eos());
    EXPECT_EQ(told(bus), !with_metadata);
  }
}

TEST(TerrainExtract, AllocationQueryWelcomesAnyStride) {
  const auto h = harness(raw_caps, "application/x-ndjson");
  const Owned<GstCaps> caps(gst_caps_from_string(raw_caps));
  GstQuery* query = gst_query_new_allocation(caps.get(), TRUE);
  EXPECT_TRUE(gst_pad_peer_query(h->srcpad, query));
  EXPECT_TRUE(gst_query_find_allocation_meta(query, GST_VIDEO_META_API_TYPE, nullptr));
  gst_query_unref(query);
}

int pulled(GstElement* pipeline, const char* name) {
  GstElement* sink = gst_bin_get_by_name(GST_BIN(pipeline), name);
  int n = 0;
  GstClockTime last = GST_CLOCK_TIME_NONE;
  while (GstSample* sample = gst_app_sink_pull_sample(GST_APP_SINK(sink))) {
    const GstClockTime pts = GST_BUFFER_PTS(gst_sample_get_buffer(sample));
    EXPECT_NE(pts, last);
    last = pts;
    ++n;
    gst_sample_unref(sample);
  }
  gst_object_unref(sink);
  return n;
}

TEST(TerrainExtract, ThreeOutputsInParallelAndOneBehindAnEncoder) {
  GError* error = nullptr;
  Owned<GstElement> pipeline(gst_parse_launch(
      "videotestsrc num-buffers=20 ! video/x-raw,format=I420,width=160,height=120,framerate=25/1 ! "
      "terrainseg ! "
      "tee name=t allow-not-linked=true "
      "t. ! queue ! terrainextract ! video/x-raw,format=GRAY8,width=80 ! appsink name=gray sync=false "
      "t. ! terrainextract ! queue ! application/x-ndjson ! appsink name=lines sync=false "
      "t. ! queue ! terrainextract ! meta/x-klv,parsed=true ! appsink name=klv sync=false "
      "t. ! queue ! jpegenc ! terrainextract ! queue ! application/x-ndjson ! appsink name=encoded "
      "sync=false ",
      &error));
  ASSERT_EQ(error, nullptr) << error->message;
  gst_element_set_state(pipeline.get(), GST_STATE_PLAYING);
  for (const char* name : {"gray", "lines", "klv", "encoded"})
    EXPECT_EQ(pulled(pipeline.get(), name), 20) << name;
}

// The largest unit there is: muxers and payloaders carry it whole.
TEST(TerrainExtract, LargestUnitsPassMuxersAndPayloaders) {
  std::mt19937 random(16);
  std::size_t largest = 0;
  OwnedEstimate widest;
  for (unsigned calm = 40; calm < 60; ++calm) { // the noise that just fits
    OwnedEstimate o = noisy(1280, 720, 1280, 720, calm, random);
    KlvEncoder encoder;
    const auto bytes = encoder.encode(o.estimate, 0);
    KlvUnit unit;
    ASSERT_EQ(unit.decode(bytes), KlvVerdict::ok);
    if (bytes.size() > largest) {
      largest = bytes.size();
      widest = std::move(o);
    }
  }
  ASSERT_GT(largest, 55000u);
  for (const char* way :
       {"mpegtsmux alignment=7 ! tsdemux", "mpegtsmux alignment=7 ! rtpmp2tpay ! rtpmp2tdepay ! tsdemux",
        "rtpklvpay ! rtpklvdepay"}) {
    const std::string text = "appsrc name=in format=time caps=" +
                             std::string("video/x-raw,format=I420,width=1280,height=720,framerate=25/1") +
                             " ! terrainextract ! meta/x-klv,parsed=true ! " + way +
                             " ! meta/x-klv ! appsink name=out sync=false";
    GError* error = nullptr;
    Owned<GstElement> pipeline(gst_parse_launch(text.c_str(), &error));
    ASSERT_EQ(error, nullptr) << error->message;
    gst_element_set_state(pipeline.get(), GST_STATE_PLAYING);
    GstElement* in = gst_bin_get_by_name(GST_BIN(pipeline.get()), "in");
    for (int i = 0; i < 4; ++i)
      gst_app_src_push_buffer(GST_APP_SRC(in), frame_with(widest.estimate, 16, i).release());
    gst_app_src_end_of_stream(GST_APP_SRC(in));
    gst_object_unref(in);
    GstElement* out = gst_bin_get_by_name(GST_BIN(pipeline.get()), "out");
    int whole = 0;
    while (GstSample* sample = gst_app_sink_try_pull_sample(GST_APP_SINK(out), 5 * GST_SECOND)) {
      const std::string bytes = text_of(gst_sample_get_buffer(sample));
      KlvUnit unit;
      EXPECT_EQ(unit.decode({reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size()}),
                KlvVerdict::ok)
          << way << ": " << unit.error();
      whole += bytes.size() == largest;
      gst_sample_unref(sample);
    }
    EXPECT_EQ(whole, 4) << way;
    gst_object_unref(out);
  }
}

TEST(TerrainExtract, StatesAgainAndAgain) {
  const Owned<GstElement> element(gst_element_factory_make("terrainextract", nullptr));
  for (int i = 0; i < 20; ++i) {
    EXPECT_EQ(gst_element_set_state(element.get(), GST_STATE_PLAYING), GST_STATE_CHANGE_SUCCESS);
    EXPECT_EQ(gst_element_set_state(element.get(), GST_STATE_NULL), GST_STATE_CHANGE_SUCCESS);
  }
}

} // namespace
} // namespace terrainseg::test
