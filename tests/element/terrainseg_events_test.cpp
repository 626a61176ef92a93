// SPDX-License-Identifier: LGPL-2.1-or-later
// terrainseg over time: what makes it learn, keep and forget.
#include <gst/terrainseg/terrainsegmeta.h>

#include "harness.hpp"

namespace terrainseg::test {
namespace {

const std::string caps = caps_text("I420", 160, 120);

guint generation_of(GstBuffer* buffer) {
  return EstimateReader(buffer).estimate().model_generation;
}
std::uint32_t flags_of(GstBuffer* buffer) {
  return EstimateReader(buffer).estimate().flags;
}

/// A rig whose learned terrain can be recognised: learning is frozen after it, so that a forgotten terrain
/// shows as unknown.
class Learned : public Rig {
 public:
  explicit Learned(const std::string& more = "") : Rig("terrainseg name=seg " + more, caps) {
    generation_after(5);
    g_object_set(element(), "learning", FALSE, nullptr);
  }
  bool knows() { return !(flags_of(step().get()) & flag_unknown); }
  void send_flush() {
    EXPECT_TRUE(gst_harness_push_event(harness(), gst_event_new_flush_start()));
    EXPECT_TRUE(gst_harness_push_event(harness(), gst_event_new_flush_stop(TRUE)));
    GstSegment segment;
    gst_segment_init(&segment, GST_FORMAT_TIME);
    EXPECT_TRUE(gst_harness_push_event(harness(), gst_event_new_segment(&segment)));
  }
  void send_rate(double rate, double applied_rate = 1) {
    GstSegment segment;
    gst_segment_init(&segment, GST_FORMAT_TIME);
    segment.rate = rate;
    segment.applied_rate = applied_rate;
    segment.stop = 100 * GST_SECOND;
    EXPECT_TRUE(gst_harness_push_event(harness(), gst_event_new_segment(&segment)));
  }
};

TEST(Events, KnowsAfterLearning) {
  Learned rig;
  EXPECT_TRUE(rig.knows());
}

TEST(Events, ABareDiscontinuityResetsNothing) {
  Learned rig;
  EXPECT_FALSE(flags_of(rig.step(GST_BUFFER_FLAG_DISCONT).get()) & flag_unknown);
}

TEST(Events, ResetOnDiscont) {
  Learned rig("reset-on=discont");
  EXPECT_TRUE(rig.knows());
  EXPECT_TRUE(flags_of(rig.step(GST_BUFFER_FLAG_DISCONT).get()) & flag_unknown);
}

TEST(Events, AFlushKeepsTheTerrain) {
  Learned rig;
  rig.send_flush();
  EXPECT_TRUE(rig.knows());
}

TEST(Events, ASeekInAPipelineKeepsTheTerrain) {
  auto pipeline =
      make_element("videotestsrc num-buffers=400 ! " + caps + " ! terrainseg name=seg ! fakesink sync=false");
  Owned<GstElement> seg(gst_bin_get_by_name(GST_BIN(pipeline.get()), "seg"));
  gst_element_set_state(pipeline.get(), GST_STATE_PAUSED);
  ASSERT_EQ(gst_element_get_state(pipeline.get(), nullptr, nullptr, patient(5 * GST_SECOND)),
            GST_STATE_CHANGE_SUCCESS);
  const auto generation = [&] {
    GstStructure* stats = nullptr;
    guint value = 0;
    g_object_get(seg.get(), "stats", &stats, nullptr);
    gst_structure_get_uint(stats, "generation", &value);
    gst_structure_free(stats);
    return value;
  };
  const guint before = generation();
  for (int i = 1; i <= 3; ++i) {
    ASSERT_TRUE(
        gst_element_seek_simple(pipeline.get(), GST_FORMAT_TIME, GST_SEEK_FLAG_FLUSH, i * GST_SECOND));
    ASSERT_EQ(gst_element_get_state(pipeline.get(), nullptr, nullptr, patient(5 * GST_SECOND)),
              GST_STATE_CHANGE_SUCCESS);
  }
  EXPECT_GT(generation(), before); // goes on counting
  EXPECT_EQ(run_pipeline(pipeline.get()), "");
}

TEST(Events, ANewStreamForgetsAndTheSameStreamDoesNot) {
  Learned rig;
  gst_harness_push_event(rig.harness(), gst_event_new_stream_start("one"));
  gst_harness_set_src_caps(rig.harness(), gst_caps_from_string(caps.c_str()));
  g_object_set(rig.element(), "learning", TRUE, nullptr);
  rig.generation_after(3);
  g_object_set(rig.element(), "learning", FALSE, nullptr);
  gst_harness_push_event(rig.harness(), gst_event_new_stream_start("one"));
  gst_harness_set_src_caps(rig.harness(), gst_caps_from_string(caps.c_str()));
  EXPECT_TRUE(rig.knows());
  gst_harness_push_event(rig.harness(), gst_event_new_stream_start("two"));
  gst_harness_set_src_caps(rig.harness(), gst_caps_from_string(caps.c_str()));
  EXPECT_FALSE(rig.knows());
}

TEST(Events, ResetOnNever) {
  Learned rig("reset-on=never");
  gst_harness_push_event(rig.harness(), gst_event_new_stream_start("one"));
  gst_harness_push_event(rig.harness(), gst_event_new_stream_start("two"));
  gst_harness_set_src_caps(rig.harness(), gst_caps_from_string(caps.c_str()));
  EXPECT_TRUE(rig.knows());
}

/// What a stream knows of its ground, without learning more: the learned colours' masses.
class Streams : public Rig {
 public:
  explicit Streams(const std::string& more = "reset-on=per-stream") : Rig("terrainseg " + more) {}
  void enter(const std::string& id) {
    gst_harness_push_event(harness(), gst_event_new_stream_start(id.c_str()));
    set_caps(caps);
    GstSegment segment;
    gst_segment_init(&segment, GST_FORMAT_TIME);
    gst_harness_push_event(harness(), gst_event_new_segment(&segment));
  }
  void learn(const std::string& id, int frames) {
    enter(id);
    g_object_set(element(), "learning", TRUE, nullptr);
    generation_after(frames);
    g_object_set(element(), "learning", FALSE, nullptr);
  }
  std::uint64_t knows() {
    const auto out = step();
    const EstimateReader reader(out.get());
    std::uint64_t sum = 0;
    for (const ModelSummary& model : reader.estimate().models)
      sum += model.mass;
    return sum;
  }
  std::uint64_t knows_of(const std::string& id) {
    enter(id);
    return knows();
  }
};

TEST(PerStream, EachStreamHasItsOwnTerrain) {
  Streams rig;
  rig.learn("one", 3);
  const std::uint64_t one = rig.knows();
  rig.learn("two", 8);
  const std::uint64_t two = rig.knows();
  EXPECT_GT(one, 0u);
  EXPECT_NE(one, two) << "or the test tells nothing";
  for (int again = 0; again < 2; ++again) {
    EXPECT_EQ(rig.knows_of("one"), one);
    EXPECT_EQ(rig.knows_of("two"), two);
    EXPECT_EQ(rig.knows_of("three"), 0u) << "never seen";
  }
  // A stream that comes and goes without a frame loses nothing.
  rig.enter("one");
  EXPECT_EQ(rig.knows_of("two"), two);
  // Also when nothing but the stream's name changes: the caps may not come again.
  gst_harness_push_event(rig.harness(), gst_event_new_stream_start("one"));
  EXPECT_EQ(rig.knows(), one);
}

TEST(PerStream, ThroughNullUntilReset) {
  Streams rig;
  rig.learn("one", 3);
  const std::uint64_t one = rig.knows();
  rig.learn("two", 8);
  const std::uint64_t two = rig.knows();
  rig.restart(GST_STATE_NULL, caps); // as the stream "again"
  EXPECT_EQ(rig.knows(), 0u);
  EXPECT_EQ(rig.knows_of("two"), two);
  EXPECT_EQ(rig.knows_of("one"), one);
  g_signal_emit_by_name(rig.element(), "reset");
  EXPECT_EQ(rig.knows(), 0u);
  EXPECT_EQ(rig.knows_of("two"), 0u);
}

TEST(PerStream, TheOneLeftLongestAgoIsForgottenFirst) {
  Streams rig;
  const auto name = [](int i) { return "stream" + std::to_string(i); };
  for (int i = 0; i < 17; ++i)
    rig.learn(name(i), 1);              // leaves 0..15 kept and is in 16
  EXPECT_GT(rig.knows_of(name(0)), 0u); // keeps 1..16
  rig.learn(name(17), 1);               // keeps 2..16 and 0: 1 goes
  EXPECT_EQ(rig.knows_of(name(1)), 0u); // keeps 3..16, 0 and 17
  EXPECT_EQ(rig.knows_of(name(2)), 0u); // left without learning anything: not kept
  for (int i : {3, 16, 17, 0})
    EXPECT_GT(rig.knows_of(name(i)), 0u) << i;
}

TEST(Events, ReadyForgetsUnlessResetOnIsNever) {
  for (const bool never : {false, true}) {
    Learned rig(never ? "reset-on=never" : "");
    rig.restart(GST_STATE_READY, caps);
    EXPECT_EQ(rig.knows(), never);
  }
}

TEST(Events, TheResetSignalForgets) {
  Learned rig;
  g_signal_emit_by_name(rig.element(), "reset");
  EXPECT_FALSE(rig.knows());
}

TEST(Events, ACapsChangeKeepsTheTerrainOfTheDefaultPipeline) {
  Learned rig;
  for (const char* format : {"NV12", "RGB", "YUY2"}) {
    rig.set_caps(caps_text(format, 161, 121));
    EXPECT_TRUE(rig.knows()) << format;
  }
}

TEST(Events, ACapsChangeKeepsTheTerrainOfThePaperInTheSameColourSpaceOnly) {
  Learned rig("preset=paper");
  rig.set_caps(caps_text("I420", 320, 240, ",colorimetry=bt601"));
  rig.set_caps(caps_text("I420", 200, 100, ",colorimetry=bt601"));
  EXPECT_TRUE(rig.knows()); // another size
  rig.set_caps(caps_text("NV12", 161, 121, ",colorimetry=bt601"));
  EXPECT_TRUE(rig.knows()); // another layout of the same colours
  EXPECT_EQ(EstimateReader(rig.step().get()).estimate().mask.width, 161);
  rig.set_caps(caps_text("NV12", 161, 121, ",colorimetry=bt709"));
  EXPECT_FALSE(rig.knows());
}

TEST(Events, RgbAndYuvAreNotMixedByThePaper) {
  Learned rig("preset=paper");
  rig.set_caps(caps_text("RGB", 160, 120));
  EXPECT_FALSE(rig.knows());
}

TEST(Events, AGapBufferIsPassedAndNotLearned) {
  Rig rig("terrainseg", caps);
  const guint generation = rig.generation_after(5);
  const auto out = rig.step(GST_BUFFER_FLAG_GAP);
  EXPECT_TRUE(GST_BUFFER_FLAG_IS_SET(out.get(), GST_BUFFER_FLAG_GAP));
  EXPECT_EQ(generation_of(out.get()), generation);
  EXPECT_TRUE(flags_of(out.get()) & flag_frozen);
  EXPECT_FALSE(flags_of(out.get()) & flag_learned);
  EXPECT_GT(rig.generation_after(1), generation); // and then it goes on
}

TEST(Events, GapEventsPass) {
  Rig rig("terrainseg", caps);
  rig.step();
  EXPECT_TRUE(gst_harness_push_event(rig.harness(), gst_event_new_gap(GST_SECOND, GST_SECOND)));
  bool passed = false;
  while (GstEvent* event = gst_harness_try_pull_event(rig.harness())) {
    passed = passed || GST_EVENT_TYPE(event) == GST_EVENT_GAP;
    gst_event_unref(event);
  }
  EXPECT_TRUE(passed);
}

TEST(Events, NegativeRateIsProcessedAndNotLearned) {
  Learned rig;
  g_object_set(rig.element(), "learning", TRUE, nullptr);
  const guint generation = rig.generation_after(1);
  rig.send_rate(-1);
  const auto out = rig.step();
  EXPECT_EQ(generation_of(out.get()), generation);
  EXPECT_FALSE(flags_of(out.get()) & flag_unknown);
  rig.send_rate(1);
  EXPECT_GT(rig.generation_after(1), generation);
}

TEST(Events, ARecordingThatRunsBackwardsIsProcessedAndNotLearned) {
  Learned rig;
  g_object_set(rig.element(), "learning", TRUE, nullptr);
  const guint generation = rig.generation_after(1);
  rig.send_rate(1, -1);
  EXPECT_EQ(generation_of(rig.step().get()), generation);
  rig.send_rate(1, 2);
  EXPECT_GT(rig.generation_after(1), generation);
}

TEST(Events, ACorruptedFrameIsProcessedAndNotLearned) {
  Learned rig;
  g_object_set(rig.element(), "learning", TRUE, nullptr);
  const guint generation = rig.generation_after(1);
  const auto out = rig.step(GST_BUFFER_FLAG_CORRUPTED);
  EXPECT_EQ(generation_of(out.get()), generation);
  EXPECT_TRUE(flags_of(out.get()) & flag_frozen);
  EXPECT_FALSE(flags_of(out.get()) & flag_unknown);
  EXPECT_GT(rig.generation_after(1), generation);
}

TEST(Events, ASegmentOfBytesHasNoTimes) {
  std::vector<std::string> elements = {"terrainseg post-messages=true", "terrainoverlay", "terrainextract"};
  if (have("terrainreference"))
    elements.emplace_back("terrainreference");
  for (const std::string& element : elements) {
    Rig rig(element, caps);
    GstSegment segment;
    gst_segment_init(&segment, GST_FORMAT_BYTES);
    EXPECT_TRUE(gst_harness_push_event(rig.harness(), gst_event_new_segment(&segment)));
    for (int i = 0; i < 3; ++i) // a critical would end the test
      EXPECT_EQ(rig.push(new_frame(rig.info(), i)), GST_FLOW_OK) << element;
    if (element.find("post") == std::string::npos)
      continue;
    const Owned<GstMessage> message(gst_bus_pop_filtered(rig.bus(), GST_MESSAGE_ELEMENT));
    ASSERT_TRUE(message);
    guint64 time = 0;
    EXPECT_TRUE(gst_structure_get_uint64(gst_message_get_structure(message.get()), "running-time", &time));
    EXPECT_EQ(time, GST_CLOCK_TIME_NONE);
  }
}

TEST(Events, LearningOffFreezes) {
  Rig rig("terrainseg", caps);
  const guint generation = rig.generation_after(3);
  g_object_set(rig.element(), "learning", FALSE, nullptr);
  const auto out = rig.step();
  EXPECT_EQ(generation_of(out.get()), generation);
  EXPECT_TRUE(flags_of(out.get()) & flag_frozen);
  EXPECT_EQ(rig.counter("skipped-frozen"), 1u);
}

// ---- quality of service ----------------------------------------------------------------------------------

bool passes_qos(const std::string& element) {
  Rig rig(element, caps);
  rig.step();
  while (GstEvent* event = gst_harness_try_pull_upstream_event(rig.harness()))
    gst_event_unref(event);
  EXPECT_TRUE(gst_harness_push_upstream_event(
      rig.harness(), gst_event_new_qos(GST_QOS_TYPE_UNDERFLOW, 2.0, 50 * GST_MSECOND, GST_SECOND)));
  const Owned<GstEvent> arrived(gst_harness_try_pull_upstream_event(rig.harness()));
  return arrived && GST_EVENT_TYPE(arrived.get()) == GST_EVENT_QOS;
}

TEST(Qos, TheBaseClassPropertyDecidesWhetherUpstreamHearsOfLateFrames) {
  EXPECT_FALSE(passes_qos("terrainseg"));
  EXPECT_TRUE(passes_qos("terrainseg qos=true"));
  if (have("terrainreference")) {
    EXPECT_FALSE(passes_qos("terrainreference"));
    EXPECT_TRUE(passes_qos("terrainreference qos=true"));
  }
}

/// Frames that terrainseg looked at, of 30 that a decoder gives to a sink that takes twice as long as it may.
guint64 frames_before_a_slow_sink(const std::string& settings) {
  auto pipeline =
      make_element("videotestsrc num-buffers=30 ! " + caps + " ! jpegenc ! jpegdec ! terrainseg name=seg " +
                   settings + " ! identity sleep-time=66000 ! fakesink sync=true qos=true");
  Owned<GstElement> seg(gst_bin_get_by_name(GST_BIN(pipeline.get()), "seg"));
  // Counted at the pad: going to NULL forgets the statistics.
  guint64 frames = 0;
  GstPad* pad = gst_element_get_static_pad(seg.get(), "sink");
  gst_pad_add_probe(
      pad, GST_PAD_PROBE_TYPE_BUFFER,
      [](GstPad*, GstPadProbeInfo*, gpointer count) -> GstPadProbeReturn {
        ++*static_cast<guint64*>(count);
        return GST_PAD_PROBE_OK;
      },
      &frames, nullptr);
  gst_object_unref(pad);
  EXPECT_EQ(run_pipeline(pipeline.get()), "");
  return frames;
}

TEST(Qos, ASlowSinkDoesNotMakeTheDecoderDrop) {
  if (!have("jpegenc") || !have("jpegdec"))
    GTEST_SKIP() << "jpegenc or jpegdec is not here";
  EXPECT_EQ(frames_before_a_slow_sink(""), 30u);
  EXPECT_LT(frames_before_a_slow_sink("qos=true"), 27u);
}

// ---- the proximity sensor --------------------------------------------------------------------------------

GstEvent* near_event(GstEventType type, gboolean clear) {
  return gst_event_new_custom(
      type, gst_structure_new(GST_TERRAIN_SEG_NEAR_EVENT, "clear", G_TYPE_BOOLEAN, clear, nullptr));
}

TEST(Events, NearClearAsPropertyAndAsEventFromBothSides) {
  Rig rig("terrainseg", caps);
  guint generation = rig.generation_after(3);
  const auto learns = [&] {
    const guint before = generation;
    generation = rig.generation_after(1);
    return generation > before;
  };
  const auto property = [&] {
    gboolean clear = FALSE;
    g_object_get(rig.element(), "near-clear", &clear, nullptr);
    return clear != FALSE;
  };
  int notified = 0;
  g_signal_connect(rig.element(), "notify::near-clear",
                   G_CALLBACK(+[](GObject*, GParamSpec*, int* count) { ++*count; }), &notified);
  g_object_set(rig.element(), "near-clear", FALSE, nullptr);
  EXPECT_FALSE(learns());
  g_object_set(rig.element(), "near-clear", TRUE, nullptr);
  EXPECT_TRUE(learns());
  for (GstEventType type :
       {GST_EVENT_CUSTOM_DOWNSTREAM, GST_EVENT_CUSTOM_DOWNSTREAM_OOB, GST_EVENT_CUSTOM_BOTH}) {
    EXPECT_TRUE(gst_harness_push_event(rig.harness(), near_event(type, FALSE)));
    EXPECT_FALSE(property());
    EXPECT_FALSE(learns());
    EXPECT_TRUE(gst_harness_push_event(rig.harness(), near_event(type, TRUE)));
    EXPECT_TRUE(property());
    EXPECT_TRUE(learns());
  }
  EXPECT_TRUE(gst_harness_push_upstream_event(rig.harness(), near_event(GST_EVENT_CUSTOM_UPSTREAM, FALSE)));
  EXPECT_FALSE(learns());
  EXPECT_TRUE(gst_harness_push_upstream_event(rig.harness(), near_event(GST_EVENT_CUSTOM_UPSTREAM, TRUE)));
  EXPECT_TRUE(learns());
  EXPECT_EQ(notified, 10);
  EXPECT_EQ(rig.counter("skipped-near"), 5u);
}

TEST(Events, ANearEventWithoutItsFieldIsReported) {
  Rig rig("terrainseg", caps);
  gst_harness_push_event(
      rig.harness(),
      gst_event_new_custom(GST_EVENT_CUSTOM_DOWNSTREAM, gst_structure_new_empty(GST_TERRAIN_SEG_NEAR_EVENT)));
  gst_harness_push_event(rig.harness(),
                         gst_event_new_custom(GST_EVENT_CUSTOM_DOWNSTREAM, gst_structure_new_empty("other")));
  EXPECT_EQ(rig.warnings().size(), 1u);
}

TEST(Events, EosPassesAlsoWithoutAFrame) {
  for (int frames : {0, 3}) {
    Rig rig("terrainseg", caps);
    for (int i = 0; i < frames; ++i)
      rig.step();
    EXPECT_TRUE(gst_harness_push_event(rig.harness(), gst_event_new_eos()));
    bool eos = false;
    while (GstEvent* event = gst_harness_try_pull_event(rig.harness())) {
      eos = eos || GST_EVENT_TYPE(event) == GST_EVENT_EOS;
      gst_event_unref(event);
    }
    EXPECT_TRUE(eos);
    EXPECT_TRUE(rig.errors().empty());
  }
}

TEST(Events, AStreamThatEndsBeforeItsCaps) {
  Rig rig("terrainseg");
  gst_harness_push_event(rig.harness(), gst_event_new_stream_start("x"));
  EXPECT_TRUE(gst_harness_push_event(rig.harness(), gst_event_new_eos()));
  EXPECT_TRUE(rig.errors().empty());
}

} // namespace
} // namespace terrainseg::test
