// SPDX-License-Identifier: LGPL-2.1-or-later
// terrainseg with good input: formats, strides, copies, what it attaches and what it tells.
#include <gst/terrainseg/terrainsegmeta.h>
#include <mutex>

#include <unistd.h>

#include <cstdio>
#include <filesystem>
#include <fstream>
#include <map>
#include <mutex>
#include <set>

#include "elements/terrainseg/announcer.hpp"
#include "harness.hpp"
#include "terrainseg/segmenter.hpp"

namespace terrainseg::test {
namespace {

gpointer memory_of(GstBuffer* buffer) {
  return gst_buffer_peek_memory(buffer, 0);
}

class Format : public testing::TestWithParam<int> {};

TEST_P(Format, IsTakenNativelyAndPassedUnchanged) {
  const std::string caps = caps_text(format_name(GetParam()), 160, 120);
  Rig rig("terrainseg", caps);
  for (int i = 0; i < 3; ++i) {
    GstBuffer* in = new_frame(rig.info(), i);
    const auto before = bytes_of(in);
    const gpointer memory = memory_of(in);
    ASSERT_EQ(rig.push(in), GST_FLOW_OK);
    const auto out = rig.pull();
    ASSERT_TRUE(out);
    EXPECT_EQ(memory_of(out.get()), memory);
    EXPECT_EQ(bytes_of(out.get()), before);
    EXPECT_EQ(GST_BUFFER_PTS(out.get()), gst_util_uint64_scale(i, GST_SECOND, 30));
    const EstimateReader reader(out.get());
    ASSERT_TRUE(reader) << (reader.error() ? reader.error() : "no metadata");
    const Estimate& e = reader.estimate();
    EXPECT_EQ(e.frame, static_cast<std::uint64_t>(i));
    EXPECT_EQ(e.frame_width, 160);
    EXPECT_EQ(e.mask.width, 160);
    EXPECT_EQ(e.mask.height, 120);
    EXPECT_EQ(e.mask_region, (Rectangle{0, 0, 160, 120}));
    EXPECT_EQ(e.boundary.size(), 160u);
    EXPECT_TRUE(e.flags & flag_learned);
    EXPECT_FALSE(e.window.empty());
    std::set<guint8> values;
    for (guint8 value : bytes_of(e.mask))
      values.insert(value);
    for (guint8 value : values)
      EXPECT_TRUE(value == 0 || value == 128 || value == 255) << int{value};
  }
  EXPECT_TRUE(rig.errors().empty());
  Owned<GstCaps> negotiated(gst_pad_get_current_caps(rig.harness()->sinkpad));
  EXPECT_TRUE(gst_caps_is_equal(negotiated.get(), Owned<GstCaps>(gst_caps_from_string(caps.c_str())).get()));
}

TEST_P(Format, StrideOffsetsAndOddSizesChangeNothing) {
  for (const auto& [width, height] : {std::pair{161, 121}, {97, 64}, {64, 49}, {33, 31}}) {
    const std::string caps = caps_text(format_name(GetParam()), width, height);
    Rig tight("terrainseg", caps), padded("terrainseg", caps);
    for (int i = 0; i < 2; ++i) {
      ASSERT_EQ(tight.push(new_frame(tight.info(), i)), GST_FLOW_OK) << caps;
      ASSERT_EQ(padded.push(new_padded_frame(padded.info(), i)), GST_FLOW_OK) << caps;
      const auto a = tight.pull(), b = padded.pull();
      const EstimateReader ra(a.get()), rb(b.get());
      ASSERT_TRUE(ra && rb) << caps;
      EXPECT_EQ(bytes_of(ra.estimate().mask), bytes_of(rb.estimate().mask)) << caps;
      EXPECT_EQ(ra.estimate().horizon_row, rb.estimate().horizon_row) << caps;
      EXPECT_EQ(ra.estimate().traversable_permille, rb.estimate().traversable_permille) << caps;
    }
  }
}

TEST_P(Format, OverlayDrawsAndKeepsTheMetadata) {
  Rig rig("terrainseg overlay=true overlay-alpha=1 overlay-color=0xffff0000 threshold=6",
          caps_text(format_name(GetParam()), 161, 121));
  bool drawn = false;
  for (int i = 0; i < 4; ++i) {
    GstBuffer* in = new_padded_frame(rig.info(), i);
    const auto before = bytes_of(in);
    ASSERT_EQ(rig.push(in), GST_FLOW_OK);
    const auto out = rig.pull();
    drawn = drawn || bytes_of(out.get()) != before;
    EXPECT_TRUE(EstimateReader(out.get()));
  }
  EXPECT_TRUE(drawn);
}

INSTANTIATE_TEST_SUITE_P(All, Format, testing::Range(0, pixel_format_count),
                         [](const auto& info) { return std::string(format_name(info.param)); });

TEST(Terrainseg, RefusesOtherFormatsInNegotiation) {
  for (const char* format : {"GRAY16_BE", "I420_10BE", "P010_10BE", "P016_LE", "Y444_10LE", "NV12_64Z32",
                             "A420", "v210", "RGB16"}) {
    Rig rig("terrainseg");
    Owned<GstCaps> caps(gst_caps_from_string(caps_text(format, 64, 64).c_str()));
    GstPad* pad = gst_element_get_static_pad(rig.element(), "sink");
    EXPECT_FALSE(gst_pad_query_accept_caps(pad, caps.get())) << format;
    gst_object_unref(pad);
    gst_harness_set_src_caps(rig.harness(), caps.release());
    Owned<GstBuffer> buffer(gst_buffer_new_allocate(nullptr, 64 * 64 * 4, nullptr));
    EXPECT_EQ(rig.push(buffer.release()), GST_FLOW_NOT_NEGOTIATED) << format;
  }
}

TEST(Terrainseg, NoCopyWhileOthersHoldTheFrame) {
  Rig rig("terrainseg", caps_text("I420", 160, 120));
  for (int i = 0; i < 20; ++i) {
    Owned<GstBuffer> kept(new_frame(rig.info(), i)); // as after a tee
    ASSERT_EQ(rig.push(gst_buffer_ref(kept.get())), GST_FLOW_OK);
    const auto out = rig.pull();
    EXPECT_EQ(memory_of(out.get()), memory_of(kept.get()));
    EXPECT_NE(gst_buffer_get_terrain_seg_structure(out.get()), nullptr);
    EXPECT_EQ(gst_buffer_get_terrain_seg_structure(kept.get()), nullptr); // the other branch's is untouched
  }
}

TEST(Terrainseg, NoCopyAfterATee) {
  auto pipeline =
      make_element("videotestsrc num-buffers=20 ! video/x-raw,format=I420,width=160,height=120 ! tee name=t "
                   "t. ! queue ! terrainseg ! fakesink name=a signal-handoffs=true sync=false "
                   "t. ! queue ! fakesink name=b signal-handoffs=true sync=false");
  struct Seen {
    std::vector<Owned<GstBuffer>> held; // so that no memory comes back for another frame
    std::map<GstClockTime, gpointer> memory;
  } a, b;
  const auto note = +[](GstElement*, GstBuffer* buffer, GstPad*, Seen* seen) {
    seen->held.emplace_back(gst_buffer_ref(buffer));
    seen->memory[GST_BUFFER_PTS(buffer)] = memory_of(buffer);
  };
  for (auto [name, seen] : {std::pair{"a", &a}, {"b", &b}}) {
    Owned<GstElement> sink(gst_bin_get_by_name(GST_BIN(pipeline.get()), name));
    g_signal_connect(sink.get(), "handoff", G_CALLBACK(note), seen);
  }
  ASSERT_EQ(run_pipeline(pipeline.get()), "");
  EXPECT_EQ(a.memory.size(), 20u);
  EXPECT_EQ(a.memory, b.memory);
}

TEST(Terrainseg, DrawingCopiesWhatOthersHold) {
  Rig rig("terrainseg overlay=true overlay-alpha=1 threshold=6", caps_text("I420", 160, 120));
  for (int i = 0; i < 3; ++i) {
    Owned<GstBuffer> kept(new_frame(rig.info(), i));
    const auto before = bytes_of(kept.get());
    ASSERT_EQ(rig.push(gst_buffer_ref(kept.get())), GST_FLOW_OK);
    const auto out = rig.pull();
    EXPECT_EQ(bytes_of(kept.get()), before);
    EXPECT_NE(bytes_of(out.get()), before);
  }
}

/// Percentage of a rectangle of the mask that is traversable.
int percent_free(const GrayView& mask, const Rectangle& r) {
  int free = 0;
  for (int y = r.y; y < r.y + r.height; ++y)
    for (int x = r.x; x < r.x + r.width; ++x)
      free += mask.plane.row(y)[x] == 255;
  return free * 100 / (r.width * r.height);
}

TEST(Terrainseg, FindsTheRoad) {
  for (const char* preset : {"default", "paper"}) {
    Rig rig(std::string("terrainseg preset=") + preset, caps_text("I420", 320, 240));
    Owned<GstBuffer> out;
    for (int i = 0; i < 10; ++i)
      out = rig.step();
    const EstimateReader reader(out.get());
    const Estimate& e = reader.estimate();
    const int road = percent_free(e.mask, {130, 130, 60, 90}); // with noise of 41 grey levels in it
    EXPECT_GT(road, 20) << preset;
    EXPECT_EQ(percent_free(e.mask, {0, 0, 320, 90}), 0) << preset;         // the sky
    EXPECT_LT(percent_free(e.mask, {0, 100, 40, 40}) * 5, road) << preset; // the verge
    EXPECT_GT(e.model_count, 0) << preset;
    EXPECT_NEAR(e.models[0].rgb[0], 120, 12) << preset;
  }
}

TEST(Terrainseg, MasksAndBoundariesComeFromAPool) {
  Rig rig("terrainseg", caps_text("I420", 160, 120));
  std::set<gpointer> masks, boundaries;
  for (int i = 0; i < 30; ++i) {
    const auto out = rig.step();
    const EstimateReader reader(out.get());
    masks.insert(memory_of(reader.mask()));
    boundaries.insert(
        memory_of(gst_terrain_seg_meta_get_boundary(gst_buffer_get_terrain_seg_structure(out.get()))));
  }
  EXPECT_LE(masks.size(), 3u);
  EXPECT_LE(boundaries.size(), 3u);
}

TEST(Terrainseg, AConfidenceMapGoesWithEveryFrame) {
  Rig rig("terrainseg", caps_text("I420", 320, 240));
  const auto first = rig.step();
  const EstimateReader held(first.get());
  const auto bytes = bytes_of(held.estimate().confidence_map);
  std::set<const void*> maps;
  for (int i = 0; i < 20; ++i) {
    const auto out = rig.step();
    const EstimateReader reader(out.get());
    const GrayView& map = reader.estimate().confidence_map;
    ASSERT_EQ(map.width, 80) << "the grid's";
    ASSERT_EQ(map.height, 60);
    EXPECT_GT(std::ranges::max(bytes_of(map)), 150);
    maps.insert(map.plane.data);
  }
  EXPECT_LE(maps.size(), 3u) << "from a pool";
  EXPECT_FALSE(maps.contains(held.estimate().confidence_map.plane.data));
  EXPECT_EQ(bytes_of(held.estimate().confidence_map), bytes);
  Rig paper("terrainseg preset=paper", caps_text("I420", 320, 240));
  EXPECT_TRUE(EstimateReader(paper.step().get()).estimate().confidence_map.empty());
}

TEST(Terrainseg, AMaskThatIsHeldIsNotWrittenAgain) {
  Rig rig("terrainseg", caps_text("I420", 160, 120));
  const auto first = rig.step();
  const EstimateReader held(first.get());
  const auto bytes = bytes_of(held.estimate().mask);
  for (int i = 0; i < 5; ++i) {
    const auto next = rig.step();
    EXPECT_NE(EstimateReader(next.get()).mask(), held.mask());
  }
  EXPECT_EQ(bytes_of(held.estimate().mask), bytes);
}

TEST(Terrainseg, MaskLevelChangesWhilePlaying) {
  Rig rig("terrainseg", caps_text("I420", 161, 121));
  for (const auto& [level, width, height] : {std::tuple{0, 161, 121}, {1, 81, 61}, {5, 6, 4}, {2, 41, 31}}) {
    g_object_set(rig.element(), "mask-level", level, nullptr);
    const auto out = rig.step();
    const EstimateReader reader(out.get());
    ASSERT_TRUE(reader) << reader.error();
    EXPECT_EQ(reader.estimate().mask.width, width);
    EXPECT_EQ(reader.estimate().mask.height, height);
    EXPECT_EQ(reader.estimate().mask_region, (Rectangle{0, 0, 161, 121}));
    EXPECT_EQ(reader.estimate().boundary.size(), static_cast<std::size_t>(width));
  }
}

TEST(Terrainseg, TwoRunsGiveTheSameBytes) {
  Rig a("terrainseg", caps_text("NV12", 200, 150)), b("terrainseg n-threads=3", caps_text("NV12", 200, 150));
  for (int i = 0; i < 5; ++i) {
    const auto x = a.step(), y = b.step();
    EXPECT_EQ(bytes_of(EstimateReader(x.get()).estimate().mask),
              bytes_of(EstimateReader(y.get()).estimate().mask));
  }
}

TEST(Terrainseg, LiveSourceWithoutAddedLatency) {
  auto pipeline =
      make_element("videotestsrc is-live=true num-buffers=15 ! "
                   "video/x-raw,format=I420,width=160,height=120,framerate=60/1 ! terrainseg name=seg ! "
                   "fakesink name=sink sync=true signal-handoffs=true");
  Owned<GstElement> seg(gst_bin_get_by_name(GST_BIN(pipeline.get()), "seg"));
  Owned<GstElement> sink(gst_bin_get_by_name(GST_BIN(pipeline.get()), "sink"));
  struct Seen {
    int frames = 0;
    GstClockTime added = GST_CLOCK_TIME_NONE;
    GstElement* seg;
  } seen;
  seen.seg = seg.get();
  const auto measure = +[](GstElement*, GstBuffer*, GstPad*, Seen* s) {
    if (s->frames++)
      return;
    GstClockTime before = 0, after = 0;
    const std::pair<const char*, GstClockTime*> sides[] = {{"sink", &before}, {"src", &after}};
    for (auto [pad_name, latency] : sides) {
      GstPad* pad = gst_element_get_static_pad(s->seg, pad_name);
      GstQuery* query = gst_query_new_latency();
      const bool upstream = g_str_equal(pad_name, "sink");
      EXPECT_TRUE(upstream ? gst_pad_peer_query(pad, query) : gst_pad_query(pad, query));
      gst_query_parse_latency(query, nullptr, latency, nullptr);
      gst_query_unref(query);
      gst_object_unref(pad);
    }
    s->added = after - before;
  };
  g_signal_connect(sink.get(), "handoff", G_CALLBACK(measure), &seen);
  EXPECT_EQ(run_pipeline(pipeline.get()), "");
  EXPECT_EQ(seen.frames, 15);
  EXPECT_EQ(seen.added, 0u);
}

TEST(Terrainseg, QosIsOffAndASlowSinkLosesNothing) {
  auto pipeline =
      make_element("videotestsrc num-buffers=12 ! video/x-raw,format=I420,width=64,height=64,"
                   "framerate=100/1 ! terrainseg name=seg ! fakesink name=sink sync=true qos=true "
                   "signal-handoffs=true");
  Owned<GstElement> sink(gst_bin_get_by_name(GST_BIN(pipeline.get()), "sink"));
  int frames = 0;
  g_signal_connect(sink.get(), "handoff", G_CALLBACK(+[](GstElement*, GstBuffer*, GstPad*, int* count) {
                     ++*count;
                     g_usleep(25000);
                   }),
                   &frames);
  Owned<GstElement> seg(gst_bin_get_by_name(GST_BIN(pipeline.get()), "seg"));
  gboolean qos = TRUE;
  g_object_get(seg.get(), "qos", &qos, nullptr);
  EXPECT_FALSE(qos);
  g_object_set(sink.get(), "max-lateness", gint64{-1}, nullptr);
  EXPECT_EQ(run_pipeline(pipeline.get()), "");
  EXPECT_EQ(frames, 12);
}

struct Told {
  int permille = 0, horizon = 0;
  bool blocked = false;
  guint64 timestamp = 0;
};

Told told_by(GstMessage* message) {
  const GstStructure* s = gst_message_get_structure(message);
  EXPECT_STREQ(gst_structure_get_name(s), GST_TERRAIN_SEG_MESSAGE);
  guint permille = 0;
  gint horizon = 0;
  gboolean blocked = FALSE;
  guint64 timestamp = 0, time = 0;
  EXPECT_TRUE(gst_structure_get(s, "traversable-permille", G_TYPE_UINT, &permille, "horizon-row", G_TYPE_INT,
                                &horizon, "blocked", G_TYPE_BOOLEAN, &blocked, "timestamp", G_TYPE_UINT64,
                                &timestamp, "running-time", G_TYPE_UINT64, &time, "stream-time",
                                G_TYPE_UINT64, &time, "duration", G_TYPE_UINT64, &time, nullptr));
  return {static_cast<int>(permille), horizon, blocked != FALSE, timestamp};
}

TEST(Terrainseg, MessagesTellChangesAndNotNoise) {
  // On bumpy ground the horizon moves indeed.
  for (const auto& [place, most] : {std::pair{"road", 30}, {"trail light=drift motion=bumpy", 75}}) {
    constexpr int frames = 150;
    auto pipeline = make_element(std::string("terrainscenesrc name=src num-buffers=150 scene=") + place +
                                 " ! video/x-raw,format=I420,width=320,height=180,framerate=30/1 ! "
                                 "terrainseg post-messages=true ! fakesink signal-handoffs=true name=sink");
    Owned<GstElement> sink(gst_bin_get_by_name(GST_BIN(pipeline.get()), "sink"));
    Owned<GstBus> bus(gst_element_get_bus(pipeline.get()));
    struct Watch {
      Told last;
      int messages = 0, frames = 0, away = 0;
      guint64 silence = 0;
    } watch;
    // In the thread that sends: each frame's message comes before the frame.
    gst_bus_set_sync_handler(
        bus.get(),
        [](GstBus*, GstMessage* message, gpointer data) -> GstBusSyncReply {
          if (GST_MESSAGE_TYPE(message) != GST_MESSAGE_ELEMENT)
            return GST_BUS_PASS;
          auto* w = static_cast<Watch*>(data);
          w->last = told_by(message);
          ++w->messages;
          gst_message_unref(message);
          return GST_BUS_DROP;
        },
        &watch, nullptr);
    g_signal_connect(
        sink.get(), "handoff", G_CALLBACK(+[](GstElement*, GstBuffer* buffer, GstPad*, Watch* w) {
          const EstimateReader reader(buffer);
          const Estimate& e = reader.estimate();
          ++w->frames;
          w->silence = std::max(w->silence, GST_BUFFER_PTS(buffer) - w->last.timestamp);
          EXPECT_LT(std::abs(e.traversable_permille - w->last.permille), 25);
          EXPECT_TRUE(w->last.blocked || !(e.flags & flag_blocked)) << "the rover has to stop at once";
          const bool horizon_differs = (e.horizon_row < 0) != (w->last.horizon < 0);
          w->away = horizon_differs ? w->away + 1 : 0;
          EXPECT_LT(w->away, 5);
          EXPECT_TRUE(horizon_differs || std::abs(e.horizon_row - w->last.horizon) < 4); // 180 rows / 40
        }),
        &watch);
    EXPECT_EQ(run_pipeline(pipeline.get()), "");
    EXPECT_EQ(watch.frames, frames);
    EXPECT_GE(watch.messages, 5) << "one a second at least";
    EXPECT_LE(watch.messages, most) << place;
    EXPECT_LE(watch.silence, GST_SECOND);
    RecordProperty(std::string("messages-") + std::string(place).substr(0, 5), watch.messages);
  }
}

TEST(Terrainseg, NoMessagesWhenTheyAreOff) {
  Rig rig("terrainseg post-messages=true", caps_text("I420", 160, 120));
  rig.step();
  EXPECT_TRUE(Owned<GstMessage>(gst_bus_pop_filtered(rig.bus(), GST_MESSAGE_ELEMENT)));
  g_object_set(rig.element(), "post-messages", FALSE, nullptr);
  rig.step();
  EXPECT_FALSE(gst_bus_have_pending(rig.bus()));
}

// Steps of one frame at 40 ms; an estimate of 400 rows: the horizon's least change is 10.
class Announced : public testing::Test {
 protected:
  Estimate e;
  Announcer announcer;
  GstClockTime now = 0;

  Announced() {
    e.frame_height = 400;
    e.traversable_permille = 500;
    e.horizon_row = 100;
    e.flags = 0;
    EXPECT_TRUE(announcer.consider(e, now)) << "the first is told";
  }
  std::optional<News> next(GstClockTime step = 40 * GST_MSECOND) {
    return announcer.consider(e, now += step);
  }
};

TEST_F(Announced, TheShareAndTheHorizonByAStepFromWhatWasTold) {
  for (int drift = 1; drift < 25; ++drift) {
    e.traversable_permille = 500 + drift;
    EXPECT_FALSE(next(GST_MSECOND)) << drift;
  }
  e.traversable_permille = 525;
  ASSERT_TRUE(next());
  e.traversable_permille = 501;
  EXPECT_FALSE(next());
  e.horizon_row = 109;
  EXPECT_FALSE(next());
  e.horizon_row = 110;
  const auto told = next();
  ASSERT_TRUE(told);
  EXPECT_EQ(told->horizon_row, 110);
  EXPECT_EQ(told->traversable_permille, 501);
}

TEST_F(Announced, BlockedAtOnceAndFreeWhenItStays) {
  e.flags = flag_blocked;
  ASSERT_TRUE(next());
  e.flags = 0;
  for (int frame = 1; frame < 5; ++frame)
    EXPECT_FALSE(next()) << frame;
  e.flags = flag_blocked; // it flickered
  EXPECT_FALSE(next());
  e.flags = 0;
  for (int frame = 1; frame < 5; ++frame)
    EXPECT_FALSE(next()) << frame;
  e.traversable_permille = 900; // other news meanwhile does not say free either
  e.flags = flag_blocked;
  auto told = next();
  ASSERT_TRUE(told && told->blocked);
  e.flags = 0;
  for (int frame = 1; frame < 5; ++frame)
    EXPECT_FALSE(next()) << frame;
  told = next();
  ASSERT_TRUE(told);
  EXPECT_FALSE(told->blocked);
}

TEST_F(Announced, AHorizonThatFlickersIsNoNews) {
  for (int i = 0; i < 12; ++i) {
    e.horizon_row = i % 4 == 3 ? 100 : -1;
    EXPECT_FALSE(next(GST_MSECOND)) << i;
  }
  e.horizon_row = -1;
  for (int frame = 1; frame < 5; ++frame)
    EXPECT_FALSE(next(GST_MSECOND));
  const auto told = next(GST_MSECOND);
  ASSERT_TRUE(told);
  EXPECT_EQ(told->horizon_row, -1);
}

TEST_F(Announced, OnceASecondInAnyCase) {
  EXPECT_FALSE(next(999 * GST_MSECOND));
  EXPECT_TRUE(next(GST_MSECOND));
  EXPECT_FALSE(next(999 * GST_MSECOND));
  now = 0; // a seek
  EXPECT_TRUE(next(GST_MSECOND));
  for (int i = 0; i < 100; ++i) // without times there are no seconds
    EXPECT_FALSE(announcer.consider(e, GST_CLOCK_TIME_NONE));
}

TEST(Terrainseg, BlockedWhenNothingIsFree) {
  Rig open("terrainseg blocked-below=0", caps_text("I420", 320, 240));
  Owned<GstBuffer> out;
  for (int i = 0; i < 5; ++i)
    out = open.step();
  EXPECT_FALSE(EstimateReader(out.get()).estimate().flags & (flag_blocked | flag_unknown));
  Rig unknown("terrainseg learning=false", caps_text("I420", 320, 240));
  const auto c = unknown.step();
  EXPECT_TRUE(EstimateReader(c.get()).estimate().flags & flag_unknown);
  EXPECT_TRUE(EstimateReader(c.get()).estimate().flags & flag_blocked);
  for (guint8 value : bytes_of(EstimateReader(c.get()).estimate().mask))
    ASSERT_EQ(value, 128);
}

TEST(Terrainseg, StatsCountFramesAndTimes) {
  Rig rig("terrainseg", caps_text("I420", 320, 240));
  for (int i = 0; i < 6; ++i)
    rig.step();
  g_object_set(rig.element(), "learning", FALSE, nullptr);
  rig.step();
  rig.step();
  g_object_set(rig.element(), "learning", TRUE, "near-clear", FALSE, nullptr);
  rig.step();
  EXPECT_EQ(rig.counter("frames"), 9u);
  EXPECT_EQ(rig.counter("skipped-frozen"), 2u);
  EXPECT_EQ(rig.counter("skipped-near"), 1u);
  EXPECT_EQ(rig.counter("learned") + rig.counter("skipped-starved"), 6u);
  GstStructure* stats = nullptr;
  g_object_get(rig.element(), "stats", &stats, nullptr);
  for (int stage = 0; stage < stage_count; ++stage)
    for (const char* kind : {"-median-us", "-p99-us"}) {
      double value = -1;
      EXPECT_TRUE(gst_structure_get_double(
          stats, (name_of(static_cast<Stage>(stage)) + std::string(kind)).c_str(), &value));
      EXPECT_GE(value, 0);
    }
  double median = 0, high = 0;
  EXPECT_TRUE(gst_structure_get_double(stats, "total-median-us", &median));
  EXPECT_TRUE(gst_structure_get_double(stats, "total-p99-us", &high));
  EXPECT_GT(median, 0);
  EXPECT_GE(high, median);
  guint generation = 0;
  EXPECT_TRUE(gst_structure_get_uint(stats, "generation", &generation));
  EXPECT_GT(generation, 0u);
  gst_structure_free(stats);
}

TEST(Terrainseg, ConsumersChooseBetweenTwoInOneChain) {
  const std::string caps = caps_text("I420", 320, 240);
  const std::string two = "terrainseg instance=left window-x=20 window-width=60 ! "
                          "terrainseg instance=right window-x=220 window-width=60 ! ";
  const auto through = [&](const std::string& elements) {
    const Owned<GstHarness> h(gst_harness_new_parse(elements.c_str()));
    gst_harness_set_src_caps(h.get(), gst_caps_from_string(caps.c_str()));
    return bytes_of(Owned<GstBuffer>(gst_harness_push_and_pull(h.get(), new_frame(info_of(caps)))).get());
  };
  const auto line = [&](const std::string& source) {
    const auto bytes = through(two + "terrainextract " + source + " ! capsfilter caps=application/x-ndjson");
    return std::string(bytes.begin(), bytes.end());
  };
  const std::string left = line("source=left"), right = line("source=right");
  EXPECT_NE(left, right);
  EXPECT_EQ(line(""), right) << "the last";
  const auto left_alone = through("terrainseg window-x=20 window-width=60 ! terrainoverlay");
  EXPECT_EQ(through(two + "terrainoverlay source=left"), left_alone);
  EXPECT_NE(through(two + "terrainoverlay"), left_alone);
  EXPECT_EQ(through(two + "terrainoverlay source=nobody"), through("identity"));
}

/// Debug messages of a category while it lives.
class Listener {
 public:
  explicit Listener(GstDebugLevel level, const char* category = "terrainseg") : category_(category) {
    gst_debug_set_threshold_for_name(category, level);
    (gst_debug_remove_log_function)(gst_debug_log_default);
    (gst_debug_add_log_function)(note, this, nullptr);
  }
  ~Listener() {
    gst_debug_remove_log_function_by_data(this);
    (gst_debug_add_log_function)(gst_debug_log_default, nullptr, nullptr);
    gst_debug_unset_threshold_for_name(category_.c_str());
  }
  Listener(const Listener&) = delete;
  Listener& operator=(const Listener&) = delete;

  std::vector<std::string> with(GstDebugLevel level, const char* text) const {
    std::vector<std::string> found;
    for (const auto& [message_level, line] : lines)
      if (message_level == level && line.find(text) != std::string::npos)
        found.push_back(line);
    return found;
  }
  std::vector<std::pair<GstDebugLevel, std::string>> lines;

 private:
  static void note(GstDebugCategory* category, GstDebugLevel level, const gchar*, const gchar*, gint,
                   GObject*, GstDebugMessage* message, gpointer data) {
    auto* self = static_cast<Listener*>(data);
    if (self->category_ == gst_debug_category_get_name(category)) {
      const std::lock_guard lock(self->mutex_);
      self->lines.emplace_back(level, gst_debug_message_get(message));
    }
  }

  std::string category_;
  std::mutex mutex_; // elements have threads of their own
};

TEST(Terrainseg, DebugTellsOnceASecondWhatIsLearnedAndWhyNot) {
  const Listener listener(GST_LEVEL_DEBUG);
  Rig rig("terrainseg", caps_text("I420", 320, 240));
  for (int i = 0; i < 5; ++i)
    rig.step();
  auto lines = listener.with(GST_LEVEL_DEBUG, "learned ");
  ASSERT_EQ(lines.size(), 1u) << "of the first frame";
  EXPECT_NE(lines[0].find("learned 1 of 1 frame from window 96x36 at 112,204"), std::string::npos)
      << lines[0];
  EXPECT_EQ(lines[0].find(", not "), std::string::npos) << lines[0];
  g_object_set(rig.element(), "near-clear", FALSE, nullptr);
  rig.step();
  g_object_set(rig.element(), "near-clear", TRUE, "learning", FALSE, nullptr);
  rig.step();
  g_usleep(G_USEC_PER_SEC);
  rig.step();
  lines = listener.with(GST_LEVEL_DEBUG, "learned ");
  ASSERT_EQ(lines.size(), 2u);
  EXPECT_NE(lines[1].find("learned 4 of 7 frames"), std::string::npos) << lines[1];
  EXPECT_NE(lines[1].find("not 1 (near-clear=false)"), std::string::npos) << lines[1];
  EXPECT_NE(lines[1].find("not 2 (learning off"), std::string::npos) << lines[1];
  EXPECT_NE(lines[1].find(" us a frame"), std::string::npos) << lines[1];
  EXPECT_TRUE(listener.with(GST_LEVEL_LOG, "").empty());
}

TEST(Terrainseg, DebugLevelSixTellsOfEveryFrameAndNoneTellsNothing) {
  {
    const Listener listener(GST_LEVEL_LOG);
    Rig rig("terrainseg", caps_text("I420", 320, 240));
    for (int i = 0; i < 5; ++i)
      rig.step();
    EXPECT_EQ(listener.with(GST_LEVEL_LOG, "frame ").size(), 5u);
  }
  const Listener listener(GST_LEVEL_WARNING);
  Rig rig("terrainseg", caps_text("I420", 320, 240));
  rig.step();
  EXPECT_TRUE(listener.lines.empty());
}

/// Lines of level 6 that an element wrote of ten frames which went through all of ours.
std::size_t lines_of_ten_frames(const char* category) {
  const Listener listener(GST_LEVEL_LOG, category);
  const std::string reference = have("terrainreference") ? "terrainreference ! " : "";
  const auto pipeline = make_element(
      "terrainscenesrc num-buffers=10 ! video/x-raw,format=I420,width=160,height=120,framerate=30/1 ! " +
      reference + "terrainseg ! tee name=t t. ! queue ! c.sink t. ! queue ! terrainextract ! " +
      "meta/x-klv,parsed=true ! c.meta terraincombine name=c ! terrainoverlay ! fakesink");
  EXPECT_EQ(run_pipeline(pipeline.get()), "");
  return listener.with(GST_LEVEL_LOG, "").size();
}

TEST(Terrainseg, EveryElementTellsOfEveryFrameAtLevelSix) {
  for (const char* name :
       {"terrainseg", "terrainoverlay", "terrainextract", "terrainscenesrc", "terraincombine"})
    EXPECT_GE(lines_of_ten_frames(name), 10u) << name;
  if (have("terrainreference")) {
    EXPECT_GE(lines_of_ten_frames("terrainreference"), 10u);
  }
}

/// Loading a preset sets every property, and what was set explicitly stands above `preset`, file and default
/// for ever: settings-location does what it would be for.
TEST(Terrainseg, NoElementOffersGstPreset) {
  for (const char* name : {"terrainseg", "terrainoverlay", "terrainextract", "terrainscenesrc",
                           "terraincombine", "terrainstamp", "terrainreference"})
    if (have(name)) {
      const auto element = make_element(name); // the macro keeps a pointer beyond its argument
      EXPECT_FALSE(GST_IS_PRESET(element.get())) << name;
    }
}

TEST(Terrainseg, EnumerationsAreMarkedForTheDocumentation) {
  int enumerations = 0;
  for (const char* name : {"terrainseg", "terrainoverlay", "terrainextract", "terrainscenesrc",
                           "terraincombine", "terrainstamp", "terrainreference"}) {
    if (!have(name))
      continue;
    const auto element = make_element(name);
    guint count = 0;
    GParamSpec** specs = g_object_class_list_properties(G_OBJECT_GET_CLASS(element.get()), &count);
    for (guint i = 0; i < count; ++i)
      if (specs[i]->owner_type == G_OBJECT_TYPE(element.get()) &&
          (G_IS_PARAM_SPEC_ENUM(specs[i]) || G_IS_PARAM_SPEC_FLAGS(specs[i]))) {
        EXPECT_TRUE(gst_type_is_plugin_api(specs[i]->value_type, nullptr)) << name << " " << specs[i]->name;
        ++enumerations;
      }
    g_free(specs);
  }
  EXPECT_GE(enumerations, 15);
}

TEST(Terrainseg, AnApplicationsSubclassWorksWithoutAFactory) {
  for (const char* name : {"terrainseg", "terrainoverlay", "terrainextract", "terrainscenesrc",
                           "terraincombine", "terrainstamp"}) {
    const GType type = G_OBJECT_TYPE(make_element(name).get());
    GTypeQuery sizes;
    g_type_query(type, &sizes);
    const GType derived =
        g_type_register_static_simple(type, (std::string("Derived_") + name).c_str(), sizes.class_size,
                                      nullptr, sizes.instance_size, nullptr, static_cast<GTypeFlags>(0));
    Owned<GstElement> element(GST_ELEMENT(gst_object_ref_sink(g_object_new(derived, nullptr))));
    EXPECT_EQ(gst_element_get_factory(element.get()), nullptr);
    guint count = 0;
    GParamSpec** specs = g_object_class_list_properties(G_OBJECT_GET_CLASS(element.get()), &count);
    for (guint i = 0; i < count; ++i) {
      if (specs[i]->owner_type != type || !(specs[i]->flags & G_PARAM_READABLE))
        continue;
      GValue value = G_VALUE_INIT;
      g_object_get_property(G_OBJECT(element.get()), specs[i]->name, &value);
      if (specs[i]->flags & G_PARAM_WRITABLE)
        g_object_set_property(G_OBJECT(element.get()), specs[i]->name, &value);
      g_value_unset(&value);
    }
    g_free(specs);
    EXPECT_NE(gst_element_set_state(element.get(), GST_STATE_PAUSED), GST_STATE_CHANGE_FAILURE) << name;
  }
}

// ---- the learned terrain as a file -----------------------------------------------------------------------

class ModelFile : public testing::Test {
 protected:
  void SetUp() override {
    gchar* name = nullptr;
    GError* error = nullptr;
    const int handle = g_file_open_tmp("terrainseg-XXXXXX.terrain", &name, &error);
    ASSERT_GE(handle, 0);
    close(handle);
    path_ = name;
    g_free(name);
    std::filesystem::remove(path_);
  }
  void TearDown() override { std::filesystem::remove(path_); }

  static bool call(Rig& rig, const char* signal, const std::string& path) {
    gboolean done = FALSE;
    g_signal_emit_by_name(rig.element(), signal, path.c_str(), &done);
    return done;
  }
  void learn_and_save(const std::string& format = "I420", const std::string& element = "terrainseg") {
    Rig rig(element, caps_text(format, 160, 120));
    rig.generation_after(5);
    ASSERT_TRUE(call(rig, "save-model", path_));
  }
  std::string path_;
};

TEST_F(ModelFile, WhatOneLearnedAnotherKnows) {
  learn_and_save();
  Rig knowing("terrainseg learning=false model-location=" + path_, caps_text("I420", 160, 120));
  const auto a = knowing.step();
  EXPECT_FALSE(EstimateReader(a.get()).estimate().flags & flag_unknown);
  EXPECT_GT(EstimateReader(a.get()).estimate().model_count, 0);

  Rig other("terrainseg learning=false", caps_text("I420", 160, 120));
  EXPECT_TRUE(EstimateReader(other.step().get()).estimate().flags & flag_unknown);
  EXPECT_TRUE(call(other, "load-model", path_));
  EXPECT_FALSE(EstimateReader(other.step().get()).estimate().flags & flag_unknown);
  g_signal_emit_by_name(other.element(), "reset");
  EXPECT_TRUE(EstimateReader(other.step().get()).estimate().flags & flag_unknown);
}

TEST_F(ModelFile, SavingTwiceGivesTheSameBytes) {
  learn_and_save();
  std::ifstream first_file(path_, std::ios::binary);
  const std::string first((std::istreambuf_iterator<char>(first_file)), {});
  learn_and_save();
  std::ifstream second_file(path_, std::ios::binary);
  EXPECT_EQ(std::string((std::istreambuf_iterator<char>(second_file)), {}), first);
  EXPECT_GT(first.size(), 20u);
}

TEST_F(ModelFile, NothingLearnedIsNotSaved) {
  Rig rig("terrainseg", caps_text("I420", 160, 120));
  EXPECT_FALSE(call(rig, "save-model", path_));
  EXPECT_FALSE(std::filesystem::exists(path_));
  const auto warnings = rig.warnings();
  ASSERT_EQ(warnings.size(), 1u);
  EXPECT_TRUE(warnings[0].contains(path_.c_str()));
}

TEST_F(ModelFile, AFolderThatDoesNotExistIsNamed) {
  Rig rig("terrainseg", caps_text("I420", 160, 120));
  rig.generation_after(3);
  EXPECT_FALSE(call(rig, "save-model", "/nonexistent/folder/x.terrain"));
  const auto warnings = rig.warnings();
  ASSERT_EQ(warnings.size(), 1u);
  EXPECT_TRUE(warnings[0].contains("/nonexistent/folder/x.terrain"));
}

TEST_F(ModelFile, MissingAndDamagedAreErrorsAtStart) {
  learn_and_save();
  std::filesystem::resize_file(path_, std::filesystem::file_size(path_) - 3);
  for (const std::string& path : {path_, std::string("/nonexistent/x.terrain")}) {
    auto element = make_element("terrainseg model-location=" + path);
    Owned<GstBus> bus(gst_bus_new());
    gst_element_set_bus(element.get(), bus.get());
    EXPECT_EQ(gst_element_set_state(element.get(), GST_STATE_PAUSED), GST_STATE_CHANGE_FAILURE);
    const auto errors = reports(bus.get(), GST_MESSAGE_ERROR);
    ASSERT_EQ(errors.size(), 1u) << path;
    EXPECT_TRUE(errors[0].contains(path.c_str()));
    EXPECT_TRUE(errors[0].contains("model-location"));
    gst_element_set_state(element.get(), GST_STATE_NULL);
    gst_element_set_bus(element.get(), nullptr);
  }
}

TEST_F(ModelFile, ADamagedFileLeavesTheRunningModel) {
  std::ofstream(path_, std::ios::binary) << "this is not a terrain";
  Rig rig("terrainseg", caps_text("I420", 160, 120));
  const guint generation = rig.generation_after(5);
  EXPECT_FALSE(call(rig, "load-model", path_));
  const auto warnings = rig.warnings();
  ASSERT_EQ(warnings.size(), 1u);
  EXPECT_TRUE(warnings[0].contains(path_.c_str()));
  g_object_set(rig.element(), "learning", FALSE, nullptr);
  const auto out = rig.step();
  EXPECT_EQ(EstimateReader(out.get()).estimate().model_generation, generation);
  EXPECT_FALSE(EstimateReader(out.get()).estimate().flags & flag_unknown);
}

TEST_F(ModelFile, AModelOfAnotherColourSpaceIsNamed) {
  learn_and_save("RGB", "terrainseg preset=paper"); // the default pipeline brings all colours to one space
  {
    Rig rig("terrainseg preset=paper", caps_text("I420", 160, 120));
    rig.generation_after(3);
    EXPECT_FALSE(call(rig, "load-model", path_));
    EXPECT_EQ(rig.warnings().size(), 1u);
    EXPECT_FALSE(EstimateReader(rig.step().get()).estimate().flags & flag_unknown);
  }
  Rig rig("terrainseg preset=paper model-location=" + path_, caps_text("I420", 160, 120));
  EXPECT_NE(rig.push(new_frame(rig.info())), GST_FLOW_OK);
  rig.set_caps(caps_text("I420", 176, 128)); // upstream tries again
  EXPECT_NE(rig.push(new_frame(rig.info())), GST_FLOW_OK);
  const auto errors = rig.errors();
  const auto of_terrain = [this](const auto& error) { return error.contains(path_.c_str()); };
  ASSERT_EQ(std::count_if(errors.begin(), errors.end(), of_terrain), 1) << "said more than once";
  EXPECT_TRUE(errors[0].contains(path_.c_str()));
  EXPECT_TRUE(errors[0].contains("RGB"));
}

TEST_F(ModelFile, TheRangeIsReadWithoutAMatrix) {
  // What decoders say of a camera's H.264 with full range and no description of its colours.
  const std::string full = caps_text("I420", 160, 120, ",colorimetry=1:0:0:0");
  {
    Rig learner("terrainseg preset=paper", full);
    learner.generation_after(3);
    ASSERT_TRUE(call(learner, "save-model", path_));
  }
  for (const auto& [colorimetry, same] :
       {std::pair("1:4:0:0", true), {"1:0:5:1", true}, {"2:0:0:0", false}, {"bt601", false}}) {
    SCOPED_TRACE(colorimetry);
    Rig reader("terrainseg preset=paper",
               caps_text("I420", 160, 120, std::string(",colorimetry=") + colorimetry));
    reader.generation_after(3);
    EXPECT_EQ(call(reader, "load-model", path_), same);
  }
}

TEST_F(ModelFile, TheTwoPipelinesDoNotReadEachOthersModels) {
  // Full-range BT.601: the one space that both could learn in.
  const std::string caps = caps_text("I420", 160, 120, ",colorimetry=1:4:0:0");
  for (const bool paper_learns : {false, true}) {
    const char* one = paper_learns ? "terrainseg preset=paper" : "terrainseg";
    const char* other = paper_learns ? "terrainseg" : "terrainseg preset=paper";
    Rig learner(one, caps), reader(other, caps);
    learner.generation_after(3);
    reader.generation_after(3);
    ASSERT_TRUE(call(learner, "save-model", path_));
    EXPECT_FALSE(call(reader, "load-model", path_));
    EXPECT_EQ(reader.warnings().size(), 1u);
  }
}

TEST_F(ModelFile, AnotherColourSpaceLaterIsAWarningAndANewStart) {
  learn_and_save("I420", "terrainseg preset=paper");
  Rig rig("terrainseg preset=paper learning=false model-location=" + path_, caps_text("I420", 160, 120));
  EXPECT_FALSE(EstimateReader(rig.step().get()).estimate().flags & flag_unknown);
  rig.set_caps(caps_text("RGB", 160, 120));
  EXPECT_TRUE(EstimateReader(rig.step().get()).estimate().flags & flag_unknown);
  const auto warnings = rig.warnings();
  ASSERT_EQ(warnings.size(), 1u);
  EXPECT_TRUE(warnings[0].contains(path_.c_str()));
  rig.set_caps(caps_text("I420", 160, 120));
  EXPECT_TRUE(EstimateReader(rig.step().get()).estimate().flags & flag_unknown);
  EXPECT_TRUE(rig.errors().empty());
}

TEST_F(ModelFile, ANewStreamStartsFromTheLoadedTerrain) {
  learn_and_save();
  Rig rig("terrainseg learning=false model-location=" + path_, caps_text("I420", 160, 120));
  for (const char* id : {"one", "two", "three"}) {
    gst_harness_push_event(rig.harness(), gst_event_new_stream_start(id));
    rig.set_caps(caps_text("I420", 160, 120));
    EXPECT_FALSE(EstimateReader(rig.step().get()).estimate().flags & flag_unknown) << id;
  }
}

TEST_F(ModelFile, ALoadedTerrainStaysUntilReset) {
  learn_and_save();
  const std::string caps = caps_text("I420", 160, 120);
  const auto knows = [](Rig& rig) {
    return !(EstimateReader(rig.step().get()).estimate().flags & flag_unknown);
  };
  for (const GstState through : {GST_STATE_NULL, GST_STATE_READY})
    for (const char* reset_on : {"stream", "never", "discont"}) {
      Rig rig(std::string("terrainseg learning=false reset-on=") + reset_on, caps);
      EXPECT_FALSE(knows(rig));
      EXPECT_TRUE(call(rig, "load-model", path_));
      for (int again = 0; again < 2; ++again) {
        rig.restart(through, caps);
        EXPECT_TRUE(knows(rig)) << reset_on << ", time " << again;
      }
      g_signal_emit_by_name(rig.element(), "reset");
      rig.restart(through, caps);
      EXPECT_FALSE(knows(rig)) << reset_on;
    }
}

TEST_F(ModelFile, LoadModelStandsAboveTheLocationUntilReset) {
  learn_and_save();
  const std::string caps = caps_text("I420", 160, 120), gone = path_ + ".gone";
  std::filesystem::copy_file(path_, gone);
  Rig rig("terrainseg learning=false model-location=" + gone, caps);
  EXPECT_TRUE(call(rig, "load-model", path_));
  std::filesystem::remove(gone); // not read any more
  rig.restart(GST_STATE_NULL, caps);
  EXPECT_FALSE(EstimateReader(rig.step().get()).estimate().flags & flag_unknown);
  EXPECT_TRUE(rig.errors().empty());
  g_signal_emit_by_name(rig.element(), "reset");
  gst_element_set_state(rig.element(), GST_STATE_NULL);
  EXPECT_EQ(gst_element_set_state(rig.element(), GST_STATE_PLAYING), GST_STATE_CHANGE_FAILURE);
  EXPECT_EQ(rig.errors().size(), 1u);
}

TEST_F(ModelFile, ResetOnNeverKeepsWhatWasLearnedOnTopOfTheFile) {
  learn_and_save();
  const std::string caps = caps_text("I420", 160, 120);
  Rig rig("terrainseg reset-on=never model-location=" + path_, caps);
  rig.generation_after(5);
  const auto mass = [&] {
    const auto out = rig.step();
    std::uint64_t sum = 0;
    const EstimateReader reader(out.get());
    for (const ModelSummary& model : reader.estimate().models)
      sum += model.mass;
    return sum;
  };
  g_object_set(rig.element(), "learning", FALSE, nullptr);
  const std::uint64_t learned = mass();
  rig.restart(GST_STATE_READY, caps);
  EXPECT_EQ(mass(), learned);
}

/// Who handles a message in the streaming thread may use every signal and property: nothing is locked then.
TEST_F(ModelFile, SignalsFromASynchronousMessageHandler) {
  Rig rig("terrainseg post-messages=true", caps_text("I420", 160, 120));
  struct Context {
    Rig* rig;
    std::string path;
    int calls = 0;
  } context{&rig, path_};
  gst_bus_set_sync_handler(
      rig.bus(),
      [](GstBus*, GstMessage*, gpointer data) -> GstBusSyncReply {
        auto* c = static_cast<Context*>(data);
        if (c->calls++ > 20)
          return GST_BUS_DROP;
        call(*c->rig, "save-model", c->path);
        call(*c->rig, "load-model", c->path);
        g_signal_emit_by_name(c->rig->element(), "reset");
        c->rig->counter("frames");
        g_object_set(c->rig->element(), "caution", c->calls, nullptr);
        return GST_BUS_DROP;
      },
      &context, nullptr);
  for (int i = 0; i < 5; ++i)
    EXPECT_TRUE(EstimateReader(rig.step().get()));
  EXPECT_GT(context.calls, 0);
  gst_bus_set_sync_handler(rig.bus(), nullptr, nullptr, nullptr);
}

} // namespace
} // namespace terrainseg::test
