// SPDX-License-Identifier: LGPL-2.1-or-later
// The element terrainmcapsink in pipelines: names of its files, what it refuses, and its clock.
#include <gst/gst.h>
#include <gtest/gtest.h>

#include <array>
#include <atomic>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "../support/mcap_messages.hpp"
#include "owned.hpp"

namespace {

namespace fs = std::filesystem;
using terrainseg::test::Owned;

const std::string scene =
    "terrainscenesrc num-buffers=40 ! video/x-raw,width=160,height=120,framerate=30/1 ! ";
const std::string h264 = "x264enc bframes=0 tune=zerolatency key-int-max=30 ! h264parse ! ";

/// What a pipeline said: the first error, else empty; the first warning.
struct Said {
  std::string error, warning;
};

Said run(const std::string& text) {
  GError* wrong = nullptr;
  const Owned<GstElement> pipeline(gst_parse_launch(text.c_str(), &wrong));
  EXPECT_EQ(wrong, nullptr) << (wrong ? wrong->message : "");
  g_clear_error(&wrong);
  Said said;
  const Owned<GstBus> bus(gst_element_get_bus(pipeline.get()));
  gst_element_set_state(pipeline.get(), GST_STATE_PLAYING);
  for (;;) {
    const Owned<GstMessage> message(gst_bus_timed_pop_filtered(
        bus.get(), 30 * GST_SECOND,
        static_cast<GstMessageType>(GST_MESSAGE_ERROR | GST_MESSAGE_WARNING | GST_MESSAGE_EOS)));
    if (!message) {
      ADD_FAILURE() << "no end: " << text;
      return said;
    }
    if (GST_MESSAGE_TYPE(message.get()) == GST_MESSAGE_EOS)
      return said;
    GError* error = nullptr;
    const bool fatal = GST_MESSAGE_TYPE(message.get()) == GST_MESSAGE_ERROR;
    if (fatal)
      gst_message_parse_error(message.get(), &error, nullptr);
    else
      gst_message_parse_warning(message.get(), &error, nullptr);
    std::string& kept = fatal ? said.error : said.warning;
    kept = kept.empty() ? error->message : kept;
    g_clear_error(&error);
    if (fatal)
      return said;
  }
}

constexpr char magic[] = "\x89MCAP0\r\n";

std::string bytes_of(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

bool is_whole(const std::string& bytes) {
  return bytes.size() > 100 && bytes.compare(0, 8, magic) == 0 &&
         bytes.compare(bytes.size() - 8, 8, magic) == 0;
}

/// Messages and the times of the first and the last, from the statistics in the summary.
struct Statistics {
  std::uint64_t messages = 0, start = 0, end = 0;
};
Statistics statistics_of(const std::string& bytes) {
  const auto number = [&](std::size_t at) {
    std::uint64_t value = 0;
    if (at + 8 <= bytes.size())
      std::memcpy(&value, bytes.data() + at, 8);
    return value;
  };
  for (std::size_t at = number(bytes.size() - 8 - 20); at + 9 < bytes.size(); at += 9 + number(at + 1))
    if (bytes[at] == 11)
      return {number(at + 9), number(at + 9 + 26), number(at + 9 + 34)};
  ADD_FAILURE() << "no statistics";
  return {};
}

class McapSink : public testing::Test {
 protected:
  void SetUp() override {
    gchar* name = g_dir_make_tmp("terrainmcapsink-XXXXXX", nullptr);
    ASSERT_NE(name, nullptr);
    folder_ = name;
    g_free(name);
  }
  void TearDown() override { fs::remove_all(folder_); }
  std::string at(const char* name) const { return (folder_ / name).string(); }
  fs::path folder_;
};

TEST_F(McapSink, AFileHasItsNameWhenItIsWholeAndIsNeverReplaced) {
  const std::string pipeline =
      scene + "terrainseg ! " + h264 + "terrainmcapsink location=" + at("drive.mcap");
  EXPECT_EQ(run(pipeline).error, "");
  const std::string bytes = bytes_of(at("drive.mcap"));
  EXPECT_TRUE(is_whole(bytes));
  EXPECT_EQ(statistics_of(bytes).messages, 82u) << "mask and video, diagnostics of two seconds";
  EXPECT_FALSE(fs::exists(at("drive.mcap.part")));
  const std::string error = run(pipeline).error;
  EXPECT_NE(error.find("drive.mcap\" already exists"), std::string::npos) << error;
  EXPECT_EQ(bytes_of(at("drive.mcap")), bytes);
  // Nor what a killed recorder left.
  fs::rename(at("drive.mcap"), at("drive.mcap.part"));
  const std::string left = run(pipeline).error;
  EXPECT_NE(left.find("drive.mcap.part\" already exists"), std::string::npos) << left;
  EXPECT_EQ(bytes_of(at("drive.mcap.part")), bytes);
}

TEST_F(McapSink, AFolderBecomesABag) {
  EXPECT_EQ(run(scene + "terrainseg ! terrainmcapsink location=" + at("drive/")).error, "");
  EXPECT_TRUE(is_whole(bytes_of(at("drive/drive_0.mcap"))));
  const std::string metadata = bytes_of(at("drive/metadata.yaml"));
  EXPECT_NE(metadata.find("- \"drive_0.mcap\"\n"), std::string::npos) << metadata;
  EXPECT_NE(metadata.find("message_count: 42\n"), std::string::npos) << metadata;
}

TEST_F(McapSink, TakesJpegPictures) {
  EXPECT_EQ(run(scene + "terrainseg ! jpegenc ! terrainmcapsink location=" + at("drive.mcap")).error, "");
  const std::string bytes = bytes_of(at("drive.mcap"));
  EXPECT_EQ(statistics_of(bytes).messages, 82u) << "mask and picture, diagnostics of two seconds";
}

TEST_F(McapSink, StoppingWithoutAnEndEndsTheFileToo) {
  GError* wrong = nullptr;
  const std::string text =
      "terrainscenesrc is-live=true ! video/x-raw,width=160,height=120 ! terrainseg ! terrainmcapsink "
      "name=sink location=" +
      at("drive.mcap");
  const Owned<GstElement> pipeline(gst_parse_launch(text.c_str(), &wrong));
  ASSERT_EQ(wrong, nullptr);
  gst_element_set_state(pipeline.get(), GST_STATE_PLAYING);
  const gint64 deadline = g_get_monotonic_time() + 30 * G_TIME_SPAN_SECOND;
  while ((!fs::exists(at("drive.mcap.part")) ||
          fs::file_size(at("drive.mcap.part")) < 100) && // a chunk is there
         g_get_monotonic_time() < deadline)
    g_usleep(10000);
  EXPECT_FALSE(fs::exists(at("drive.mcap")));
  gst_element_set_state(pipeline.get(), GST_STATE_NULL);
  EXPECT_TRUE(is_whole(bytes_of(at("drive.mcap"))));
  EXPECT_GT(statistics_of(bytes_of(at("drive.mcap"))).messages, 5u);
}

TEST_F(McapSink, RefusesWhatItCannotRecord) {
  const std::string sink = "terrainmcapsink location=" + at("drive.mcap");
  EXPECT_NE(run(scene + "x264enc bframes=2 ! h264parse ! " + sink).error.find("B-frames"), std::string::npos);
  fs::remove(at("drive.mcap.part"));
  fs::remove(at("drive.mcap"));
  EXPECT_NE(run(scene + "terrainmcapsink").error.find("either location"), std::string::npos);
  EXPECT_NE(run(scene + "terrainmcapsink fd=1 location=x.mcap").error.find("not both"), std::string::npos);
  EXPECT_NE(run(scene + sink + " mount=height=0").error.find("\"height=0\" of property mount cannot be used"),
            std::string::npos);
  EXPECT_NE(run(scene + sink + " camera-info=/nowhere").error.find("\"/nowhere\" of property camera-info"),
            std::string::npos);
  EXPECT_FALSE(fs::exists(at("drive.mcap.part"))) << "settings are read first";
  EXPECT_NE(run(scene + "terrainmcapsink location=/proc/nowhere/a.mcap").error.find("Cannot write"),
            std::string::npos);
}

TEST_F(McapSink, AFullDiskIsTold) {
  std::FILE* full = std::fopen("/dev/full", "w");
  ASSERT_NE(full, nullptr);
  const std::string error =
      run(scene + "terrainseg ! terrainmcapsink fd=" + std::to_string(fileno(full))).error;
  std::fclose(full);
  EXPECT_EQ(error, "No space left on device.");
}

/// A sink that is used again, as a program does: by frames that come from nowhere.
class Recorder {
 public:
  Recorder() : sink_(gst_element_factory_make("terrainmcapsink", nullptr)) {
    gst_object_ref_sink(sink_.get());
    g_object_set(sink_.get(), "async", FALSE, nullptr);
  }
  ~Recorder() { gst_element_set_state(sink_.get(), GST_STATE_NULL); }
  GstElement* sink() const { return sink_.get(); }
  /// One frame to a location, or to a descriptor where that is nullptr. False when it could not be whole.
  bool record(const char* location, int fd) { return begin(location, fd) && push(0) && end(); }
  bool begin(const char* location, int fd) {
    g_object_set(sink_.get(), "location", location, "fd", fd, nullptr);
    if (gst_element_set_state(sink_.get(), GST_STATE_PLAYING) == GST_STATE_CHANGE_FAILURE)
      return false;
    const Owned<GstCaps> caps(gst_caps_from_string("image/jpeg,width=1,height=1,framerate=30/1"));
    GstSegment segment;
    gst_segment_init(&segment, GST_FORMAT_TIME);
    return send(gst_event_new_stream_start("x")) && send(gst_event_new_caps(caps.get())) &&
           send(gst_event_new_segment(&segment));
  }
  /// A frame, with its time of day where `utc` is one.
  bool push(GstClockTime time, GstClockTime utc = GST_CLOCK_TIME_NONE) {
    GstBuffer* frame = gst_buffer_new_allocate(nullptr, 4, nullptr);
    GST_BUFFER_PTS(frame) = time;
    if (GST_CLOCK_TIME_IS_VALID(utc)) {
      const Owned<GstCaps> day(gst_caps_new_empty_simple("timestamp/x-unix"));
      gst_buffer_add_reference_timestamp_meta(frame, day.get(), utc, GST_CLOCK_TIME_NONE);
    }
    const Owned<GstPad> pad(gst_element_get_static_pad(sink_.get(), "sink"));
    return gst_pad_chain(pad.get(), frame) == GST_FLOW_OK;
  }
  bool end() {
    const bool whole = send(gst_event_new_eos());
    gst_element_set_state(sink_.get(), GST_STATE_NULL);
    return whole;
  }

 private:
  bool send(GstEvent* event) const {
    const Owned<GstPad> pad(gst_element_get_static_pad(sink_.get(), "sink"));
    return gst_pad_send_event(pad.get(), event);
  }
  Owned<GstElement> sink_;
};

/// The times of all messages of a recording, in milliseconds since `start`, as they stand in it.
std::vector<std::int64_t> times_of(const std::string& bytes, std::uint64_t start) {
  std::vector<std::int64_t> times;
  terrainseg::test::each_mcap_message(bytes, [&](const std::string&, std::uint64_t time, const auto&) {
    times.push_back(static_cast<std::int64_t>(time - start) / 1'000'000);
  });
  return times;
}

/// A recording of five frames, 100 ms apart but for what `clock` makes of their time of day.
std::vector<std::int64_t> recorded(const std::string& path, std::array<GstClockTimeDiff, 5> clock,
                                   std::string& warning) {
  constexpr GstClockTime day = 1'700'000'000 * GST_SECOND;
  Recorder recorder;
  const Owned<GstBus> bus(gst_bus_new());
  gst_element_set_bus(recorder.sink(), bus.get());
  EXPECT_TRUE(recorder.begin(path.c_str(), -1));
  for (std::size_t i = 0; i < clock.size(); ++i)
    EXPECT_TRUE(
        recorder.push(i * 100 * GST_MSECOND, day + static_cast<GstClockTime>(clock[i]) * GST_MSECOND));
  EXPECT_TRUE(recorder.end());
  warning.clear();
  if (const Owned<GstMessage> message{gst_bus_pop_filtered(bus.get(), GST_MESSAGE_WARNING)}) {
    GError* error = nullptr;
    gst_message_parse_warning(message.get(), &error, nullptr);
    warning = error->message;
    g_clear_error(&error);
  }
  gst_element_set_bus(recorder.sink(), nullptr);
  return times_of(bytes_of(path), day);
}

TEST_F(McapSink, AClockThatIsSetNeitherTurnsNorBreaksTheTimeOfARecording) {
  using Times = std::vector<std::int64_t>;
  const Times even = {0, 100, 200, 300, 400};
  std::string warning;
  EXPECT_EQ(recorded(at("even.mcap"), {0, 100, 200, 300, 400}, warning), even);
  EXPECT_EQ(warning.find("No frame had terrain metadata"), 0u) << warning;
  EXPECT_NE(warning.find("videocrop"), std::string::npos) << warning;
  EXPECT_EQ(recorded(at("back.mcap"), {0, 100, -4800, -4700, -4600}, warning), even);
  EXPECT_NE(warning.find("The frames' time of day jumped by -5.000 s"), std::string::npos) << warning;
  EXPECT_EQ(recorded(at("forth.mcap"), {0, 100, 3'600'200, 3'600'300, 3'600'400}, warning), even);
  EXPECT_NE(warning.find("jumped by 3600.000 s"), std::string::npos) << warning;
  EXPECT_EQ(recorded(at("both.mcap"), {0, 100, 1200, 300, 400}, warning), even);
  // Two jumps whose sum no signed number holds.
  constexpr GstClockTimeDiff far = 9'200'000'000'000, before = -1'000'000'000'000;
  EXPECT_EQ(recorded(at("far.mcap"), {0, far, far + 100, before, before + 100}, warning), even);
  EXPECT_EQ(recorded(at("slewed.mcap"), {0, 110, 220, 330, 440}, warning), (Times{0, 110, 220, 330, 440}));
  EXPECT_NE(warning.find("No frame had terrain metadata"), std::string::npos) << warning;
}

TEST_F(McapSink, APauseIsInTheTimeOfARecordingAndAStreamThatStartsAgainIsNot) {
  constexpr GstClockTime day = 1'700'000'000 * GST_SECOND, tenth = 100 * GST_MSECOND;
  Recorder recorder;
  ASSERT_TRUE(recorder.begin(at("pause.mcap").c_str(), -1));
  EXPECT_TRUE(recorder.push(0, day) && recorder.push(tenth, day + tenth));
  gst_element_set_base_time(recorder.sink(), 30 * GST_SECOND);
  EXPECT_TRUE(recorder.push(2 * tenth, day + 2 * tenth + 30 * GST_SECOND) && recorder.end());
  EXPECT_EQ(times_of(bytes_of(at("pause.mcap")), day), (std::vector<std::int64_t>{0, 100, 30'200}));
  ASSERT_TRUE(recorder.begin(at("again.mcap").c_str(), -1));
  EXPECT_TRUE(recorder.push(0) && recorder.push(tenth) && recorder.push(0) && recorder.push(tenth) &&
              recorder.end());
  EXPECT_EQ(times_of(bytes_of(at("again.mcap")), 0), (std::vector<std::int64_t>{0, 100, 101, 201}));
}

TEST_F(McapSink, ADescriptorAfterALocationIsLeftToItsOwner) {
  Recorder recorder;
  EXPECT_TRUE(recorder.record(at("first.mcap").c_str(), -1));
  std::FILE* second = std::fopen(at("second").c_str(), "w");
  ASSERT_NE(second, nullptr);
  EXPECT_TRUE(recorder.record(nullptr, fileno(second)));
  EXPECT_EQ(std::fclose(second), 0) << "still open";
  EXPECT_TRUE(is_whole(bytes_of(at("second"))));
  EXPECT_TRUE(is_whole(bytes_of(at("first.mcap"))));
}

TEST_F(McapSink, AFullDiskIsNotRememberedOfTheNextDescriptor) {
  Recorder recorder;
  std::FILE* full = std::fopen("/dev/full", "w");
  ASSERT_NE(full, nullptr);
  EXPECT_FALSE(recorder.record(nullptr, fileno(full)));
  std::fclose(full);
  std::FILE* next = std::fopen(at("next").c_str(), "w");
  ASSERT_NE(next, nullptr);
  EXPECT_TRUE(recorder.record(nullptr, fileno(next)));
  std::fclose(next);
  EXPECT_TRUE(is_whole(bytes_of(at("next"))));
}

TEST_F(McapSink, TheClockIsTheTimeOfDayWhereTheFirstFrameHasIt) {
  EXPECT_EQ(run(scene + "terrainseg start-time=1700000000000000000 ! " + h264 +
                "terrainmcapsink location=" + at("day.mcap"))
                .error,
            "");
  const Statistics day = statistics_of(bytes_of(at("day.mcap")));
  EXPECT_EQ(day.start, 1700000000000000000u);
  EXPECT_EQ(day.end, 1700000000000000000u + 1300000000u) << "39 frames of a 30th of a second later";
  EXPECT_EQ(run(scene + "terrainseg ! " + h264 + "terrainmcapsink location=" + at("stream.mcap")).error, "");
  EXPECT_EQ(statistics_of(bytes_of(at("stream.mcap"))).start, 0u)
      << "behind an encoder that moves its time stamps";
}

TEST_F(McapSink, TellsOfEveryFrameAtLevelSix) {
  std::atomic<int> lines = 0;
  const auto count = +[](GstDebugCategory* category, GstDebugLevel level, const gchar*, const gchar*, gint,
                         GObject*, GstDebugMessage* message, gpointer data) {
    *static_cast<std::atomic<int>*>(data) +=
        level == GST_LEVEL_LOG && !std::strcmp(gst_debug_category_get_name(category), "terrainmcapsink") &&
        !std::strncmp(gst_debug_message_get(message), "with terrain at", 15);
  };
  gst_debug_set_threshold_for_name("terrainmcapsink", GST_LEVEL_LOG);
  (gst_debug_remove_log_function)(gst_debug_log_default);
  (gst_debug_add_log_function)(count, &lines, nullptr);
  EXPECT_EQ(run(scene + "terrainseg ! terrainmcapsink location=" + at("drive.mcap")).error, "");
  gst_debug_remove_log_function_by_data(&lines);
  (gst_debug_add_log_function)(gst_debug_log_default, nullptr, nullptr);
  gst_debug_unset_threshold_for_name("terrainmcapsink");
  EXPECT_EQ(lines, 40);
}

TEST_F(McapSink, SaysThatThereIsNoMetadata) {
  const Said said = run(scene + "terrainmcapsink location=" + at("drive.mcap"));
  EXPECT_EQ(said.error, "");
  EXPECT_NE(said.warning.find("No frame had terrain metadata"), std::string::npos) << said.warning;
  EXPECT_EQ(statistics_of(bytes_of(at("drive.mcap"))).messages, 0u);
}

} // namespace

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  gst_init(&argc, &argv);
  return RUN_ALL_TESTS();
}
