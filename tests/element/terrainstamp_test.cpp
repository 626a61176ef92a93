// SPDX-License-Identifier: LGPL-2.1-or-later
// Stamps into encoded video and out of it, and through encoders and decoders to the frames that units belong
// to.
#include "outlet_harness.hpp"

#include <algorithm>
#include <iterator>
#include <map>
#include <ostream>

namespace terrainseg::test {
namespace {

const testing::Environment* const gstreamer = testing::AddGlobalTestEnvironment(new GStreamer);

constexpr const char* byte_stream = "video/x-h264,stream-format=byte-stream,alignment=au";
constexpr const char* avc = "video/x-h264,stream-format=avc,alignment=au,codec_data=(buffer)0142c00dffe1";
const std::string identifier = "MISPmicrosectime";
const std::string delimiter("\0\0\0\1\x09\x30", 6);
const std::string slice("\0\0\0\1\x41\x9a\x21\xae", 8);

/// A frame at `i` with these bytes.
Owned<GstBuffer> unit(const std::string& bytes, int i) {
  Owned<GstBuffer> buffer(gst_buffer_new_allocate(nullptr, bytes.size(), nullptr));
  gst_buffer_fill(buffer.get(), 0, bytes.data(), bytes.size());
  GST_BUFFER_PTS(buffer.get()) = i * frame_time;
  GST_BUFFER_DTS(buffer.get()) = i * frame_time;
  GST_BUFFER_DURATION(buffer.get()) = frame_time;
  GST_BUFFER_FLAG_SET(buffer.get(), GST_BUFFER_FLAG_DELTA_UNIT);
  return buffer;
}

/// What GStreamer's own reader says of the stamps beside a buffer.
std::vector<guint64> stamps(GstBuffer* buffer) {
  std::vector<guint64> times;
  gpointer state = nullptr;
  while (GstMeta* meta = gst_buffer_iterate_meta_filtered(
             buffer, &state, GST_VIDEO_SEI_USER_DATA_UNREGISTERED_META_API_TYPE)) {
    guint8 status = 0;
    guint64 time = 0;
    if (gst_video_sei_user_data_unregistered_parse_precision_time_stamp(
            reinterpret_cast<GstVideoSEIUserDataUnregisteredMeta*>(meta), &status, &time)) {
      EXPECT_EQ(status, 0x9f);
      times.push_back(time);
    }
  }
  return times;
}

struct Stamp {
  Owned<GstHarness> h;
  explicit Stamp(const char* description, const char* caps = byte_stream)
      : h(gst_harness_new_parse(description)) {
    gst_harness_set_src_caps_str(h.get(), caps);
  }
  Owned<GstBuffer> pass(Owned<GstBuffer> in) {
    EXPECT_EQ(gst_harness_push(h.get(), in.release()), GST_FLOW_OK);
    return Owned<GstBuffer>(gst_harness_pull(h.get()));
  }
};

std::string stamp_bytes(const std::string& groups) {
  return std::string("\0\0\0\1\x06\x05\x1c", 7) + identifier + "\x9f" + groups + "\x80";
}
// 40000 us = 0x9c40
const std::string first_groups("\0\0\xff\0\0\xff\0\0\xff\x9c\x40", 11);

TEST(TerrainStamp, WritesInFrontOfTheFirstSlice) {
  Stamp stamp("terrainstamp");
  const auto out = stamp.pass(unit(delimiter + slice + slice, 1));
  EXPECT_EQ(text_of(out.get()), delimiter + stamp_bytes(first_groups) + slice + slice);
  EXPECT_EQ(stamps(out.get()), std::vector<guint64>{40000});
  EXPECT_EQ(GST_BUFFER_PTS(out.get()), frame_time);
  EXPECT_EQ(GST_BUFFER_DTS(out.get()), frame_time);
  EXPECT_EQ(GST_BUFFER_DURATION(out.get()), frame_time);
  EXPECT_TRUE(GST_BUFFER_FLAG_IS_SET(out.get(), GST_BUFFER_FLAG_DELTA_UNIT));
  // The slice may be the first thing there is.
  EXPECT_EQ(text_of(stamp.pass(unit(slice, 1)).get()), stamp_bytes(first_groups) + slice);
}

TEST(TerrainStamp, WritesLengthsWhereTheCapsHaveThem) {
  Stamp stamp("terrainstamp", avc);
  const std::string length_slice("\0\0\0\4\x41\x9a\x21\xae", 8);
  const auto out = stamp.pass(unit(length_slice, 1));
  std::string expected = stamp_bytes(first_groups);
  expected[3] = 32;
  EXPECT_EQ(text_of(out.get()), expected + length_slice);
}

TEST(TerrainStamp, KeepsAStampThatIsThere) {
  Stamp stamp("terrainstamp ! terrainstamp");
  EXPECT_EQ(text_of(stamp.pass(unit(slice, 1)).get()), stamp_bytes(first_groups) + slice);
  Stamp shifted("terrainstamp ! identity ts-offset=40000000 ! terrainstamp");
  EXPECT_EQ(text_of(shifted.pass(unit(slice, 1)).get()), stamp_bytes(first_groups) + slice);
}

// A camera's own stamp, which h265parse of GStreamer 1.22 does not note: terrainextract behind it takes the
// same time for the unit.
TEST(TerrainStamp, NotesAStampThatIsThere) {
  Stamp stamp("terrainstamp");
  const std::string bytes = stamp_bytes(first_groups) + slice;
  const auto out = stamp.pass(unit(bytes, 7));
  EXPECT_EQ(text_of(out.get()), bytes);
  EXPECT_EQ(stamps(out.get()), std::vector<guint64>{40000});
  // Once.
  Stamp twice("terrainstamp ! terrainstamp");
  EXPECT_EQ(stamps(twice.pass(unit(bytes, 7)).get()), std::vector<guint64>{40000});
}

// The time of day where upstream noted it, else the stream time: encoders shift time stamps and segment
// alike.
TEST(TerrainStamp, TakesTheTimeThatTheUnitTakes) {
  Stamp stamp("terrainstamp");
  const Owned<GstCaps> unix_time(gst_caps_new_empty_simple("timestamp/x-unix"));
  auto in = unit(slice, 1);
  gst_buffer_add_reference_timestamp_meta(in.get(), unix_time.get(), 1795377600123456789,
                                          GST_CLOCK_TIME_NONE);
  EXPECT_EQ(stamps(stamp.pass(std::move(in)).get()), std::vector<guint64>{1795377600123456});
  GstSegment segment;
  gst_segment_init(&segment, GST_FORMAT_TIME);
  segment.start = 3600000 * GST_SECOND;
  gst_harness_push_event(stamp.h.get(), gst_event_new_segment(&segment));
  in = unit(slice, 3);
  GST_BUFFER_PTS(in.get()) += segment.start;
  EXPECT_EQ(stamps(stamp.pass(std::move(in)).get()), std::vector<guint64>{120000});
}

TEST(TerrainStamp, WithoutASliceNothingIsWritten) {
  Stamp stamp("terrainstamp");
  Bus bus(stamp.h.get());
  EXPECT_EQ(text_of(stamp.pass(unit(delimiter, 1)).get()), delimiter);
  EXPECT_EQ(text_of(stamp.pass(unit(delimiter, 2)).get()), delimiter);
}

TEST(TerrainStamp, LengthsWithoutCodecDataAreRefused) {
  const Owned<GstHarness> h(gst_harness_new("terrainstamp"));
  Bus bus(h.get());
  gst_harness_set_src_caps_str(h.get(), "video/x-h264,stream-format=avc,alignment=au");
  EXPECT_EQ(gst_harness_push(h.get(), unit(slice, 0).release()), GST_FLOW_NOT_NEGOTIATED);
  EXPECT_NE(bus.text(GST_MESSAGE_ERROR).find("h264parse"), std::string::npos);
}

// Without any time all would have the same, and a unit would fit each of them.
TEST(TerrainStamp, WithoutATimeNothingIsWritten) {
  Stamp stamp("terrainstamp");
  Bus bus(stamp.h.get());
  for (int i = 0; i < 2; ++i) {
    auto in = unit(slice, i);
    GST_BUFFER_PTS(in.get()) = GST_CLOCK_TIME_NONE;
    const auto out = stamp.pass(std::move(in));
    EXPECT_EQ(text_of(out.get()), slice);
    EXPECT_TRUE(stamps(out.get()).empty());
    EXPECT_EQ(bus.text(GST_MESSAGE_WARNING).find("time stamp") != std::string::npos, i == 0) << "once";
  }
  // The time of day is one.
  const Owned<GstCaps> unix_time(gst_caps_new_empty_simple("timestamp/x-unix"));
  auto in = unit(slice, 1);
  GST_BUFFER_PTS(in.get()) = GST_CLOCK_TIME_NONE;
  gst_buffer_add_reference_timestamp_meta(in.get(), unix_time.get(), 1795377600123456789,
                                          GST_CLOCK_TIME_NONE);
  EXPECT_EQ(stamps(stamp.pass(std::move(in)).get()), std::vector<guint64>{1795377600123456});
}

// A codec_data that is there is not missing.
TEST(TerrainStamp, CodecDataThatIsNoneIsCalledSo) {
  for (const char* caps : {"video/x-h264,stream-format=avc,alignment=au,codec_data=(buffer)0142c0",
                           "video/x-h264,stream-format=avc,alignment=au,codec_data=(buffer)0142c00dfee1",
                           "video/x-h265,stream-format=hvc1,alignment=au,codec_data=(buffer)0142c00dffe1"}) {
    const Owned<GstHarness> h(gst_harness_new("terrainstamp"));
    Bus bus(h.get());
    gst_harness_set_src_caps_str(h.get(), caps);
    EXPECT_EQ(gst_harness_push(h.get(), unit(slice, 0).release()), GST_FLOW_NOT_NEGOTIATED);
    const std::string told = bus.text(GST_MESSAGE_ERROR);
    EXPECT_NE(told.find("codec_data in the video's caps does not give"), std::string::npos) << told;
    EXPECT_EQ(told.find("lack"), std::string::npos) << told;
  }
}

TEST(TerrainStamp, ReadsAndChangesNoByte) {
  Stamp stamp("terrainstamp mode=read");
  const std::string bytes = stamp_bytes(first_groups) + slice;
  const auto out = stamp.pass(unit(bytes, 7));
  EXPECT_EQ(text_of(out.get()), bytes);
  EXPECT_EQ(stamps(out.get()), std::vector<guint64>{40000});
  EXPECT_TRUE(stamps(stamp.pass(unit(slice, 8)).get()).empty());
}

// Right behind a gap the stamp may be a lost picture's; and two that differ are parts of two pictures.
TEST(TerrainStamp, ReadTrustsNothingBehindAGap) {
  Stamp stamp("terrainstamp mode=read");
  const std::string bytes = stamp_bytes(first_groups) + slice;
  const auto with_gap = [&](const std::string& content) {
    auto in = unit(content, 1);
    GST_BUFFER_FLAG_SET(in.get(), GST_BUFFER_FLAG_DISCONT);
    return in;
  };
  EXPECT_EQ(stamps(stamp.pass(with_gap(bytes)).get()).size(), 1u) << "the first of all is no gap";
  EXPECT_TRUE(stamps(stamp.pass(with_gap(bytes)).get()).empty());
  EXPECT_EQ(stamps(stamp.pass(unit(bytes, 2)).get()).size(), 1u);
  std::string other = first_groups;
  other[10] = 0x41;
  EXPECT_TRUE(stamps(stamp.pass(unit(stamp_bytes(other) + bytes, 3)).get()).empty());
  // What a parser noted goes, too.
  Stamp noted("terrainstamp ! identity ! terrainstamp mode=read");
  noted.pass(unit(slice, 1));
  EXPECT_TRUE(stamps(noted.pass(with_gap(slice)).get()).empty());
  EXPECT_EQ(stamps(noted.pass(unit(slice, 1)).get()).size(), 1u);
}

// ---- through real encoders and decoders
// --------------------------------------------------------------------

struct Way {
  const char *encoder, *parser, *decoder;
  const char* format = ""; ///< stream-format at the stamps
};

void PrintTo(const Way& way, std::ostream* out) {
  *out << way.encoder << ", " << way.decoder << ", " << way.format;
}

/// The element that a description begins with.
bool exists(const std::string& text) {
  return gst_registry_check_feature_version(gst_registry_get(), text.substr(0, text.find(' ')).c_str(), 1, 0,
                                            0);
}

/// For each frame that left terraincombine: its number by its time, and the number in the metadata; -1 =
/// none.
using Numbers = std::map<int, int>;

GstPadProbeReturn note_number(GstPad*, GstPadProbeInfo* info, gpointer data) {
  GstBuffer* frame = GST_PAD_PROBE_INFO_BUFFER(info);
  const EstimateReader reader(frame);
  const auto all = stamps(frame); // one of the element, one of the parser behind it
  const bool one = !all.empty() && std::ranges::count(all, all[0]) == std::ssize(all);
  const int number = one ? static_cast<int>((all[0] + 20000) / 40000) : -2;
  (*static_cast<Numbers*>(data))[number] = reader ? static_cast<int>(reader.estimate().frame) : -1;
  return GST_PAD_PROBE_OK;
}

Numbers run(const std::string& text, guint64* precisely) {
  GError* error = nullptr;
  const Owned<GstElement> pipeline(gst_parse_launch(text.c_str(), &error));
  EXPECT_EQ(error, nullptr) << error->message;
  Numbers numbers;
  const Owned<GstElement> combine(gst_bin_get_by_name(GST_BIN(pipeline.get()), "c"));
  GstPad* src = gst_element_get_static_pad(combine.get(), "src");
  gst_pad_add_probe(src, GST_PAD_PROBE_TYPE_BUFFER, note_number, &numbers, nullptr);
  gst_object_unref(src);
  gst_element_set_state(pipeline.get(), GST_STATE_PLAYING);
  const Owned<GstBus> bus(gst_element_get_bus(pipeline.get()));
  const Owned<GstMessage> end(gst_bus_timed_pop_filtered(
      bus.get(), 60 * GST_SECOND, static_cast<GstMessageType>(GST_MESSAGE_EOS | GST_MESSAGE_ERROR)));
  EXPECT_TRUE(end);
  EXPECT_EQ(end ? GST_MESSAGE_TYPE(end.get()) : GST_MESSAGE_UNKNOWN, GST_MESSAGE_EOS);
  GstStructure* stats = nullptr;
  g_object_get(combine.get(), "stats", &stats, nullptr);
  EXPECT_TRUE(gst_structure_get_uint64(stats, "matched-precisely", precisely));
  gst_structure_free(stats);
  gst_element_set_state(pipeline.get(), GST_STATE_NULL);
  return numbers;
}

class TerrainStampCodec : public testing::TestWithParam<Way> {};

// The units come seven frames late by their time stamps: each finds its own frame all the same.
TEST_P(TerrainStampCodec, UnitsFindTheirFrames) {
  const Way& way = GetParam();
  for (const char* part : {way.encoder, way.parser, way.decoder})
    if (!exists(part))
      GTEST_SKIP() << "no " << part;
  const std::string format = *way.format ? std::string(way.format) + " ! " : "";
  guint64 precisely = 0;
  const Numbers numbers = run(
      std::string("terrainscenesrc num-buffers=30 ! "
                  "video/x-raw,format=I420,width=320,height=240,framerate=25/1 ! terrainseg ! tee name=t "
                  "t. ! queue ! ") +
          way.encoder + " ! " + way.parser + " ! " + format + "terrainstamp ! " + way.parser +
          " ! terrainstamp mode=read ! " + way.decoder +
          " ! c.sink t. ! queue ! terrainextract ! meta/x-klv,parsed=true ! identity ts-offset=280000000 ! "
          "queue max-size-time=0 max-size-buffers=0 ! c.meta "
          "terraincombine name=c latency=20000 ! fakesink sync=false",
      &precisely);
  EXPECT_EQ(numbers.size(), 30u);
  for (const auto& [number, unit_number] : numbers)
    EXPECT_EQ(unit_number, number);
  EXPECT_EQ(precisely, 30u);
}

INSTANTIATE_TEST_SUITE_P(
    All, TerrainStampCodec,
    testing::Values(Way{"x264enc tune=zerolatency speed-preset=ultrafast", "h264parse", "avdec_h264"},
                    Way{"x264enc tune=zerolatency speed-preset=ultrafast", "h264parse", "openh264dec",
                        "video/x-h264,stream-format=byte-stream,alignment=au"},
                    Way{"x264enc tune=zerolatency speed-preset=ultrafast", "h264parse", "avdec_h264",
                        "video/x-h264,stream-format=avc,alignment=au"},
                    Way{"x264enc bframes=2 b-adapt=false key-int-max=10 speed-preset=ultrafast", "h264parse",
                        "avdec_h264"},
                    Way{"openh264enc", "h264parse", "avdec_h264"},
                    Way{"x265enc tune=zerolatency speed-preset=ultrafast", "h265parse", "avdec_h265"},
                    Way{"x265enc tune=zerolatency speed-preset=ultrafast", "h265parse", "avdec_h265",
                        "video/x-h265,stream-format=hvc1,alignment=au"},
                    Way{"x265enc tune=zerolatency speed-preset=ultrafast", "h265parse", "libde265dec",
                        "video/x-h265,stream-format=byte-stream,alignment=au"}));

// Encoders keep the time of day that terrainseg notes, so that both ends of the tee tell the same.
TEST(TerrainStamp, TheTimeOfDayPassesTheEncoder) {
  for (const Way& way : {Way{"x264enc bframes=2 b-adapt=false", "h264parse", "avdec_h264"},
                         Way{"openh264enc", "h264parse", "avdec_h264"},
                         Way{"x265enc tune=zerolatency speed-preset=ultrafast", "h265parse", "avdec_h265"}}) {
    if (!exists(way.encoder) || !exists(way.parser) || !exists(way.decoder))
      continue;
    guint64 precisely = 0;
    const Numbers numbers = run(
        std::string(
            "terrainscenesrc num-buffers=20 ! video/x-raw,format=I420,width=320,height=240,framerate=30/1 ! "
            "terrainseg start-time=2026-11-22T20:00:00.123456Z ! tee name=t t. ! queue ! ") +
            way.encoder + " ! " + way.parser + " ! terrainstamp ! " + way.parser +
            " ! terrainstamp mode=read ! " + way.decoder +
            " ! c.sink t. ! queue ! terrainextract ! meta/x-klv,parsed=true ! identity ts-offset=280000000 ! "
            "queue max-size-time=0 max-size-buffers=0 ! c.meta terraincombine name=c latency=20000 ! "
            "fakesink "
            "sync=false",
        &precisely);
    EXPECT_EQ(precisely, 20u) << way.encoder;
  }
}

// Stock elements take H.264's stamps to the frames by themselves.
TEST(TerrainStamp, ParserAndDecoderOfH264DoWithoutTheReader) {
  for (const char* part : {"x264enc", "h264parse", "avdec_h264"})
    if (!exists(part))
      GTEST_SKIP() << "no " << part;
  guint64 precisely = 0;
  const Numbers numbers = run(
      "terrainscenesrc num-buffers=20 ! video/x-raw,format=I420,width=320,height=240,framerate=25/1 ! "
      "terrainseg ! tee name=t t. ! queue ! x264enc tune=zerolatency speed-preset=ultrafast ! h264parse ! "
      "terrainstamp ! mux. t. ! queue ! terrainextract ! meta/x-klv,parsed=true ! identity "
      "ts-offset=280000000 ! "
      "queue ! mux. mpegtsmux name=mux ! tsdemux name=d d. ! queue ! h264parse ! avdec_h264 ! c.sink "
      "d. ! meta/x-klv ! queue ! c.meta terraincombine name=c latency=20000 ! fakesink sync=false",
      &precisely);
  EXPECT_EQ(numbers.size(), 20u);
  for (const auto& [number, unit_number] : numbers)
    EXPECT_EQ(unit_number, number);
  EXPECT_EQ(precisely, 20u);
}

} // namespace
} // namespace terrainseg::test
