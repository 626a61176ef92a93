// SPDX-License-Identifier: LGPL-2.1-or-later
// The scene as a source: negotiation, the truth as metadata, time, seeking, live behaviour.
#include <gst/check/gstharness.h>
#include <gst/check/gsttestclock.h>
#include <gst/terrainseg/terrainsegmeta.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <memory>
#include <string>

#include "harness.hpp"
#include "scene/scene.hpp"
#include "support/video_frame.hpp"

namespace {

using namespace terrainseg;

using Buffer = test::Owned<GstBuffer>;
using Harness = test::Owned<GstHarness>;

constexpr guint64 frame_time(guint64 n, int rate = 30) {
  return n * GST_SECOND / static_cast<guint64>(rate);
}

Harness source(const char* caps, const char* first_property = nullptr, int value = 0) {
  Harness h(gst_harness_new("terrainscenesrc"));
  if (first_property)
    g_object_set(h->element, first_property, value, nullptr);
  gst_harness_set_sink_caps_str(h.get(), caps);
  return h;
}

Buffer pull(const Harness& h) {
  return Buffer(gst_harness_pull(h.get()));
}

constexpr const char* small = "video/x-raw,format=I420,width=96,height=54,framerate=30/1";

/// What the renderer itself draws, to compare with.
struct Expected {
  scene::Picture picture;
  Expected(const scene::Settings& settings, guint64 number, const GstVideoInfo& info)
      : picture(*pixel_format_of(GST_VIDEO_INFO_FORMAT(&info)), GST_VIDEO_INFO_WIDTH(&info),
                GST_VIDEO_INFO_HEIGHT(&info), colorimetry_of(info)) {
    scene::Renderer(settings, GST_VIDEO_INFO_WIDTH(&info), GST_VIDEO_INFO_HEIGHT(&info))
        .render(number, picture);
  }
};

GstVideoInfo info_of(const Harness& h) {
  GstCaps* caps = gst_pad_get_current_caps(h->sinkpad);
  GstVideoInfo info;
  gst_video_info_init(&info);
  if (caps) {
    gst_video_info_from_caps(&info, caps);
    gst_caps_unref(caps);
  }
  return info;
}

void expect_frame(const Harness& h, GstBuffer* buffer, const scene::Settings& settings, guint64 number) {
  const GstVideoInfo info = info_of(h);
  const Expected expected(settings, number, info);
  const MappedFrame mapped(info, buffer, GST_MAP_READ);
  ASSERT_TRUE(mapped);
  const Frame got = mapped.view(), wanted = expected.picture.frame();
  for (const ComponentLayout& l : layout_of(got.format).parts())
    for (int y = 0; y < subsampled(got.height, l.y_shift); ++y)
      for (int x = 0; x < subsampled(got.width, l.x_shift); ++x)
        for (int byte = 0; byte < layout_of(got.format).sample_bytes(); ++byte)
          ASSERT_EQ(got.planes[l.plane].row(y)[l.offset + x * l.step + byte],
                    wanted.planes[l.plane].row(y)[l.offset + x * l.step + byte])
              << gst_video_format_to_string(GST_VIDEO_INFO_FORMAT(&info)) << " at " << x << "," << y;
  GstCustomMeta* meta = gst_buffer_get_custom_meta(buffer, GST_TERRAIN_TRUTH_META_NAME);
  ASSERT_NE(meta, nullptr);
  const GstStructure* truth = gst_custom_meta_get_structure(meta);
  int horizon = -2;
  ASSERT_TRUE(gst_structure_get_int(truth, "horizon-row", &horizon));
  EXPECT_EQ(horizon, expected.picture.horizon_row());
  const auto truth_of = [&](const char* field) {
    double found = std::numeric_limits<double>::quiet_NaN();
    EXPECT_TRUE(gst_structure_get_double(truth, field, &found)) << field;
    return found;
  };
  // Where rays of that camera run level in the middle column, by the formula for a pinhole that is rolled.
  const double level = truth_of("center-y") -
                       truth_of("focal-length") * std::tan(truth_of("pitch")) / std::cos(truth_of("roll"));
  EXPECT_NEAR(horizon, level, 0.51);
  EXPECT_EQ(truth_of("center-x"), (got.width - 1) * 0.5);
  EXPECT_GT(truth_of("camera-height"), 0.1);
  EXPECT_LT(truth_of("camera-height"), 3);
  const GValue* value = gst_structure_get_value(truth, "labels");
  ASSERT_TRUE(value && G_VALUE_HOLDS(value, GST_TYPE_BUFFER));
  GstBuffer* labels = gst_value_get_buffer(value);
  const GstVideoMeta* layout = gst_buffer_get_video_meta(labels);
  ASSERT_NE(layout, nullptr);
  EXPECT_EQ(layout->format, GST_VIDEO_FORMAT_GRAY8);
  ASSERT_EQ(layout->width, static_cast<guint>(got.width));
  ASSERT_EQ(layout->height, static_cast<guint>(got.height));
  GstMapInfo map;
  ASSERT_TRUE(gst_buffer_map(labels, &map, GST_MAP_READ));
  for (int y = 0; y < got.height; ++y)
    for (int x = 0; x < got.width; ++x)
      EXPECT_EQ(map.data[layout->offset[0] + static_cast<gsize>(y) * layout->stride[0] + x],
                expected.picture.labels().plane.row(y)[x]);
  gst_buffer_unmap(labels, &map);
}

TEST(TerrainSceneSrc, DefaultCaps) {
  const Harness h = source("video/x-raw");
  g_object_set(h->element, "num-buffers", 1, nullptr);
  gst_harness_play(h.get());
  const Buffer buffer = pull(h);
  ASSERT_TRUE(buffer);
  const GstVideoInfo info = info_of(h);
  EXPECT_EQ(GST_VIDEO_INFO_FORMAT(&info), GST_VIDEO_FORMAT_I420);
  EXPECT_EQ(GST_VIDEO_INFO_WIDTH(&info), 640);
  EXPECT_EQ(GST_VIDEO_INFO_HEIGHT(&info), 360);
  EXPECT_EQ(GST_VIDEO_INFO_FPS_N(&info), 30);
  EXPECT_EQ(GST_VIDEO_INFO_FPS_D(&info), 1);
}

TEST(TerrainSceneSrc, EveryFormatWithItsTruth) {
  for (int f = 0; f < pixel_format_count; ++f) {
    const std::string caps = std::string("video/x-raw,width=75,height=43,framerate=25/1,format=") +
                             gst_video_format_to_string(test::gst_format_of(static_cast<PixelFormat>(f)));
    const Harness h = source(caps.c_str(), "num-buffers", 2);
    gst_util_set_object_arg(G_OBJECT(h->element), "scene", f % 2 ? "trail" : "plain");
    gst_harness_play(h.get());
    scene::Settings settings;
    settings.kind = f % 2 ? scene::Kind::trail : scene::Kind::plain;
    for (guint64 n = 0; n < 2; ++n) {
      const Buffer buffer = pull(h);
      ASSERT_TRUE(buffer);
      expect_frame(h, buffer.get(), settings, n);
      EXPECT_EQ(GST_BUFFER_PTS(buffer.get()), frame_time(n, 25));
    }
  }
}

TEST(TerrainSceneSrc, ColorimetryOfTheCaps) {
  const Harness h = source("video/x-raw,format=NV12,width=64,height=36,framerate=30/1,colorimetry=1:3:5:1",
                           "num-buffers", 1);
  gst_harness_play(h.get());
  const Buffer buffer = pull(h);
  EXPECT_EQ(colorimetry_of(info_of(h)), (Colorimetry{ColorRange::full, ColorMatrix::bt709}));
  expect_frame(h, buffer.get(), {}, 0);
}

TEST(TerrainSceneSrc, TimesNumbersAndEnd) {
  const Harness h =
      source("video/x-raw,format=I420,width=32,height=18,framerate=30000/1001", "num-buffers", 5);
  gst_harness_play(h.get());
  for (guint64 n = 0; n < 5; ++n) {
    const Buffer buffer = pull(h);
    ASSERT_TRUE(buffer);
    const guint64 pts = gst_util_uint64_scale(n, 1001 * GST_SECOND, 30000);
    EXPECT_EQ(GST_BUFFER_PTS(buffer.get()), pts);
    EXPECT_EQ(GST_BUFFER_DURATION(buffer.get()),
              gst_util_uint64_scale(n + 1, 1001 * GST_SECOND, 30000) - pts);
    EXPECT_EQ(GST_BUFFER_OFFSET(buffer.get()), n);
    EXPECT_EQ(GST_BUFFER_OFFSET_END(buffer.get()), n + 1);
  }
  GstEvent* event = nullptr;
  bool ended = false;
  for (int i = 0; i < 8 && !ended && (event = gst_harness_pull_event(h.get())); ++i) {
    ended = GST_EVENT_TYPE(event) == GST_EVENT_EOS;
    gst_event_unref(event);
  }
  EXPECT_TRUE(ended);
  gint64 duration = 0;
  ASSERT_TRUE(gst_element_query_duration(h->element, GST_FORMAT_DEFAULT, &duration));
  EXPECT_EQ(duration, 5);
}

TEST(TerrainSceneSrc, OnePictureWithoutFrameRate) {
  const Harness h = source("video/x-raw,format=RGB,width=20,height=12,framerate=0/1");
  gst_harness_play(h.get());
  const Buffer buffer = pull(h);
  ASSERT_TRUE(buffer);
  EXPECT_EQ(GST_BUFFER_PTS(buffer.get()), 0U);
  bool ended = false;
  while (GstEvent* event = gst_harness_pull_event(h.get())) {
    ended |= GST_EVENT_TYPE(event) == GST_EVENT_EOS;
    gst_event_unref(event);
    if (ended)
      break;
  }
  EXPECT_TRUE(ended);
}

/// Pulls until the first buffer after a flushing seek.
Buffer pull_after_seek(const Harness& h, GstEvent* seek) {
  while (GstEvent* old = gst_harness_try_pull_event(h.get()))
    gst_event_unref(old);
  EXPECT_TRUE(gst_harness_push_upstream_event(h.get(), seek));
  for (int i = 0; i < 500; ++i) {
    Buffer buffer = pull(h);
    if (!buffer || GST_BUFFER_IS_DISCONT(buffer.get()))
      return buffer;
  }
  return nullptr;
}

TEST(TerrainSceneSrc, SeeksToTimeAndFrame) {
  const Harness h = source(small);
  gst_harness_play(h.get());
  ASSERT_TRUE(pull(h));
  // Every position inside frame 211, its first and last nanosecond included, gives frame 211.
  for (const guint64 position : {frame_time(211), frame_time(211) + 1, frame_time(212) - 1}) {
    const Buffer buffer =
        pull_after_seek(h, gst_event_new_seek(1, GST_FORMAT_TIME, GST_SEEK_FLAG_FLUSH, GST_SEEK_TYPE_SET,
                                              static_cast<gint64>(position), GST_SEEK_TYPE_NONE, -1));
    ASSERT_TRUE(buffer);
    EXPECT_EQ(GST_BUFFER_OFFSET(buffer.get()), 211U);
    EXPECT_EQ(GST_BUFFER_PTS(buffer.get()), frame_time(211));
    expect_frame(h, buffer.get(), {}, 211);
  }
  for (const gint64 number : {1, 7, 100, 1000}) {
    const Buffer buffer =
        pull_after_seek(h, gst_event_new_seek(1, GST_FORMAT_DEFAULT, GST_SEEK_FLAG_FLUSH, GST_SEEK_TYPE_SET,
                                              number, GST_SEEK_TYPE_NONE, -1));
    ASSERT_TRUE(buffer);
    EXPECT_EQ(GST_BUFFER_OFFSET(buffer.get()), static_cast<guint64>(number));
  }
}

TEST(TerrainSceneSrc, PlaysBackwards) {
  const Harness h = source(small);
  gst_harness_play(h.get());
  ASSERT_TRUE(pull(h));
  Buffer buffer =
      pull_after_seek(h, gst_event_new_seek(-1, GST_FORMAT_TIME, GST_SEEK_FLAG_FLUSH, GST_SEEK_TYPE_SET, 0,
                                            GST_SEEK_TYPE_SET, static_cast<gint64>(frame_time(4))));
  for (guint64 n = 3; n < 4; --n) {
    ASSERT_TRUE(buffer);
    EXPECT_EQ(GST_BUFFER_OFFSET(buffer.get()), n);
    if (n > 0)
      buffer = pull(h);
  }
  EXPECT_FALSE(gst_harness_push_upstream_event(
      h.get(), gst_event_new_seek(-1, GST_FORMAT_TIME, GST_SEEK_FLAG_FLUSH, GST_SEEK_TYPE_SET, 0,
                                  GST_SEEK_TYPE_SET, -1)));
}

TEST(TerrainSceneSrc, PropertiesTakeEffectWhilePlaying) {
  const Harness h = source(small);
  gst_harness_play(h.get());
  ASSERT_TRUE(pull(h));
  g_object_set(h->element, "seed", 9U, "obstacles", 100, "wet", TRUE, nullptr);
  gst_util_set_object_arg(G_OBJECT(h->element), "scene", "corridor");
  gst_util_set_object_arg(G_OBJECT(h->element), "light", "sun");
  gst_util_set_object_arg(G_OBJECT(h->element), "motion", "bumpy");
  scene::Settings settings;
  settings.kind = scene::Kind::corridor;
  settings.light = scene::Light::sun;
  settings.wet = true;
  settings.motion = scene::Motion::bumpy;
  settings.seed = 9;
  settings.obstacles = 100;
  Buffer buffer = pull_after_seek(h, gst_event_new_seek(1, GST_FORMAT_DEFAULT, GST_SEEK_FLAG_FLUSH,
                                                        GST_SEEK_TYPE_SET, 40, GST_SEEK_TYPE_NONE, -1));
  ASSERT_TRUE(buffer);
  expect_frame(h, buffer.get(), settings, 40);
  guint seed = 0;
  int obstacles = 0, motion = 0;
  g_object_get(h->element, "seed", &seed, "obstacles", &obstacles, "motion", &motion, nullptr);
  EXPECT_EQ(seed, 9U);
  EXPECT_EQ(obstacles, 100);
  gboolean wet = FALSE;
  g_object_get(h->element, "wet", &wet, nullptr);
  EXPECT_TRUE(wet);
  EXPECT_EQ(motion, static_cast<int>(scene::Motion::bumpy));
}

TEST(TerrainSceneSrc, LiveFramesComeByTheClock) {
  const Harness h = source(small, "is-live", TRUE);
  gst_harness_use_systemclock(h.get());
  gst_harness_play(h.get());
  ASSERT_TRUE(pull(h));
  const gint64 start = g_get_monotonic_time();
  guint64 first = 0, last = 0;
  for (int n = 0; n < 6; ++n) {
    const Buffer buffer = pull(h);
    ASSERT_TRUE(buffer);
    (n ? last : first) = GST_BUFFER_PTS(buffer.get());
  }
  // The first of the six may be waiting already.
  EXPECT_GE(g_get_monotonic_time() - start, 4 * 33000);
  EXPECT_GE(last - first, frame_time(5) - 5);
  gboolean live = FALSE;
  GstQuery* query = gst_query_new_latency();
  ASSERT_TRUE(gst_pad_peer_query(h->sinkpad, query));
  gst_query_parse_latency(query, &live, nullptr, nullptr);
  gst_query_unref(query);
  EXPECT_TRUE(live);
  query = gst_query_new_seeking(GST_FORMAT_TIME);
  gboolean seekable = TRUE;
  if (gst_pad_peer_query(h->sinkpad, query))
    gst_query_parse_seeking(query, nullptr, &seekable, nullptr, nullptr);
  gst_query_unref(query);
  EXPECT_FALSE(seekable);
}

/// What SOURCE answers while it plays: whether it is live, and its least and most latency.
struct Latency {
  gboolean live = FALSE;
  GstClockTime least = 0, most = 0;
  bool operator==(const Latency&) const = default;
};

Latency latency_of(const std::string& source, const char* rate) {
  const auto pipeline = test::make_element(
      source + " name=source ! video/x-raw,format=I420,width=96,height=54,framerate=" + rate +
      " ! fakesink sync=true");
  gst_element_set_state(pipeline.get(), GST_STATE_PLAYING);
  EXPECT_EQ(gst_element_get_state(pipeline.get(), nullptr, nullptr, 10 * GST_SECOND),
            GST_STATE_CHANGE_SUCCESS);
  const test::Owned<GstElement> element(gst_bin_get_by_name(GST_BIN(pipeline.get()), "source"));
  Latency answer;
  GstQuery* query = gst_query_new_latency();
  EXPECT_TRUE(gst_element_query(element.get(), query));
  gst_query_parse_latency(query, &answer.live, &answer.least, &answer.most);
  gst_query_unref(query);
  return answer;
}

TEST(TerrainSceneSrc, ItsLatencyIsAFrameAsOfOtherCameras) {
  for (const char* rate : {"30/1", "25/1", "30000/1001", "2/1"}) {
    const Latency live = latency_of("terrainscenesrc is-live=true", rate);
    EXPECT_TRUE(live.live) << rate;
    EXPECT_EQ(live, latency_of("videotestsrc is-live=true", rate)) << rate;
    EXPECT_FALSE(latency_of("terrainscenesrc", rate).live) << rate;
  }
  EXPECT_EQ(latency_of("terrainscenesrc is-live=true", "25/1").least, 40 * GST_MSECOND);
}

TEST(TerrainSceneSrc, MoreFramesThanNanosecondsLive) {
  for (const char* rate : {"2000000000/1", "2147483647/1", "1000000000/1", "1/2147483647"}) {
    const auto pipeline = test::make_element(
        "terrainscenesrc is-live=true num-buffers=4 ! video/x-raw,format=I420,width=32,height=18,framerate=" +
        std::string(rate) + " ! fakesink sync=false");
    if (std::string(rate) != "1/2147483647") {
      EXPECT_EQ(test::run_pipeline(pipeline.get()), "") << rate;
    } else { // the second frame is due in 68 years
      EXPECT_EQ(test::run_pipeline(pipeline.get(), GST_SECOND / 2), "timeout") << rate;
    }
  }
}

/// The next frame under the harness's own clock, which stands until it is told to go on.
Buffer pull_by_test_clock(const Harness& h) {
  for (int i = 0; i < 2000; ++i) {
    if (GstBuffer* buffer = gst_harness_try_pull(h.get()))
      return Buffer(buffer);
    GstTestClock* clock = gst_harness_get_testclock(h.get());
    if (gst_test_clock_peek_id_count(clock) > 0)
      gst_test_clock_crank(clock);
    else
      g_usleep(1000);
    gst_object_unref(clock);
  }
  return nullptr;
}

TEST(TerrainSceneSrc, ALateCameraLosesFrames) {
  const Harness h = source(small, "is-live", TRUE);
  gst_harness_play(h.get());
  guint64 before = 0;
  for (guint64 n = 0; n < 4; ++n) {
    const Buffer buffer = pull_by_test_clock(h);
    ASSERT_TRUE(buffer);
    EXPECT_EQ(GST_BUFFER_OFFSET(buffer.get()), n);
    before = GST_BUFFER_PTS(buffer.get());
  }
  // Somebody holds the camera up for a second. Frame 4 is rendered already and waits for its time.
  ASSERT_TRUE(gst_harness_wait_for_clock_id_waits(h.get(), 1, 10));
  GstTestClock* clock = gst_harness_get_testclock(h.get());
  gst_test_clock_advance_time(clock, GST_SECOND);
  gst_object_unref(clock);
  Buffer buffer = pull_by_test_clock(h);
  ASSERT_TRUE(buffer);
  EXPECT_EQ(GST_BUFFER_OFFSET(buffer.get()), 4U);
  buffer = pull_by_test_clock(h);
  ASSERT_TRUE(buffer);
  const guint64 number = GST_BUFFER_OFFSET(buffer.get());
  EXPECT_GE(number, 30U);
  EXPECT_LE(number, 36U);
  EXPECT_TRUE(GST_BUFFER_IS_DISCONT(buffer.get()));
  EXPECT_NEAR(static_cast<double>(GST_BUFFER_PTS(buffer.get()) - before),
              static_cast<double>(frame_time(number - 3)), 5);
  buffer = pull_by_test_clock(h);
  ASSERT_TRUE(buffer);
  EXPECT_EQ(GST_BUFFER_OFFSET(buffer.get()), number + 1);
  EXPECT_FALSE(GST_BUFFER_IS_DISCONT(buffer.get()));
}

TEST(TerrainSceneSrc, RefusesWhatItCannotRender) {
  for (const char* caps :
       {"video/x-raw,format=A420,width=64,height=36", "video/x-raw,format=Y444_10LE",
        "video/x-raw,format=I420,width=64,height=36,framerate=30/1,interlace-mode=interleaved"}) {
    const Harness h = source(caps);
    GstBus* bus = gst_bus_new();
    gst_element_set_bus(h->element, bus);
    gst_harness_play(h.get());
    const test::Owned<GstMessage> message(
        gst_bus_timed_pop_filtered(bus, 10 * GST_SECOND, GST_MESSAGE_ERROR));
    EXPECT_TRUE(message) << caps;
    gst_element_set_bus(h->element, nullptr);
    gst_object_unref(bus);
  }
}

} // namespace
