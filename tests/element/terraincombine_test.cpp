// SPDX-License-Identifier: LGPL-2.1-or-later
#include "outlet_harness.hpp"

#include "exchange/precision_stamp.hpp"

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

/// With a stamp of that precision time, as decoders hand it on.
Owned<GstBuffer> stamped(int i, std::uint64_t time_us) {
  auto buffer = frame(raw_size, i);
  StampIdentifier identifier = h264_microseconds;
  StampContent content = stamp_content(time_us);
  gst_buffer_add_video_sei_user_data_unregistered_meta(buffer.get(), identifier.data(), content.data(),
                                                       content.size());
  return buffer;
}

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
  Combine(const Combine&) = delete;
  Combine& operator=(const Combine&) = delete;
  /// The task asks both harnesses for their latency: it ends before either goes.
  ~Combine() {
    if (video)
      gst_element_set_state(video->element, GST_STATE_NULL);
  }
  GstFlowReturn push_frame(int i, gsize size = raw_size) {
    return gst_harness_push(video.get(), frame(size, i).release());
  }
  GstFlowReturn push_stamped(int i, std::uint64_t time_us) {
    return gst_harness_push(video.get(), stamped(i, time_us).release());
  }
  void push_unit(const Estimate& e, int i, GstClockTimeDiff offset = 0,
                 GstClockTime dts = GST_CLOCK_TIME_NONE, std::uint64_t time_us = 0) {
    KlvEncoder encoder;
    const auto bytes = encoder.encode(e, time_us);
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

/// Not live, as behind a file.
struct FileCombine : Combine {
  explicit FileCombine(guint latency_ms, const char* caps = raw_caps) : Combine(latency_ms, caps) {
    gst_harness_set_live(video.get(), FALSE);
    gst_harness_set_live(meta.get(), FALSE);
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

constexpr std::uint64_t day = 1'795'377'600'000'000; // precision times begin there
constexpr std::uint64_t step = 40'000;

/// The unit of frame `i`, `shift` frames off by its time stamp.
void push_precise(Combine& c, int i, int shift = 0, std::uint64_t begin = day) {
  c.push_unit(some(static_cast<unsigned>(i)).estimate, i + shift, 0, GST_CLOCK_TIME_NONE,
              begin + static_cast<std::uint64_t>(i) * step);
}

/// The frame that leaves next carries the unit of frame `i`; -1 = none.
void expect_unit(Combine& c, int i) {
  const auto out = c.pull();
  ASSERT_TRUE(out);
  const EstimateReader reader(out.get());
  EXPECT_EQ(reader ? static_cast<int>(reader.estimate().frame) : -1, i);
}

TEST(TerrainCombine, StampedFramesGoByPrecisionTime) {
  for (const int shift : {-3, 1, 200}) {
    Combine c(5000);
    for (int i = 4; i < 16; ++i) {
      push_precise(c, i, shift);
      EXPECT_EQ(c.push_stamped(i, day + static_cast<std::uint64_t>(i) * step), GST_FLOW_OK);
      expect_unit(c, i);
    }
    EXPECT_EQ(c.stat("matched"), 12u);
    EXPECT_EQ(c.stat("matched-precisely"), 12u);
    EXPECT_EQ(c.stat("unused"), 0u);
  }
}

// The unit's time stamp is the frame's, its precision time is off by a microsecond: it is another frame's.
TEST(TerrainCombine, AStampedFrameTakesNoNeighboursUnit) {
  Combine c(5000);
  for (const std::uint64_t off : {std::uint64_t{1}, step}) {
    c.push_unit(some(1).estimate, 1, 0, GST_CLOCK_TIME_NONE, day + step + off);
    EXPECT_EQ(c.push_stamped(1, day + step), GST_FLOW_OK); // and does not wait: its unit cannot come any more
    expect_unit(c, -1);
  }
  EXPECT_EQ(c.stat("lost"), 2u);
}

TEST(TerrainCombine, AFrameThatLostItsStampTakesNone) {
  Combine c(5000);
  push_precise(c, 0);
  push_precise(c, 1);
  push_precise(c, 2);
  c.push_stamped(0, day);
  expect_unit(c, 0);
  c.push_frame(1);
  expect_unit(c, -1);
  c.push_stamped(2, day + 2 * step);
  expect_unit(c, 2);
  // A sender that stamps no more is believed after a while.
  for (int i = 3; i < 40; ++i) {
    push_precise(c, i);
    c.push_frame(i);
    expect_unit(c, i < 2 + 25 ? -1 : i);
  }
  EXPECT_EQ(c.stat("matched-precisely"), 2u);
}

/// One flipped bit in a picture's stamp: the units of the frames behind it stay.
TEST(TerrainCombine, ADamagedStampCostsOneMask) {
  Combine c(100);
  for (int i = 1; i <= 4; ++i)
    c.push_unit(some(static_cast<unsigned>(i)).estimate, i, 0, GST_CLOCK_TIME_NONE, 40'000u * i);
  gst_harness_push_event(c.meta.get(), gst_event_new_eos());
  for (int i = 1; i <= 4; ++i)
    EXPECT_EQ(c.push_stamped(i, 40'000u * i + (i == 2 ? std::uint64_t{1} << 40 : 0)), GST_FLOW_OK);
  for (int i = 1; i <= 4; ++i)
    c.expect(i, i != 2);
  EXPECT_EQ(c.stat("matched-precisely"), 3u);
}

TEST(TerrainCombine, StampsMayBeSetAside) {
  Combine c(5000);
  gst_util_set_object_arg(G_OBJECT(c.video->element), "match", "time-stamps");
  push_precise(c, 1);
  c.push_stamped(1, 77);
  expect_unit(c, 1);
  EXPECT_EQ(c.stat("matched"), 1u);
  EXPECT_EQ(c.stat("matched-precisely"), 0u);
}

// Also while it plays: no frame has lost its stamp then.
TEST(TerrainCombine, StampsMayBeSetAsideWhilePlaying) {
  Combine c(5000);
  for (int i = 0; i < 20; ++i) {
    if (i == 10)
      gst_util_set_object_arg(G_OBJECT(c.video->element), "match", "time-stamps");
    push_precise(c, i);
    c.push_stamped(i, day + static_cast<std::uint64_t>(i) * step);
    expect_unit(c, i);
  }
  EXPECT_EQ(c.stat("matched"), 20u);
  EXPECT_EQ(c.stat("matched-precisely"), 10u);
}

// The sender is switched off and on, and does not know the time of day: what is left of its first run is
// nobody's.
TEST(TerrainCombine, PrecisionTimesThatBeginAnew) {
  for (const bool video_first : {false, true}) {
    Combine c(100);
    for (int i = 0; i < 60; ++i) {
      push_precise(c, i, 0, 0);
      if (i < 50) {
        c.push_stamped(i, static_cast<std::uint64_t>(i) * step);
        expect_unit(c, i);
      }
    }
    const auto unit = [&](int i) {
      c.push_unit(some(static_cast<unsigned>(100 + i)).estimate, 50 + i, 0, GST_CLOCK_TIME_NONE,
                  static_cast<std::uint64_t>(i) * step);
    };
    for (int i = 0; i < 60; ++i) {
      if (!video_first)
        unit(i);
      c.push_stamped(50 + i, static_cast<std::uint64_t>(i) * step);
      if (video_first)
        unit(i);
      expect_unit(c, 100 + i);
    }
    EXPECT_EQ(c.stat("unused"), 10u);
  }
}

// Two recordings one after the other: units run ahead of frames, which a decoder and queues hold back.
TEST(TerrainCombine, UnitsOfANewRunComeBeforeTheLastFramesOfTheOldOne) {
  for (const bool stamped_before : {false, true}) {
    FileCombine c(200);
    constexpr int run = 60;
    const auto frame_of = [&](int i) {
      c.push_stamped(i, static_cast<std::uint64_t>(i % run) * step);
      expect_unit(c, i);
    };
    const auto unit_of = [&](int i) {
      c.push_unit(some(static_cast<unsigned>(i)).estimate, i, 0, GST_CLOCK_TIME_NONE,
                  static_cast<std::uint64_t>(i % run) * step);
    };
    const auto before = SteadyClock::now();
    unit_of(0);
    if (stamped_before)
      frame_of(0);
    for (int i = 1; i < 3 * run; ++i)
      unit_of(i);
    for (int i = stamped_before; i < 3 * run; ++i)
      frame_of(i);
    EXPECT_EQ(c.stat("matched-precisely"), 3u * run);
    EXPECT_EQ(c.stat("unused"), 0u);
    EXPECT_LT(SteadyClock::now() - before, milliseconds(4000)) << "a frame waited for what had come";
  }
}

// The last units of a run are lost: its frames wait for none of the next run's, and take none.
TEST(TerrainCombine, FramesOfAnOldRunTakeNoUnitOfTheNewOne) {
  FileCombine c(200);
  const auto before = SteadyClock::now();
  push_precise(c, 0, 0, 0);
  c.push_stamped(0, 0);
  expect_unit(c, 0);
  for (int i = 1; i < 40; ++i)
    push_precise(c, i, 0, 0);
  for (int i = 0; i < 60; ++i)
    c.push_unit(some(static_cast<unsigned>(100 + i)).estimate, 50 + i, 0, GST_CLOCK_TIME_NONE,
                static_cast<std::uint64_t>(i) * step);
  for (int i = 1; i < 50; ++i) {
    c.push_stamped(i, static_cast<std::uint64_t>(i) * step);
    expect_unit(c, i < 40 ? i : -1);
  }
  for (int i = 0; i < 60; ++i) {
    c.push_stamped(50 + i, static_cast<std::uint64_t>(i) * step);
    expect_unit(c, 100 + i);
  }
  EXPECT_LT(SteadyClock::now() - before, milliseconds(4000));
}

// The frames of a new run come first, and what is left of the old one's units behind them.
TEST(TerrainCombine, LateUnitsOfAnOldRun) {
  Combine c(100);
  for (int i = 0; i < 60; ++i) {
    if (i < 55)
      push_precise(c, i, 0, 0);
    c.push_stamped(i, static_cast<std::uint64_t>(i) * step);
    expect_unit(c, i < 55 ? i : -1);
  }
  c.push_stamped(60, 0);
  expect_unit(c, -1);
  for (int i = 55; i < 60; ++i)
    push_precise(c, i, 0, 0);
  for (int i = 1; i < 30; ++i) {
    c.push_unit(some(static_cast<unsigned>(100 + i)).estimate, 60 + i, 0, GST_CLOCK_TIME_NONE,
                static_cast<std::uint64_t>(i) * step);
    c.push_stamped(60 + i, static_cast<std::uint64_t>(i) * step);
    expect_unit(c, 100 + i);
  }
}

// The sender's clock is set back a little while units lie far ahead: that is no new run.
TEST(TerrainCombine, AClockThatIsSetBackALittleKeepsItsUnits) {
  FileCombine c(200);
  const auto time = [](int i) { return day + static_cast<std::uint64_t>(i < 20 ? i : i - 5) * step; };
  const auto unit = [&](int i) {
    c.push_unit(some(static_cast<unsigned>(i)).estimate, i, 0, GST_CLOCK_TIME_NONE, time(i) + (i >= 20));
  };
  unit(0);
  c.push_stamped(0, time(0));
  expect_unit(c, 0);
  for (int i = 1; i < 80; ++i)
    unit(i);
  for (int i = 1; i < 80; ++i) {
    c.push_stamped(i, time(i) + (i >= 20));
    expect_unit(c, i >= 20 && i < 24 ? -1 : i); // those four were dropped: they lay before the frames
  }
}

// A clock that leaps ahead, units first: frames of before still find theirs.
TEST(TerrainCombine, PrecisionTimesThatLeap) {
  Combine c(5000);
  const std::uint64_t hour = 3'600'000'000;
  for (int i = 0; i < 20; ++i)
    push_precise(c, i, 0, i < 10 ? day : day + hour);
  for (int i = 0; i < 20; ++i) {
    c.push_stamped(i, (i < 10 ? day : day + hour) + static_cast<std::uint64_t>(i) * step);
    expect_unit(c, i);
  }
}

/// A unit as a muxer without time stamps brings it.
void push_timeless(Combine& c, const Estimate& e, std::uint64_t time_us) {
  KlvEncoder encoder;
  const auto bytes = encoder.encode(e, time_us);
  GstBuffer* unit = gst_buffer_new_memdup(bytes.data(), bytes.size());
  EXPECT_EQ(gst_harness_push(c.meta.get(), unit), GST_FLOW_OK);
}

// Units without a time stamp, as "ffmpeg -c copy" leaves them, need none.
TEST(TerrainCombine, StampsDoWithoutTimeStampsOfUnits) {
  Combine c(5000);
  Bus bus(c.video.get());
  for (int i = 7; i < 20; ++i) // the first unit is not the first frame's
    push_timeless(c, some(static_cast<unsigned>(i)).estimate, day + static_cast<std::uint64_t>(i) * step);
  for (int i = 4; i < 20; ++i) {
    c.push_stamped(i, day + static_cast<std::uint64_t>(i) * step);
    expect_unit(c, i < 7 ? -1 : i);
  }
  push_timeless(c, some(20).estimate, day + 20 * step);
  EXPECT_EQ(bus.text(GST_MESSAGE_WARNING), "") << "no mask lies on a wrong frame";
}

// Nor when the sender's time begins anew, units ahead or not.
TEST(TerrainCombine, StampsDoWithoutTimeStampsOfUnitsThatBeginAnew) {
  for (const int ahead : {0, 20, 100}) {
    FileCombine c(200);
    const auto time = [](int i) { return static_cast<std::uint64_t>(i < 50 ? 500 + i : i - 50) * step; };
    for (int i = 0; i < ahead; ++i)
      push_timeless(c, some(static_cast<unsigned>(i)).estimate, time(i));
    for (int i = 0; i < 100; ++i) {
      if (i + ahead < 100)
        push_timeless(c, some(static_cast<unsigned>(i + ahead)).estimate, time(i + ahead));
      c.push_stamped(i, time(i));
      expect_unit(c, i);
    }
    EXPECT_EQ(c.stat("unused"), 0u);
  }
}

// Neither frames nor units have time stamps.
TEST(TerrainCombine, StampsDoWithoutAnyTimeStamps) {
  FileCombine c(200);
  for (int i = 0; i < 10; ++i) {
    push_timeless(c, some(static_cast<unsigned>(i)).estimate, day + static_cast<std::uint64_t>(i) * step);
    auto buffer = stamped(i, day + static_cast<std::uint64_t>(i) * step);
    GST_BUFFER_PTS(buffer.get()) = GST_BUFFER_DTS(buffer.get()) = GST_CLOCK_TIME_NONE;
    EXPECT_EQ(gst_harness_push(c.video.get(), buffer.release()), GST_FLOW_OK);
    expect_unit(c, i);
  }
}

// A stamp that came twice, as parsers behind parsers leave it, is one; two that differ are none.
TEST(TerrainCombine, TwoStampsOnAFrame) {
  Combine c(5000);
  push_precise(c, 0);
  push_precise(c, 1);
  push_precise(c, 2);
  const auto push = [&](int i, std::initializer_list<std::uint64_t> times) {
    auto buffer = frame(raw_size, i);
    for (const std::uint64_t time : times) {
      StampIdentifier identifier = h265_microseconds;
      StampContent content = stamp_content(time);
      gst_buffer_add_video_sei_user_data_unregistered_meta(buffer.get(), identifier.data(), content.data(),
                                                           content.size());
    }
    gst_harness_push(c.video.get(), buffer.release());
  };
  push(0, {day, day});
  expect_unit(c, 0);
  push(1, {day + step, day + 2 * step});
  expect_unit(c, -1);
  push(2, {day + 2 * step});
  expect_unit(c, 2);
}

TEST(TerrainCombine, SaysThatStampsAndUnitsAreStrangers) {
  Combine c(5000);
  Bus bus(c.video.get());
  for (int i = 0; i < 70; ++i) {
    push_precise(c, i);
    c.push_stamped(i, static_cast<std::uint64_t>(i) * step);
    expect_unit(c, -1);
  }
  const std::string told = bus.text(GST_MESSAGE_WARNING);
  EXPECT_NE(told.find("match=time-stamps"), std::string::npos) << told;
}

// Frames with stamps that no unit fits do not gather units without end.
TEST(TerrainCombine, UnitsOfNoStampAreDropped) {
  Combine c(0);
  for (int i = 0; i < 2000; ++i) {
    push_precise(c, i);
    c.push_stamped(i, static_cast<std::uint64_t>(i) * step);
    expect_unit(c, -1);
  }
  EXPECT_GE(c.stat("unused"), 2000u - 10 * 25 - 2); // ten seconds of them may wait
}

// Units of both forms in one stream, and a nested one that was damaged on its way.
TEST(TerrainCombine, ReadsBothFormsOfAUnit) {
  Combine c(5000);
  Bus bus(c.video.get());
  KlvEncoder encoder;
  const UasPlatform platform = {90, UasAttitude{-5, 2}, UasPosition{52.5, 13.4, 34}};
  for (int i = 0; i < 6; ++i) {
    const OwnedEstimate o = some(static_cast<unsigned>(i));
    const auto bytes = encoder.encode(o.estimate, 0, i % 2 ? &platform : nullptr);
    c.push_bytes({bytes.begin(), bytes.end()}, i);
    EXPECT_EQ(c.push_frame(i), GST_FLOW_OK);
    const auto out = c.pull();
    const EstimateReader reader(out.get());
    ASSERT_TRUE(reader) << i << (reader.error() ? reader.error() : "");
    expect_same(reader.estimate(), o.estimate);
  }
  const OwnedEstimate o = some(6);
  const auto bytes = encoder.encode(o.estimate, 0, &platform);
  std::vector<std::uint8_t> damaged(bytes.begin(), bytes.end());
  damaged[30] ^= 1;
  c.push_bytes(damaged, 6);
  EXPECT_EQ(c.stat("matched"), 6u);
  EXPECT_EQ(c.stat("rejected"), 1u);
  const std::string told = bus.text(GST_MESSAGE_WARNING);
  EXPECT_NE(told.find("UAS Datalink"), std::string::npos) << told;
}

// From one element to the other: every frame has its metadata.
TEST(TerrainCombine, NestedUnitsThroughAPipeline) {
  GError* error = nullptr;
  const Owned<GstElement> pipeline(
      gst_parse_launch("videotestsrc num-buffers=20 ! "
                       "video/x-raw,format=I420,width=160,height=120,framerate=25/1 ! terrainseg ! "
                       "tee name=t t. ! queue ! jpegenc ! jpegdec ! c.sink "
                       "t. ! queue ! terrainextract klv-form=uas-datalink klv-position=52.5,13.4,34,90 ! "
                       "meta/x-klv,parsed=true ! "
                       "queue ! c.meta "
                       "terraincombine name=c latency=10000 ! fakesink name=out",
                       &error));
  ASSERT_EQ(error, nullptr) << error->message;
  const Owned<GstElement> combine(gst_bin_get_by_name(GST_BIN(pipeline.get()), "c"));
  gst_element_set_state(pipeline.get(), GST_STATE_PLAYING);
  const Owned<GstBus> bus(gst_element_get_bus(pipeline.get()));
  const Owned<GstMessage> end(gst_bus_timed_pop_filtered(
      bus.get(), 30 * GST_SECOND, static_cast<GstMessageType>(GST_MESSAGE_EOS | GST_MESSAGE_ERROR)));
  ASSERT_TRUE(end);
  EXPECT_EQ(GST_MESSAGE_TYPE(end.get()), GST_MESSAGE_EOS);
  GstStructure* stats = nullptr;
  g_object_get(combine.get(), "stats", &stats, nullptr);
  guint64 matched = 0, rejected = 1;
  gst_structure_get_uint64(stats, "matched", &matched);
  gst_structure_get_uint64(stats, "rejected", &rejected);
  gst_structure_free(stats);
  EXPECT_EQ(matched, 20u);
  EXPECT_EQ(rejected, 0u);
  gst_element_set_state(pipeline.get(), GST_STATE_NULL);
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

// Elements are stopped from the sink on, pads at the output first: what upstream sends meanwhile is no error.
TEST(TerrainCombine, WhileItIsStoppedNothingIsAnError) {
  for (const char* name : {"terraincombine", "terrainextract"}) {
    const Owned<GstElement> element(
        GST_ELEMENT(gst_object_ref_sink(gst_element_factory_make(name, nullptr))));
    const Owned<GstHarness> h(gst_harness_new_with_element(element.get(), "sink", "src"));
    gst_harness_set_src_caps_str(h.get(), raw_caps);
    const Owned<GstPad> source(gst_element_get_static_pad(element.get(), "src"));
    ASSERT_TRUE(gst_pad_set_active(source.get(), FALSE));
    gst_harness_push_event(h.get(), gst_event_new_stream_start("another"));
    gst_harness_set_src_caps_str(h.get(), "video/x-raw,format=I420,width=64,height=48,framerate=24/1");
    EXPECT_EQ(gst_harness_push(h.get(), frame(raw_size, 0).release()), GST_FLOW_FLUSHING) << name;
    gst_pad_set_active(source.get(), TRUE);
  }
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

// Nobody's clock runs: stalls on either side, longer than the latency, change nothing.
/// No position has a running time there, and to ask GStreamer for one is fatal in these tests.
TEST(TerrainCombine, BackwardsFromNoStop) {
  Combine c(0);
  for (GstHarness* h : {c.video.get(), c.meta.get()}) {
    GstSegment segment;
    gst_segment_init(&segment, GST_FORMAT_TIME);
    segment.rate = -1;
    gst_harness_push_event(h, gst_event_new_segment(&segment));
  }
  c.push_unit(some(1).estimate, 1);
  EXPECT_EQ(c.push_frame(1), GST_FLOW_OK);
  c.expect(1, false);
}

TEST(TerrainCombine, NotLiveTheDataAloneDecide) {
  FileCombine c(50);
  constexpr int frames = 60;
  std::thread units([&] {
    for (int i = 0; i < frames; ++i) {
      if (i % 25 == 5)
        std::this_thread::sleep_for(milliseconds(300));
      if (i % 10 == 3)
        gst_harness_push_event(c.meta.get(), gst_event_new_gap(i * frame_time, frame_time));
      else
        c.push_unit(some(static_cast<unsigned>(i)).estimate, i);
    }
    gst_harness_push_event(c.meta.get(), gst_event_new_eos());
  });
  std::thread video([&] {
    for (int i = 0; i < frames; ++i) {
      if (i % 20 == 15)
        std::this_thread::sleep_for(milliseconds(120));
      EXPECT_EQ(c.push_frame(i), GST_FLOW_OK);
    }
  });
  for (int i = 0; i < frames; ++i)
    c.expect(i, i % 10 != 3);
  units.join();
  video.join();
  EXPECT_EQ(c.stat("matched"), 54u);
  EXPECT_EQ(c.stat("lost"), 6u);
}

// One thread feeds both pads and the units come after more video than the queue holds: waiting would be for
// ever. What is lost follows from the order of the pushes alone.
TEST(TerrainCombine, OneThreadForBothPadsNeverWaitsForItself) {
  std::string first;
  for (int trial = 0; trial < 3; ++trial) {
    FileCombine c(200); // five frames
    const auto before = SteadyClock::now();
    std::string seen;
    for (int i = 0; i < 40; ++i) {
      if (i >= 10)
        c.push_unit(some(static_cast<unsigned>(i)).estimate, i - 10);
      EXPECT_EQ(c.push_frame(i), GST_FLOW_OK);
      if (i == 0)
        c.push_unit(some(0).estimate, 0);
    }
    gst_harness_push_event(c.meta.get(), gst_event_new_eos());
    for (int i = 0; i < 40; ++i) {
      const auto out = c.pull();
      ASSERT_TRUE(out);
      seen += EstimateReader(out.get()) ? '1' : '0';
    }
    EXPECT_LT(SteadyClock::now() - before, milliseconds(3000));
    if (trial == 0)
      first = seen;
    EXPECT_EQ(seen, first);
    EXPECT_EQ(seen[0], '1');
  }
}

// As a tee with allow-not-linked: unlinked for a while, then linked again.
TEST(TerrainCombine, GoesOnWhenItIsLinkedAgain) {
  Combine c(0);
  const Owned<GstPad> src(gst_element_get_static_pad(c.video->element, "src"));
  const Owned<GstPad> peer(gst_pad_get_peer(src.get()));
  c.push_unit(some(1).estimate, 0);
  EXPECT_EQ(c.push_frame(0), GST_FLOW_OK);
  c.expect(0, true);
  ASSERT_TRUE(gst_pad_unlink(src.get(), peer.get()));
  GstFlowReturn flow = GST_FLOW_OK;
  for (int i = 1; i < 500 && flow == GST_FLOW_OK; ++i) {
    flow = c.push_frame(i);
    std::this_thread::sleep_for(milliseconds(1));
  }
  EXPECT_EQ(flow, GST_FLOW_NOT_LINKED);
  // What is sticky must reach whoever is linked next.
  gst_harness_set_src_caps_str(c.video.get(), "video/x-raw,format=I420,width=32,height=16,framerate=25/1");
  ASSERT_EQ(gst_pad_link(src.get(), peer.get()), GST_PAD_LINK_OK);
  c.push_unit(some(1).estimate, 600);
  EXPECT_EQ(c.push_frame(600, 32 * 16 * 3 / 2), GST_FLOW_OK);
  c.expect(600, true);
  const Owned<GstCaps> caps(gst_pad_get_current_caps(peer.get()));
  int width = 0;
  ASSERT_TRUE(caps && gst_structure_get_int(gst_caps_get_structure(caps.get(), 0), "width", &width));
  EXPECT_EQ(width, 32);
}

// The queue is bounded by time, not by a number of frames: units 3 s behind at 100 frames a second.
TEST(TerrainCombine, HoldsAsMuchVideoAsItsLatency) {
  Combine c(60000, "video/x-raw,format=I420,width=64,height=48,framerate=100/1");
  constexpr int frames = 300;
  std::atomic<int> pushed = 0;
  std::thread video([&] {
    for (int i = 0; i < frames; ++i, ++pushed) {
      GstBuffer* buffer = frame(raw_size, i).release();
      GST_BUFFER_PTS(buffer) = i * 10 * GST_MSECOND;
      GST_BUFFER_DURATION(buffer) = 10 * GST_MSECOND;
      EXPECT_EQ(gst_harness_push(c.video.get(), buffer), GST_FLOW_OK);
    }
  });
  for (int i = 0; i < 300 && pushed < frames; ++i)
    std::this_thread::sleep_for(milliseconds(10));
  EXPECT_EQ(pushed, frames) << "the camera's thread was held up";
  KlvEncoder encoder;
  for (int i = 0; i < frames; ++i) {
    const auto bytes = encoder.encode(some(1).estimate, 0);
    GstBuffer* unit = gst_buffer_new_memdup(bytes.data(), bytes.size());
    GST_BUFFER_PTS(unit) = i * 10 * GST_MSECOND;
    EXPECT_EQ(gst_harness_push(c.meta.get(), unit), GST_FLOW_OK);
  }
  video.join();
  for (int i = 0; i < frames; ++i)
    EXPECT_TRUE(c.pull());
  EXPECT_EQ(c.stat("matched"), static_cast<guint64>(frames));
}

// Time stamps that stand still hold as few frames as the rate allows, and gaps without end do not pile up.
TEST(TerrainCombine, WhatStandsStillDoesNotPileUp) {
  FileCombine c(200);
  std::atomic<int> pushed = 0, gaps = 0;
  std::thread video([&] {
    for (int i = 0; i < 100; ++i, ++pushed)
      if (c.push_frame(0) != GST_FLOW_OK)
        return;
  });
  std::this_thread::sleep_for(milliseconds(200));
  EXPECT_LE(pushed, 20);
  gst_harness_push_event(c.video.get(), gst_event_new_flush_start());
  video.join();
  gst_harness_push_event(c.video.get(), gst_event_new_flush_stop(TRUE));
  GstSegment segment;
  gst_segment_init(&segment, GST_FORMAT_TIME);
  gst_harness_push_event(c.video.get(), gst_event_new_segment(&segment));
  EXPECT_EQ(c.push_frame(7), GST_FLOW_OK); // waits for its unit
  std::thread silence([&] {
    for (int i = 0; i < 20000; ++i, ++gaps)
      if (!gst_harness_push_event(c.video.get(), gst_event_new_gap(0, 1)))
        return;
  });
  // Until they stand still, however busy the machine is.
  for (int waited = 0, before = -1; waited < 100 && (gaps < 1000 || gaps != before); ++waited) {
    before = gaps;
    std::this_thread::sleep_for(milliseconds(200));
  }
  EXPECT_LE(gaps, 5000);
  EXPECT_GE(gaps, 1000) << "they end before anything has piled up";
  gst_harness_push_event(c.video.get(), gst_event_new_flush_start());
  silence.join();
}

// 201 bytes that claim the largest mask: nothing is drawn until a frame takes it, and no frame takes it.
TEST(TerrainCombine, AMaskOutOfProportionIsRefused) {
  Combine c(60000);
  Bus bus(c.video.get());
  OwnedEstimate huge = blank(8192, 8192, 8192, 8192);
  c.push_unit(huge.estimate, 0);
  EXPECT_EQ(c.stat("rejected"), 0u);
  EXPECT_EQ(c.push_frame(0), GST_FLOW_OK);
  c.expect(0, false);
  EXPECT_EQ(c.stat("rejected"), 1u);
  EXPECT_EQ(c.stat("matched"), 0u);
  EXPECT_EQ(c.stat("lost"), 1u);
  EXPECT_NE(bus.text(GST_MESSAGE_WARNING).find("8192x8192"), std::string::npos);
  // A video scaled to a quarter keeps its masks.
  OwnedEstimate larger = blank(256, 192, 256, 192);
  c.push_unit(larger.estimate, 1);
  EXPECT_EQ(c.push_frame(1), GST_FLOW_OK);
  c.expect(1, true);
}

// What follows a unit in its buffer counts: 900 units with a megabyte behind each.
TEST(TerrainCombine, TrailingBytesCount) {
  Combine c(0);
  KlvEncoder encoder;
  const OwnedEstimate o = some(1);
  const auto bytes = encoder.encode(o.estimate, 0);
  std::vector<std::uint8_t> padded(bytes.begin(), bytes.end());
  padded.resize(1 << 20);
  for (int i = 0; i < 200; ++i)
    c.push_bytes(padded, i);
  EXPECT_GE(c.stat("unused"), 130u) << "at most 64 MiB are kept";
  EXPECT_EQ(c.push_frame(199), GST_FLOW_OK);
  c.expect(199, true);
}

TEST(TerrainCombine, ExtremeTimesMatchNothing) {
  Combine c(0);
  c.push_unit(some(1).estimate, 0);
  for (const GstClockTime pts :
       {G_MAXUINT64 - 1, GstClockTime{1} << 63, (GstClockTime{1} << 63) - 1, (GstClockTime{1} << 62) + 5}) {
    GstBuffer* extreme = frame(raw_size, 0).release();
    GST_BUFFER_PTS(extreme) = pts;
    GST_BUFFER_DURATION(extreme) = pts;
    EXPECT_EQ(gst_harness_push(c.video.get(), extreme), GST_FLOW_OK);
    const auto out = c.pull();
    ASSERT_TRUE(out);
    EXPECT_FALSE(EstimateReader(out.get())) << pts;
    GstBuffer* unit = gst_buffer_new_allocate(nullptr, 0, nullptr);
    KlvEncoder encoder;
    const OwnedEstimate o = some(2);
    const auto bytes = encoder.encode(o.estimate, G_MAXUINT64);
    gst_buffer_unref(unit);
    unit = gst_buffer_new_memdup(bytes.data(), bytes.size());
    GST_BUFFER_PTS(unit) = pts;
    GST_BUFFER_DTS(unit) = pts;
    EXPECT_EQ(gst_harness_push(c.meta.get(), unit), GST_FLOW_OK);
    gst_harness_push_event(c.meta.get(), gst_event_new_gap(pts, pts));
  }
  c.push_unit(some(3).estimate, 5);
  EXPECT_EQ(c.push_frame(5), GST_FLOW_OK);
  c.expect(5, true);
}

// "ffmpeg -c copy" loses the PTS of KLV, appsrc in bytes has none: the units' own times tell.
TEST(TerrainCombine, UnitsWithoutTimeStamps) {
  enum { by_time, by_frame, by_order };
  for (const int basis : {by_time, by_frame, by_order})
    for (const bool units_first : {false, true}) {
      FileCombine c(1000);
      Bus bus(c.video.get());
      if (basis == by_order) { // and in bytes
        GstSegment segment;
        gst_segment_init(&segment, GST_FORMAT_BYTES);
        gst_harness_push_event(c.meta.get(), gst_event_new_segment(&segment));
      }
      for (int i = 0; i < 20; ++i) {
        // One unit of twenty is lost on its way, but not where only the order tells.
        const bool sent = i != 7 || basis == by_order;
        OwnedEstimate o = some(static_cast<unsigned>(100 + i));
        if (basis == by_order)
          o.estimate.frame = 5;
        const auto unit = [&] {
          if (sent)
            push_timeless(c, o.estimate, basis == by_time ? 1700000000000000u + 40000u * i : 0);
        };
        if (units_first)
          unit();
        EXPECT_EQ(c.push_frame(1000 + i), GST_FLOW_OK);
        if (!units_first)
          unit();
      }
      gst_harness_push_event(c.meta.get(), gst_event_new_eos());
      for (int i = 0; i < 20; ++i) {
        const auto out = c.pull();
        const EstimateReader reader(out.get());
        const bool sent = i != 7 || basis == by_order;
        ASSERT_EQ(static_cast<bool>(reader), sent) << i << " basis " << basis << units_first;
        if (sent && basis != by_order) {
          EXPECT_EQ(reader.estimate().frame, static_cast<std::uint64_t>(100 + i));
        }
      }
      EXPECT_NE(bus.text(GST_MESSAGE_WARNING).find("no time stamps"), std::string::npos);
      EXPECT_EQ(bus.text(GST_MESSAGE_WARNING), "") << "once";
    }
}

TEST(TerrainCombine, SaysOnceWhyNothingMatches) {
  const auto told = [](Combine& c, GstClockTimeDiff offset, bool units, bool gaps = false) {
    Bus bus(c.video.get());
    std::string all;
    for (int i = 0; i < 150; ++i) {
      if (units)
        c.push_unit(some(1).estimate, i + 1000, offset);
      if (gaps) // not live, nothing else says that the unit of this frame cannot come any more
        gst_harness_push_event(c.meta.get(), gst_event_new_gap((i + 1000) * frame_time, 2 * frame_time));
      EXPECT_EQ(c.push_frame(i + 1000), GST_FLOW_OK);
      c.expect(i + 1000, false);
    }
    for (std::string text = bus.text(GST_MESSAGE_WARNING); !text.empty();
         text = bus.text(GST_MESSAGE_WARNING))
      all += text + "\n";
    EXPECT_EQ(std::count(all.begin(), all.end(), '\n'), 1) << all;
    return all;
  };
  Combine late(0);
  EXPECT_NE(told(late, -GstClockTimeDiff{400 * GST_MSECOND}, true).find("set latency to 400"),
            std::string::npos);
  Combine none(0);
  EXPECT_NE(told(none, 0, false).find("no KLV unit"), std::string::npos);
  Combine ahead(0);
  EXPECT_NE(told(ahead, GstClockTimeDiff{10 * GST_SECOND}, true).find("10.000 s after"), std::string::npos);
  FileCombine before(0);
  EXPECT_NE(told(before, -GstClockTimeDiff{600 * GST_MSECOND}, true, true).find("0.600 s before"),
            std::string::npos);
}

TEST(TerrainCombine, LatencyEventsReachBothSources) {
  Combine c(100);
  ASSERT_TRUE(gst_harness_push_upstream_event(c.video.get(), gst_event_new_latency(77 * GST_MSECOND)));
  for (GstHarness* h : {c.video.get(), c.meta.get()}) {
    GstClockTime latency = 0;
    while (GstEvent* event = gst_harness_try_pull_upstream_event(h)) {
      if (GST_EVENT_TYPE(event) == GST_EVENT_LATENCY)
        gst_event_parse_latency(event, &latency);
      gst_event_unref(event);
    }
    EXPECT_EQ(latency, 77 * GST_MSECOND);
  }
}

// A camera with three buffers of its own must know of those that wait here.
TEST(TerrainCombine, HeldFramesAreAnnounced) {
  Combine c(200);
  gst_harness_set_propose_allocator(c.video.get(), nullptr, nullptr);
  const Owned<GstCaps> caps(gst_caps_from_string(raw_caps));
  const Owned<GstPad> sink(gst_element_get_static_pad(c.video->element, "sink"));
  for (const bool with_pool : {false, true}) {
    const Owned<GstPad> src(gst_element_get_static_pad(c.video->element, "src"));
    const Owned<GstPad> peer(gst_pad_get_peer(src.get()));
    if (with_pool)
      gst_pad_set_query_function(peer.get(), [](GstPad* pad, GstObject* parent, GstQuery* query) -> gboolean {
        if (GST_QUERY_TYPE(query) != GST_QUERY_ALLOCATION)
          return gst_pad_query_default(pad, parent, query);
        gst_query_add_allocation_pool(query, nullptr, 4608, 2, 3);
        return TRUE;
      });
    GstQuery* query = gst_query_new_allocation(caps.get(), TRUE);
    ASSERT_TRUE(gst_pad_query(sink.get(), query));
    ASSERT_EQ(gst_query_get_n_allocation_pools(query), 1u);
    guint size = 0, least = 0, most = 0;
    gst_query_parse_nth_allocation_pool(query, 0, nullptr, &size, &least, &most);
    EXPECT_EQ(size, raw_size);
    EXPECT_EQ(least, with_pool ? 9u : 7u) << "200 ms at 25 frames a second, and two on their way";
    EXPECT_EQ(most, with_pool ? 10u : 0u);
    gst_query_unref(query);
  }
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

// Upstream is asked when a stream begins, not at every frame. Whether its latencies fit is for the pipeline
// to tell.
TEST(TerrainCombine, UpstreamIsAskedForItsLatencyOnce) {
  static std::atomic<int> asked;
  asked = 0;
  Combine c(200);
  gst_pad_set_query_function(c.video->srcpad,
                             [](GstPad* pad, GstObject* parent, GstQuery* query) -> gboolean {
                               if (GST_QUERY_TYPE(query) != GST_QUERY_LATENCY)
                                 return gst_pad_query_default(pad, parent, query);
                               ++asked;
                               gst_query_set_latency(query, TRUE, 100 * GST_MSECOND, 10 * GST_MSECOND);
                               return TRUE;
                             });
  Bus bus(c.video.get());
  for (int i = 0; i < 10; ++i) {
    c.push_unit(some(1).estimate, i);
    EXPECT_EQ(c.push_frame(i), GST_FLOW_OK);
    c.expect(i, true);
  }
  EXPECT_EQ(asked, 1);
  EXPECT_EQ(bus.text(GST_MESSAGE_WARNING), "");
}

// The video's own id and segment go on, also those of a stream after an end.
TEST(TerrainCombine, AStreamAfterAnEnd) {
  FileCombine c(200);
  for (int run = 0; run < 3; ++run) {
    const std::string id = "run " + std::to_string(run);
    GstSegment segment;
    gst_segment_init(&segment, GST_FORMAT_TIME);
    segment.base = static_cast<guint64>(run) * GST_SECOND;
    EXPECT_TRUE(gst_harness_push_event(c.video.get(), gst_event_new_stream_start(id.c_str())));
    EXPECT_TRUE(gst_harness_push_event(c.video.get(), gst_event_new_segment(&segment)));
    EXPECT_TRUE(gst_harness_push_event(c.meta.get(), gst_event_new_stream_start("units")));
    EXPECT_TRUE(gst_harness_push_event(c.meta.get(), gst_event_new_segment(&segment)));
    c.push_unit(some(1).estimate, run);
    EXPECT_EQ(c.push_frame(run), GST_FLOW_OK);
    c.expect(run, true);
    const Owned<GstEvent> start(gst_pad_get_sticky_event(c.video->sinkpad, GST_EVENT_STREAM_START, 0)),
        seen(gst_pad_get_sticky_event(c.video->sinkpad, GST_EVENT_SEGMENT, 0));
    ASSERT_TRUE(start && seen);
    const char* told = nullptr;
    gst_event_parse_stream_start(start.get(), &told);
    EXPECT_EQ(told, id);
    const GstSegment* kept = nullptr;
    gst_event_parse_segment(seen.get(), &kept);
    EXPECT_EQ(kept->base, segment.base);
    gst_harness_push_event(c.video.get(), gst_event_new_eos());
    gst_harness_push_event(c.meta.get(), gst_event_new_eos());
    while (!GST_PAD_IS_EOS(c.video->sinkpad))
      std::this_thread::sleep_for(milliseconds(1));
  }
  EXPECT_EQ(c.stat("matched"), 3u);
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
