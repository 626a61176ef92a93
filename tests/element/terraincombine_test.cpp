// SPDX-License-Identifier: LGPL-2.1-or-later
#include "outlet_harness.hpp"

#include <atomic>
#include <chrono>
#include <thread>

namespace terrainseg::test {
namespace {

const testing::Environment* const gstreamer = testing::AddGlobalTestEnvironment(new GStreamer);

constexpr const char* raw_caps = "video/x-raw,format=I420,width=64,height=48,framerate=25/1";
constexpr gsize raw_size = 64 * 48 * 3 / 2;
using std::chrono::milliseconds;
using SteadyClock = std::chrono::steady_clock;

/// terraincombine with a harness on its video and another on its units.
struct Combine {
  Owned<GstHarness> video, meta;
  explicit Combine(guint latency_ms, const char* caps = raw_caps) {
    GstElement* element = gst_element_factory_make("terraincombine", nullptr);
    g_object_set(element, "latency", latency_ms, nullptr);
    video.reset(gst_harness_new_with_element(element, "sink", "src"));
    meta.reset(gst_harness_new_with_element(element, "meta", nullptr));
    gst_object_unref(element);
    gst_harness_set_src_caps_str(meta.get(), "meta/x-klv,parsed=true");
    gst_harness_set_src_caps_str(video.get(), caps);
  }
  GstFlowReturn push_frame(int i, gsize size = raw_size) {
    return gst_harness_push(video.get(), frame(size, i).release());
  }
  void push_unit(const Estimate& e, int i, GstClockTimeDiff offset = 0,
                 GstClockTime dts = GST_CLOCK_TIME_NONE) {
    KlvEncoder encoder;
    const auto bytes = encoder.encode(e, 0);
    push_bytes({bytes.begin(), bytes.end()}, i, offset, dts);
  }
  void push_bytes(const std::vector<std::uint8_t>& bytes, int i, GstClockTimeDiff offset = 0,
                  GstClockTime dts = GST_CLOCK_TIME_NONE) {
    GstBuffer* unit = gst_buffer_new_allocate(nullptr, bytes.size(), nullptr);
    gst_buffer_fill(unit, 0, bytes.data(), bytes.size());
    GST_BUFFER_PTS(unit) = static_cast<GstClockTime>(static_cast<GstClockTimeDiff>(i * frame_time) + offset);
    GST_BUFFER_DTS(unit) = dts;
    EXPECT_EQ(gst_harness_push(meta.get(), unit), GST_FLOW_OK);
  }
  Owned<GstBuffer> pull() { return Owned<GstBuffer>(gst_harness_pull(video.get())); }
  /// The frame that leaves next is number `i` and carries metadata or not.
  void expect(int i, bool with) {
    const auto out = pull();
    ASSERT_TRUE(out) << i;
    EXPECT_EQ(GST_BUFFER_PTS(out.get()), i * frame_time);
    EXPECT_EQ(static_cast<bool>(EstimateReader(out.get())), with) << i;
  }
  guint64 stat(const char* name) {
    GstStructure* stats = nullptr;
    g_object_get(video->element, "stats", &stats, nullptr);
    guint64 value = 0;
    EXPECT_TRUE(gst_structure_get_uint64(stats, name, &value));
    gst_structure_free(stats);
    return value;
  }
};

OwnedEstimate some(unsigned seed, int mask_width = 64, int mask_height = 48) {
  std::mt19937 random(seed);
  OwnedEstimate o = noisy(64, 48, mask_width, mask_height, 20, random);
  o.estimate.frame = seed;
  return o;
}

TEST(TerrainCombine, RestoresTheMetadataBitForBit) {
  Combine c(5000);
  for (int i = 0; i < 12; ++i) {
    const OwnedEstimate o = i % 3 ? some(static_cast<unsigned>(i)) : some(static_cast<unsigned>(i), 33, 17);
    if (i % 2) { // either may come first
      c.push_unit(o.estimate, i);
      EXPECT_EQ(c.push_frame(i), GST_FLOW_OK);
    } else {
      EXPECT_EQ(c.push_frame(i), GST_FLOW_OK);
      c.push_unit(o.estimate, i);
    }
    const auto out = c.pull();
    EXPECT_EQ(GST_BUFFER_PTS(out.get()), i * frame_time);
    EXPECT_EQ(text_of(out.get()), std::string(raw_size, static_cast<char>(i)))
        << "the picture is not touched";
    const EstimateReader reader(out.get());
    ASSERT_TRUE(reader) << i << (reader.error() ? reader.error() : "");
    expect_same(reader.estimate(), o.estimate);
  }
  EXPECT_EQ(c.stat("matched"), 12u);
  EXPECT_EQ(c.stat("lost"), 0u);
}

TEST(TerrainCombine, ALostUnitIsKnownByTheNext) {
  Combine c(60000);
  const auto before = SteadyClock::now();
  for (int i = 0; i < 9; ++i) {
    EXPECT_EQ(c.push_frame(i), GST_FLOW_OK);
    if (i % 3 != 1)
      c.push_unit(some(1).estimate, i);
  }
  for (int i = 0; i < 9; ++i)
    c.expect(i, i % 3 != 1);
  EXPECT_LT(SteadyClock::now() - before, milliseconds(10000)) << "it waited for what could not come";
  EXPECT_EQ(c.stat("matched"), 6u);
  EXPECT_EQ(c.stat("lost"), 3u);
}

TEST(TerrainCombine, WaitsNoLongerThanItsLatency) {
  Combine c(150);
  const auto before = SteadyClock::now();
  EXPECT_EQ(c.push_frame(0), GST_FLOW_OK);
  c.expect(0, false);
  const auto waited = SteadyClock::now() - before;
  EXPECT_GE(waited, milliseconds(149));
  EXPECT_LT(waited, milliseconds(2000));
  // Nothing has come since: no frame waits for what does not flow.
  const auto stalled = SteadyClock::now();
  for (int i = 1; i < 11; ++i) {
    EXPECT_EQ(c.push_frame(i), GST_FLOW_OK);
    c.expect(i, false);
  }
  EXPECT_LT(SteadyClock::now() - stalled, milliseconds(1000));
  EXPECT_EQ(c.stat("lost"), 11u);
  // Units flow again.
  c.push_unit(some(1).estimate, 11);
  EXPECT_EQ(c.push_frame(11), GST_FLOW_OK);
  c.expect(11, true);
  EXPECT_EQ(c.push_frame(12), GST_FLOW_OK);
  c.push_unit(some(1).estimate, 12);
  c.expect(12, true);
}

TEST(TerrainCombine, ZeroLatencyTakesWhatIsThere) {
  Combine c(0);
  c.push_unit(some(1).estimate, 0);
  EXPECT_EQ(c.push_frame(0), GST_FLOW_OK);
  c.expect(0, true);
  EXPECT_EQ(c.push_frame(1), GST_FLOW_OK);
  c.expect(1, false);
}

TEST(TerrainCombine, DamagedAndForeignUnitsAreCountedAndTold) {
  Combine c(60000);
  Bus bus(c.video.get());
  KlvEncoder encoder;
  const OwnedEstimate o = some(1);
  const auto whole = encoder.encode(o.estimate, 0);
  std::vector<std::uint8_t> damaged(whole.begin(), whole.end());
  damaged[damaged.size() / 2] ^= 4;
  c.push_bytes(damaged, 0);
  const std::string told = bus.text(GST_MESSAGE_WARNING);
  EXPECT_NE(told.find("damaged"), std::string::npos) << told;
  EXPECT_NE(told.find("checksum"), std::string::npos) << told;
  // A whole VMTI set of somebody else (jmisb, MIT licence: VmtiLocalSetTest).
  c.push_bytes({0x06, 0x0e, 0x2b, 0x34, 0x02, 0x0b, 0x01, 0x01, 0x0e, 0x01, 0x03, 0x03, 0x06, 0x00,
                0x00, 0x00, 0x17, 0x03, 0x0e, 0x44, 0x53, 0x54, 0x4f, 0x5f, 0x41, 0x44, 0x53, 0x53,
                0x5f, 0x56, 0x4d, 0x54, 0x49, 0x04, 0x01, 0x04, 0x01, 0x02, 0x9f, 0x97},
               0);
  c.push_bytes({}, 0);
  c.push_bytes({1, 2, 3}, 0);
  EXPECT_EQ(bus.text(GST_MESSAGE_WARNING), "") << "once a second is enough";
  EXPECT_EQ(c.stat("rejected"), 4u);
  c.push_unit(o.estimate, 1);
  EXPECT_EQ(c.push_frame(0), GST_FLOW_OK);
  EXPECT_EQ(c.push_frame(1), GST_FLOW_OK);
  c.expect(0, false);
  c.expect(1, true);
}

TEST(TerrainCombine, TimesMayDifferByLessThanHalfAFrame) {
  for (const GstClockTimeDiff offset :
       {GstClockTimeDiff{0}, GstClockTimeDiff{GST_MSECOND}, -GstClockTimeDiff{GST_MSECOND},
        GstClockTimeDiff{19 * GST_MSECOND}, -GstClockTimeDiff{19 * GST_MSECOND}}) {
    Combine c(60000);
    for (int i = 1; i < 6; ++i) {
      const OwnedEstimate o = some(static_cast<unsigned>(i));
      EXPECT_EQ(c.push_frame(i), GST_FLOW_OK);
      c.push_unit(o.estimate, i, offset);
      const auto out = c.pull();
      const EstimateReader reader(out.get());
      ASSERT_TRUE(reader) << offset;
      EXPECT_EQ(reader.estimate().frame, static_cast<std::uint64_t>(i));
    }
    EXPECT_EQ(c.stat("matched"), 5u);
  }
  Combine c(60000);
  c.push_unit(some(1).estimate, 1, 21 * GST_MSECOND);
  EXPECT_EQ(c.push_frame(1), GST_FLOW_OK);
  c.expect(1, false);
  EXPECT_EQ(c.push_frame(2), GST_FLOW_OK);
  c.expect(2, true);
}

// Units that terrainextract took behind an encoder with B-frames come in coding order; their DTS says so.
TEST(TerrainCombine, CodingOrder) {
  Combine c(60000);
  const int order[] = {0, 3, 1, 2, 6, 4, 5};
  int sent = 0;
  for (const int i : order)
    c.push_unit(some(static_cast<unsigned>(i)).estimate, i, 0,
                static_cast<GstClockTime>(sent++) * frame_time);
  for (int i = 0; i < 7; ++i) {
    EXPECT_EQ(c.push_frame(i), GST_FLOW_OK);
    c.expect(i, true);
  }
  // And one at a time, the frame waiting.
  Combine d(60000);
  EXPECT_EQ(d.push_frame(0), GST_FLOW_OK);
  EXPECT_EQ(d.push_frame(1), GST_FLOW_OK);
  d.push_unit(some(0).estimate, 0, 0, 0);
  d.push_unit(some(3).estimate, 3, 0, frame_time);
  d.push_unit(some(1).estimate, 1, 0, 2 * frame_time);
  d.expect(0, true);
  d.expect(1, true);
}

TEST(TerrainCombine, GapsAndTheEndOfTheUnitsReleaseFrames) {
  Combine c(60000);
  EXPECT_EQ(c.push_frame(0), GST_FLOW_OK);
  gst_harness_push_event(c.meta.get(), gst_event_new_gap(0, 2 * frame_time));
  c.expect(0, false);
  EXPECT_EQ(c.push_frame(1), GST_FLOW_OK);
  c.expect(1, false);
  EXPECT_EQ(c.push_frame(2), GST_FLOW_OK);
  gst_harness_push_event(c.meta.get(), gst_event_new_eos());
  c.expect(2, false);
  for (int i = 3; i < 6; ++i) {
    EXPECT_EQ(c.push_frame(i), GST_FLOW_OK);
    c.expect(i, false);
  }
}

TEST(TerrainCombine, EndOfTheVideoComesBehindItsFrames) {
  Combine c(300);
  for (int i = 0; i < 3; ++i)
    EXPECT_EQ(c.push_frame(i), GST_FLOW_OK);
  EXPECT_TRUE(gst_harness_push_event(c.video.get(), gst_event_new_eos()));
  for (int i = 0; i < 3; ++i)
    c.expect(i, false);
  for (int i = 0; i < 200; ++i) {
    if (next_event(c.video.get(), GST_EVENT_EOS))
      return;
    std::this_thread::sleep_for(milliseconds(10));
  }
  ADD_FAILURE() << "no EOS";
}

TEST(TerrainCombine, FlushForgetsBothSides) {
  Combine c(60000);
  EXPECT_EQ(c.push_frame(0), GST_FLOW_OK); // waits
  c.push_unit(some(1).estimate, 50);       // frame 0 goes without
  c.expect(0, false);
  EXPECT_EQ(c.push_frame(51), GST_FLOW_OK); // waits for 51
  for (GstHarness* h : {c.video.get(), c.meta.get()}) {
    gst_harness_push_event(h, gst_event_new_flush_start());
    gst_harness_push_event(h, gst_event_new_flush_stop(TRUE));
    GstSegment segment;
    gst_segment_init(&segment, GST_FORMAT_TIME);
    gst_harness_push_event(h, gst_event_new_segment(&segment));
  }
  EXPECT_EQ(c.push_frame(50), GST_FLOW_OK); // the old unit 50 must not match
  c.push_unit(some(2).estimate, 50);
  const auto out = c.pull();
  const EstimateReader reader(out.get());
  ASSERT_TRUE(reader);
  EXPECT_EQ(reader.estimate().frame, 2u);
  EXPECT_EQ(GST_BUFFER_PTS(out.get()), 50 * frame_time) << "frame 51 was flushed";
}

// A rover that starts again sends from the beginning, and no flush says so.
TEST(TerrainCombine, ASenderThatBeginsAnew) {
  Combine c(60000);
  c.push_unit(some(1).estimate, 1000);
  c.push_unit(some(2).estimate, 1001);
  EXPECT_EQ(c.push_frame(1000), GST_FLOW_OK);
  c.expect(1000, true);
  for (int i = 0; i < 3; ++i) {
    c.push_unit(some(3).estimate, i);
    EXPECT_EQ(c.push_frame(i), GST_FLOW_OK);
    c.expect(i, true);
  }
  EXPECT_EQ(c.push_frame(3), GST_FLOW_OK); // waits, although unit 1001 came long ago
  c.push_unit(some(4).estimate, 3);
  c.expect(3, true);
  EXPECT_EQ(c.stat("unused"), 1u);
  EXPECT_EQ(c.stat("lost"), 0u);
}

// Segments differ between the two streams, as behind two depayloaders: running time is what counts.
TEST(TerrainCombine, SegmentsOfTheirOwn) {
  Combine c(60000);
  GstSegment segment;
  gst_segment_init(&segment, GST_FORMAT_TIME);
  segment.start = 1000 * frame_time;
  gst_harness_push_event(c.meta.get(), gst_event_new_segment(&segment));
  EXPECT_EQ(c.push_frame(3), GST_FLOW_OK);
  c.push_unit(some(1).estimate, 1003);
  c.expect(3, true);
}

TEST(TerrainCombine, LatencyIsReported) {
  Combine c(120);
  gst_harness_set_upstream_latency(c.video.get(), 30 * GST_MSECOND);
  gst_harness_set_live(c.video.get(), TRUE);
  EXPECT_EQ(gst_harness_query_latency(c.video.get()), 150 * GST_MSECOND);
  gst_harness_set_live(c.video.get(), FALSE);
  gst_harness_set_live(c.meta.get(), FALSE);
  GstQuery* query = gst_query_new_latency();
  gboolean live = TRUE;
  EXPECT_TRUE(gst_pad_peer_query(c.video->sinkpad, query));
  gst_query_parse_latency(query, &live, nullptr, nullptr);
  EXPECT_FALSE(live);
  gst_query_unref(query);
}

// A picture that was scaled between the two ends: the rules are those of the metadata itself.
TEST(TerrainCombine, ScaledVideoGetsScaledRows) {
  std::mt19937 random(3);
  OwnedEstimate o = noisy(64, 48, 64, 48, 20, random);
  o.estimate.horizon_row = 31;
  Owned<GstHarness> scale(gst_harness_new_parse(
      "videoscale ! capsfilter caps=video/x-raw,width=100,height=91,pixel-aspect-ratio=1/1"));
  gst_harness_set_src_caps_str(scale.get(), raw_caps);
  EXPECT_EQ(gst_harness_push(scale.get(), frame_with(o.estimate, raw_size, 0).release()), GST_FLOW_OK);
  const Owned<GstBuffer> scaled(gst_harness_pull(scale.get()));
  const EstimateReader expected(scaled.get());
  ASSERT_TRUE(expected);

  Combine c(60000, "video/x-raw,format=I420,width=100,height=91,framerate=25/1");
  c.push_unit(o.estimate, 0);
  EXPECT_EQ(c.push_frame(0, gst_buffer_get_size(scaled.get())), GST_FLOW_OK);
  const auto out = c.pull();
  const EstimateReader reader(out.get());
  ASSERT_TRUE(reader) << (reader.error() ? reader.error() : "");
  expect_same(reader.estimate(), expected.estimate());
  EXPECT_EQ(reader.estimate().frame_height, 91);
}

TEST(TerrainCombine, OwnMetadataIsReplaced) {
  Combine c(60000);
  c.push_unit(some(2).estimate, 0);
  EXPECT_EQ(gst_harness_push(c.video.get(), frame_with(some(1).estimate, raw_size, 0).release()),
            GST_FLOW_OK);
  const auto out = c.pull();
  EXPECT_EQ(EstimateReader(out.get()).estimate().frame, 2u);
}

TEST(TerrainCombine, WithoutUnitsItIsAPassage) {
  Owned<GstHarness> h(gst_harness_new_with_padnames("terraincombine", "sink", "src"));
  g_object_set(h->element, "latency", 60000, nullptr);
  gst_harness_set_src_caps_str(h.get(), raw_caps);
  for (int i = 0; i < 5; ++i) {
    EXPECT_EQ(gst_harness_push(h.get(), frame(raw_size, i).release()), GST_FLOW_OK);
    const Owned<GstBuffer> out(gst_harness_pull(h.get()));
    EXPECT_TRUE(out);
  }
}

TEST(TerrainCombine, FramesWithoutATimePass) {
  Combine c(60000);
  GstBuffer* timeless = frame(raw_size, 0).release();
  GST_BUFFER_PTS(timeless) = GST_CLOCK_TIME_NONE;
  EXPECT_EQ(gst_harness_push(c.video.get(), timeless), GST_FLOW_OK);
  EXPECT_TRUE(c.pull());
  GstBuffer* unit = gst_buffer_new_memdup("x", 1);
  EXPECT_EQ(gst_harness_push(c.meta.get(), unit), GST_FLOW_OK);
  EXPECT_EQ(c.stat("rejected"), 1u);
}

TEST(TerrainCombine, StopsAtOnceWhileAFrameWaits) {
  const auto before = SteadyClock::now();
  for (int i = 0; i < 10; ++i) {
    Combine c(60000);
    for (int k = 0; k < 3; ++k)
      EXPECT_EQ(c.push_frame(k), GST_FLOW_OK);
    std::this_thread::sleep_for(milliseconds(i));
  }
  EXPECT_LT(SteadyClock::now() - before, milliseconds(10000));
}

TEST(TerrainCombine, StatesAgainAndAgain) {
  const Owned<GstElement> element(gst_element_factory_make("terraincombine", nullptr));
  for (int i = 0; i < 20; ++i) {
    EXPECT_EQ(gst_element_set_state(element.get(), GST_STATE_PLAYING), GST_STATE_CHANGE_SUCCESS);
    EXPECT_EQ(gst_element_set_state(element.get(), GST_STATE_NULL), GST_STATE_CHANGE_SUCCESS);
  }
}

// Two threads, each at its own pace, and a third that flushes now and then: nothing hangs, nothing is
// invented.
TEST(TerrainCombine, ManyThreads) {
  Combine c(20);
  std::atomic<bool> done = false;
  std::thread units([&] {
    for (int i = 0; !done; ++i) {
      KlvEncoder encoder;
      const OwnedEstimate o = some(static_cast<unsigned>(i));
      const auto bytes = encoder.encode(o.estimate, 0);
      GstBuffer* unit = gst_buffer_new_memdup(bytes.data(), bytes.size());
      GST_BUFFER_PTS(unit) = static_cast<GstClockTime>(i) * frame_time;
      gst_harness_push(c.meta.get(), unit);
      if (i % 7 == 0)
        std::this_thread::sleep_for(milliseconds(1));
    }
  });
  for (int i = 0; i < 300; ++i) {
    gst_harness_push(c.video.get(), frame(raw_size, i).release());
    if (i % 60 == 59) {
      gst_harness_push_event(c.video.get(), gst_event_new_flush_start());
      gst_harness_push_event(c.video.get(), gst_event_new_flush_stop(TRUE));
      GstSegment segment;
      gst_segment_init(&segment, GST_FORMAT_TIME);
      gst_harness_push_event(c.video.get(), gst_event_new_segment(&segment));
    }
  }
  done = true;
  units.join();
  gst_harness_push_event(c.video.get(), gst_event_new_eos());
  guint64 seen = 0;
  while (GstBuffer* out = gst_harness_try_pull(c.video.get())) {
    const EstimateReader reader(out);
    if (reader) {
      EXPECT_EQ(reader.estimate().frame * frame_time, GST_BUFFER_PTS(out));
    }
    ++seen;
    gst_buffer_unref(out);
  }
  EXPECT_GT(seen, 0u);
}

} // namespace
} // namespace terrainseg::test
