// SPDX-License-Identifier: LGPL-2.1-or-later
// The element terrainros2sink beside readers and writers in this process, which DDS matches without a network
// (ROS_AUTOMATIC_DISCOVERY_RANGE=OFF). Other implementations and networks: tests/ros2.sh.
#include <dds/dds.h>
#include <gst/gst.h>
#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <cmath>
#include <condition_variable>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <map>
#include <mutex>
#include <string>
#include <thread>

#include "owned.hpp"
#include "recording/cdr.hpp"
#include "recording/ros_inputs.hpp"
#include "recording/terrain_messages.hpp"
#include "ros2/names.hpp"
#include "ros2/participant.hpp"
#ifdef TERRAINSEG_WITH_MCAP
#include "../support/mcap_messages.hpp"
#endif

namespace {

using namespace terrainseg;
using recording::Bytes;
using recording::Topic;
using terrainseg::test::Owned;
using namespace std::chrono_literals;

constexpr auto patience = 20s;

ros2::Discovery discovery() {
  return {0, ros2::DiscoveryRange::off, {}};
}

struct Quality {
  bool reliable = true, late = false;
  int depth = 1000;
};

/// Keeps every message of a topic.
class Subscriber {
 public:
  Subscriber(const std::string& topic, const std::string& type, Quality quality = {}) {
    participant_ = std::make_unique<ros2::Participant>(discovery(), false);
    const ros2::RawTopic raw = ros2::create_raw_topic(participant_->entity(), topic, type);
    dds_qos_t* qos = dds_create_qos();
    dds_qset_reliability(qos, quality.reliable ? DDS_RELIABILITY_RELIABLE : DDS_RELIABILITY_BEST_EFFORT, 0);
    dds_qset_durability(qos, quality.late ? DDS_DURABILITY_TRANSIENT_LOCAL : DDS_DURABILITY_VOLATILE);
    dds_qset_history(qos, DDS_HISTORY_KEEP_LAST, quality.depth);
    reader_ = dds_create_reader(participant_->entity(), raw.entity, qos, nullptr);
    EXPECT_GT(reader_, 0);
    dds_delete_qos(qos);
  }
  Subscriber(const char* topic, Topic what, Quality quality = {})
      : Subscriber(ros2::dds_topic(topic), ros2::dds_type(recording::type_of(what).name), quality) {}

  /// What has come, as bytes.
  const std::vector<Bytes>& messages() {
    for (Bytes message; ros2::take_raw(reader_, message, 1 << 24);)
      messages_.push_back(message);
    return messages_;
  }
  bool waits_for(std::size_t count) {
    const auto end = std::chrono::steady_clock::now() + patience;
    while (messages().size() < count && std::chrono::steady_clock::now() < end)
      std::this_thread::sleep_for(5ms);
    return messages_.size() >= count;
  }

 private:
  std::unique_ptr<ros2::Participant> participant_;
  dds_entity_t reader_ = 0;
  std::vector<Bytes> messages_;
};

/// An element of a pipeline that goes on after it.
struct Unref {
  void operator()(GstElement* element) const { gst_object_unref(element); }
};
using Reference = std::unique_ptr<GstElement, Unref>;

/// A pipeline, and what it says.
class Pipeline {
 public:
  explicit Pipeline(const std::string& text) {
    GError* wrong = nullptr;
    pipeline_.reset(gst_parse_launch(text.c_str(), &wrong));
    EXPECT_EQ(wrong, nullptr) << (wrong ? wrong->message : "");
    g_clear_error(&wrong);
  }
  ~Pipeline() { gst_element_set_state(pipeline_.get(), GST_STATE_NULL); }
  void play() { gst_element_set_state(pipeline_.get(), GST_STATE_PLAYING); }
  void stop() { gst_element_set_state(pipeline_.get(), GST_STATE_NULL); }
  /// The next of these messages; its text when it is an error or a warning.
  std::string wait(int kinds) {
    const Owned<GstBus> bus(gst_element_get_bus(pipeline_.get()));
    const Owned<GstMessage> message(gst_bus_timed_pop_filtered(
        bus.get(), std::chrono::nanoseconds(patience).count(), static_cast<GstMessageType>(kinds)));
    if (!message) {
      ADD_FAILURE() << "nothing was said";
      return "";
    }
    GError* error = nullptr;
    if (GST_MESSAGE_TYPE(message.get()) == GST_MESSAGE_ERROR)
      gst_message_parse_error(message.get(), &error, nullptr);
    else if (GST_MESSAGE_TYPE(message.get()) == GST_MESSAGE_WARNING)
      gst_message_parse_warning(message.get(), &error, nullptr);
    std::string text = error ? error->message : "";
    g_clear_error(&error);
    return text;
  }
  std::string run() {
    play();
    return wait(GST_MESSAGE_ERROR | GST_MESSAGE_EOS);
  }
  Reference element(const char* name) {
    return Reference(gst_bin_get_by_name(GST_BIN(pipeline_.get()), name));
  }
  guint64 statistic(const char* field, const char* topic = nullptr) {
    GstStructure* all = nullptr;
    const Reference sink = element("out");
    g_object_get(sink.get(), "stats", &all, nullptr);
    const GstStructure* from = all;
    if (topic) {
      const GValue* value = gst_structure_get_value(all, topic);
      from = value ? gst_value_get_structure(value) : nullptr;
    }
    guint64 number = G_MAXUINT64;
    if (from && !gst_structure_get_uint64(from, field, &number)) {
      guint small = 0;
      if (gst_structure_get_uint(from, field, &small))
        number = small;
    }
    gst_structure_free(all);
    return number;
  }

 private:
  Owned<GstElement> pipeline_;
};

const std::string metres = "camera-info=" TERRAINSEG_TEST_CAMERA " mount=height=1.35,pitch=0.045 ";
const std::string scene = "terrainscenesrc num-buffers=40 ! video/x-raw,width=160,height=90,framerate=30/1 ! "
                          "terrainseg start-time=1700000000000000000 " +
                          metres + "! ";
const std::string live =
    "terrainscenesrc is-live=true ! video/x-raw,width=160,height=90,framerate=30/1 ! terrainseg " + metres +
    "! ";
const std::string sink = "terrainros2sink name=out sync=false " + metres;

class Ros2Sink : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    g_setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "OFF", TRUE);
    for (const char* name : {"ROS_DOMAIN_ID", "ROS_LOCALHOST_ONLY", "ROS_STATIC_PEERS", "CYCLONEDDS_URI"})
      g_unsetenv(name);
    std::ofstream(TERRAINSEG_TEST_CAMERA)
        << "image_width: 160\nimage_height: 90\n"
           "camera_matrix: {rows: 3, cols: 3, data: [131.2, 0, 79.5, 0, 131.2, 44.5, 0, 0, 1]}\n";
  }
};

struct Sent {
  const char* topic;
  Topic what;
  const char* recorded;
};

#ifdef TERRAINSEG_WITH_MCAP
/// The bytes of both sinks for the same frames.
void compare(const std::string& encoder, const std::vector<Sent>& sent) {
  const std::string file = TERRAINSEG_TEST_CAMERA ".mcap";
  std::filesystem::remove(file);
  std::vector<std::unique_ptr<Subscriber>> subscribers;
  for (const Sent& topic : sent)
    subscribers.push_back(std::make_unique<Subscriber>(topic.topic, topic.what));
  Pipeline pipeline(scene + encoder + "tee name=t t. ! queue ! " + sink + "t. ! queue ! terrainmcapsink " +
                    metres + "location=" + file);
  EXPECT_EQ(pipeline.run(), "");
  std::ifstream stream(file, std::ios::binary);
  auto recorded = test::mcap_messages({std::istreambuf_iterator<char>(stream), {}});
  for (std::size_t i = 0; i < sent.size(); ++i) {
    SCOPED_TRACE(sent[i].topic);
    auto& expected = recorded[sent[i].recorded];
    if (sent[i].what == Topic::tf_static)
      expected.resize(std::min<std::size_t>(expected.size(), 1)); // it does not change
    EXPECT_GE(expected.size(),
              sent[i].what == Topic::tf_static || sent[i].what == Topic::diagnostics ? 1u : 30u);
    EXPECT_EQ(subscribers[i]->messages(), expected);
  }
  EXPECT_EQ(pipeline.statistic("dropped", "scan"), 0u);
}

TEST_F(Ros2Sink, EveryTopicIsByteForByteWhatTheRecorderWrites) {
  compare("", {{"/terrain/scan", Topic::scan, "/terrain/scan"},
               {"/terrain/points", Topic::points, "/terrain/points"},
               {"/terrain/grid", Topic::grid, "/terrain/grid"},
               {"/terrain/mask", Topic::mask, "/terrain/mask"},
               {"/camera/camera_info", Topic::camera_info, "/camera/camera_info"},
               {"/tf_static", Topic::tf_static, "/tf"},
               {"/diagnostics", Topic::diagnostics, "/diagnostics"}});
}

TEST_F(Ros2Sink, VideoAndPicturesPassThrough) {
  compare("x264enc bframes=0 tune=zerolatency key-int-max=10 ! h264parse ! ",
          {{"/camera/video", Topic::video, "/camera/video"}});
  compare("jpegenc ! ", {{"/camera/image/compressed", Topic::picture, "/camera/image/compressed"}});
}
#endif

TEST_F(Ros2Sink, WhatNobodyReadsIsNotEncoded) {
  Pipeline pipeline(scene + sink);
  EXPECT_EQ(pipeline.run(), "");
  EXPECT_EQ(pipeline.statistic("frames"), 40u);
  for (const char* topic : {"scan", "points", "mask", "camera-info", "diagnostics", "tf"})
    EXPECT_EQ(pipeline.statistic("written", topic), 0u) << topic;
  EXPECT_EQ(pipeline.statistic("written", "tf-static"), 1u);
  EXPECT_GE(pipeline.statistic("written", "grid"), 1u);
  EXPECT_LE(pipeline.statistic("written", "grid"), 20u) << "every two seconds";
}

TEST_F(Ros2Sink, LateReadersGetTheGridAndTheTransform) {
  Pipeline pipeline(scene + sink);
  EXPECT_EQ(pipeline.run(), ""); // the frames are over
  Subscriber grid("/terrain/grid", Topic::grid, {true, true}),
      transform("/tf_static", Topic::tf_static, {true, true}),
      late_and_volatile("/terrain/grid", Topic::grid, {true, false});
  EXPECT_TRUE(grid.waits_for(1));
  EXPECT_TRUE(transform.waits_for(1));
  EXPECT_EQ(late_and_volatile.messages().size(), 0u);
}

TEST_F(Ros2Sink, ReadersOfEveryKindMatchWheneverTheyCome) {
  Subscriber early("/terrain/scan", Topic::scan), careless("/terrain/scan", Topic::scan, {false});
  Pipeline pipeline(live + sink);
  pipeline.play();
  EXPECT_TRUE(early.waits_for(3));
  EXPECT_TRUE(careless.waits_for(3));
  Subscriber late("/terrain/scan", Topic::scan);
  EXPECT_TRUE(late.waits_for(3));
  EXPECT_EQ(pipeline.statistic("readers", "scan"), 3u);
  EXPECT_EQ(pipeline.statistic("readers", "mask"), 0u);
}

TEST_F(Ros2Sink, StampsAreTheTimeOfDay) {
  Subscriber scans("/terrain/scan", Topic::scan);
  Pipeline pipeline(live + sink);
  pipeline.play();
  ASSERT_TRUE(scans.waits_for(1));
  std::int32_t seconds = 0;
  std::memcpy(&seconds, scans.messages()[0].data() + 4, sizeof seconds);
  EXPECT_NEAR(static_cast<double>(seconds), static_cast<double>(g_get_real_time()) / 1e6, 30);
}

TEST_F(Ros2Sink, TopicsHaveTheNamesThatAreSet) {
  Subscriber scans("/rover1/lidar", Topic::scan), mask("/mask", Topic::mask);
  Pipeline pipeline(scene + sink + "namespace=rover1 scan-topic=lidar mask-topic=/mask points-topic=\"\"");
  EXPECT_EQ(pipeline.run(), "");
  EXPECT_EQ(scans.messages().size(), 40u);
  EXPECT_EQ(mask.messages().size(), 40u);
  EXPECT_EQ(pipeline.statistic("readers", "points"), G_MAXUINT64) << "no such topic";
}

TEST_F(Ros2Sink, SaysWhatIsWrong) {
  EXPECT_NE(Pipeline(scene + sink + "scan-topic=2d/scan").run().find("\"/2d/scan\" is not a topic name"),
            std::string::npos);
  EXPECT_NE(Pipeline(scene + sink + "pose-topic=a//b").run().find("\"/a//b\" is not a topic name"),
            std::string::npos);
  EXPECT_NE(Pipeline(scene + sink + "mount=height=0").run().find("property mount cannot be used"),
            std::string::npos);
  EXPECT_NE(Pipeline(scene + "x264enc bframes=2 ! h264parse ! " + sink).run().find("B-frames"),
            std::string::npos);
  g_setenv("ROS_DOMAIN_ID", "many", TRUE);
  EXPECT_NE(Pipeline(scene + sink).run().find("ROS_DOMAIN_ID is \"many\""), std::string::npos);
  g_unsetenv("ROS_DOMAIN_ID");
}

// ---- what is announced -----------------------------------------------------------------------------------

/// USER_DATA of the writers that a participant sees, by topic.
std::map<std::string, std::string> announced() {
  std::map<std::string, std::string> found;
  const auto participant = std::make_unique<ros2::Participant>(discovery(), false);
  const dds_entity_t reader =
      dds_create_reader(participant->entity(), DDS_BUILTIN_TOPIC_DCPSPUBLICATION, nullptr, nullptr);
  void* samples[64] = {};
  dds_sample_info_t infos[64];
  const int count = dds_take(reader, samples, infos, 64, 64);
  for (int i = 0; i < count; ++i) {
    const auto* endpoint = static_cast<const dds_builtintopic_endpoint_t*>(samples[i]);
    void* data = nullptr;
    std::size_t size = 0;
    if (infos[i].valid_data && dds_qget_userdata(endpoint->qos, &data, &size)) {
      found[endpoint->topic_name] = std::string(static_cast<const char*>(data), size);
      dds_free(data);
    }
  }
  if (count > 0)
    dds_return_loan(reader, samples, count);
  return found;
}

TEST_F(Ros2Sink, AnnouncesTypeHashesAndNoNode) {
  Pipeline pipeline(scene + sink);
  EXPECT_EQ(pipeline.run(), "");
  const auto found = announced();
  EXPECT_EQ(found.at("rt/terrain/scan"),
            "typehash=" + recording::message_type("sensor_msgs/LaserScan").hash + ";");
  EXPECT_EQ(found.size(), 8u);
  EXPECT_EQ(found.count("ros_discovery_info"), 0u);
}

TEST_F(Ros2Sink, AnnouncesANodeInTheFormOfTheDistribution) {
  for (const auto& [distribution, gid] : std::map<std::string, std::size_t>{{"humble", 24}, {"jazzy", 16}}) {
    SCOPED_TRACE(distribution);
    Pipeline pipeline(scene + sink + "pose-topic=odom namespace=rover1 distribution=" + distribution);
    EXPECT_EQ(pipeline.run(), "");
    Subscriber nodes("ros_discovery_info", "rmw_dds_common::msg::dds_::ParticipantEntitiesInfo_",
                     {true, true});
    ASSERT_TRUE(nodes.waits_for(1));
    const Bytes message = nodes.messages().back();
    // Encapsulation, the participant, one node: its namespace and name, one reader, eight writers.
    std::size_t at = 4 + gid;
    const auto number = [&] {
      std::uint32_t value = 0;
      at = (at + 3) / 4 * 4;
      std::memcpy(&value, message.data() + at, sizeof value);
      at += sizeof value;
      return value;
    };
    const auto text = [&] {
      const std::uint32_t size = number();
      at += size;
      return std::string(message.begin() + static_cast<std::ptrdiff_t>(at - size),
                         message.begin() + static_cast<std::ptrdiff_t>(at - 1));
    };
    EXPECT_EQ(number(), 1u);
    EXPECT_EQ(text(), "/rover1");
    EXPECT_EQ(text(), "terrainseg");
    EXPECT_EQ(number(), 1u);
    at += gid;
    EXPECT_EQ(number(), 8u);
    EXPECT_EQ(at + 8 * gid, message.size());
    EXPECT_TRUE(std::equal(message.begin() + 4, message.begin() + 16,
                           message.begin() + static_cast<std::ptrdiff_t>(at)))
        << "the participant's prefix";
  }
}

// ---- what comes in ---------------------------------------------------------------------------------------

/// Writes a topic that the sink reads.
struct Publisher {
  Publisher(const char* topic, const recording::MessageType& type) {
    participant = std::make_unique<ros2::Participant>(discovery(), false);
    writer = std::make_unique<ros2::Writer>(*participant, topic, type, ros2::Durability::volatile_data, 10);
  }
  bool has_reader() const {
    const auto end = std::chrono::steady_clock::now() + patience;
    while (writer->readers() == 0 && std::chrono::steady_clock::now() < end)
      std::this_thread::sleep_for(5ms);
    return writer->readers() == 1;
  }
  std::unique_ptr<ros2::Participant> participant;
  std::unique_ptr<ros2::Writer> writer;
};

/// The events that leave the sink upstream.
class Events {
 public:
  explicit Events(Pipeline& pipeline) {
    const Reference sink = pipeline.element("out");
    const Owned<GstPad> pad(gst_element_get_static_pad(sink.get(), "sink"));
    gst_pad_add_probe(
        pad.get(), GST_PAD_PROBE_TYPE_EVENT_UPSTREAM,
        [](GstPad*, GstPadProbeInfo* info, gpointer self) {
          GstEvent* event = GST_PAD_PROBE_INFO_EVENT(info);
          if (GST_EVENT_TYPE(event) == GST_EVENT_CUSTOM_UPSTREAM)
            static_cast<Events*>(self)->add(gst_event_get_structure(event));
          return GST_PAD_PROBE_OK;
        },
        this, nullptr);
  }
  std::vector<std::string> wait_for(std::size_t count) {
    std::unique_lock lock(mutex_);
    changed_.wait_for(lock, patience, [&] { return texts_.size() >= count; });
    return texts_;
  }
  double last(const char* field) {
    const std::lock_guard lock(mutex_);
    return values_[field];
  }

 private:
  void add(const GstStructure* fields) {
    const std::lock_guard lock(mutex_);
    gboolean clear = FALSE;
    const bool near = gst_structure_get_boolean(fields, "clear", &clear);
    texts_.push_back(std::string(gst_structure_get_name(fields)) +
                     (near ? clear ? " clear" : " blocked" : ""));
    for (const char* field : {"roll", "pitch", "yaw"})
      gst_structure_get_double(fields, field, &values_[field]);
    guint64 time = 0;
    if (gst_structure_get_uint64(fields, "running-time", &time))
      values_["running-time"] = static_cast<double>(time);
    changed_.notify_all();
  }
  std::mutex mutex_;
  std::condition_variable changed_;
  std::vector<std::string> texts_;
  std::map<std::string, double> values_;
};

Bytes pose(double roll, double pitch, double seconds_ago) {
  Bytes bytes;
  recording::CdrWriter out(bytes);
  const double time = static_cast<double>(g_get_real_time()) / 1e6 - seconds_ago;
  out.put(static_cast<std::int32_t>(time));
  out.put(static_cast<std::uint32_t>((time - std::floor(time)) * 1e9));
  out.put("odom");
  for (int i = 0; i < 3; ++i)
    out.put(0.0);
  for (const double value : recording::rotation_of(1, pitch, roll))
    out.put(value);
  return bytes;
}

/// The pose of the metres of the frames that reach the sink, and their transform.
TEST_F(Ros2Sink, PosesBecomeEventsAndTurnTheMetres) {
  Subscriber transforms("/tf", Topic::tf);
  Publisher odometry("/pose", recording::message_type("geometry_msgs/PoseStamped"));
  Pipeline pipeline(live + sink + "pose-topic=pose pose-type=pose-stamped");
  Events events(pipeline);
  pipeline.play();
  ASSERT_TRUE(odometry.has_reader());
  const auto end = std::chrono::steady_clock::now() + patience;
  while (transforms.messages().empty() && std::chrono::steady_clock::now() < end) {
    odometry.writer->write(pose(0.02, 0.1, 0));
    std::this_thread::sleep_for(20ms);
  }
  EXPECT_FALSE(transforms.messages().empty()) << "metres with the attitude of the moment";
  EXPECT_EQ(events.wait_for(1).front(), "terrainseg-pose");
  EXPECT_NEAR(events.last("roll"), 0.02, 1e-3);
  EXPECT_NEAR(events.last("pitch"), 0.145, 1e-4) << "the mount's 0.045 on top";
  EXPECT_NEAR(events.last("yaw"), 0, 0.01) << "from the vehicle's nose";
  EXPECT_GE(pipeline.statistic("messages-taken"), 1u);
  EXPECT_EQ(pipeline.statistic("messages-refused"), 0u);
}

TEST_F(Ros2Sink, APoseIsOfTheTimeOfItsStamp) {
  Publisher poses("/pose", recording::message_type("geometry_msgs/PoseStamped"));
  Pipeline pipeline(live + sink + "pose-topic=pose pose-type=pose-stamped");
  Events events(pipeline);
  pipeline.play();
  ASSERT_TRUE(poses.has_reader());
  std::this_thread::sleep_for(1500ms); // so that a second ago the pipeline played
  const auto now = [&] {
    const Reference out = pipeline.element("out");
    const Owned<GstClock> clock(gst_element_get_clock(out.get()));
    return static_cast<double>(gst_clock_get_time(clock.get()) - gst_element_get_base_time(out.get())) / 1e9;
  };
  const auto age_of = [&](double seconds_ago, std::size_t count) {
    const double before = now();
    poses.writer->write(pose(0, 0, seconds_ago));
    EXPECT_EQ(events.wait_for(count).size(), count);
    return std::pair(before - events.last("running-time") / 1e9, now() - events.last("running-time") / 1e9);
  };
  const auto late = age_of(1, 1);
  EXPECT_LT(late.first, 1.001);
  EXPECT_GT(late.second, 0.999);
  const auto foreign = age_of(1e8, 2);
  EXPECT_LE(foreign.first, 0.001) << "another clock: the time of arrival";
  EXPECT_GE(foreign.second, 0);
}

TEST_F(Ros2Sink, TheNearRangeSensorBecomesNearClear) {
  Publisher bumper("/clear", recording::message_type("std_msgs/Bool"));
  Pipeline pipeline(live.substr(0, live.find("terrainseg ")) + "terrainseg name=filter ! " + sink +
                    "near-clear-topic=clear");
  Events events(pipeline);
  pipeline.play();
  ASSERT_TRUE(bumper.has_reader());
  for (const std::uint8_t value : {1, 1, 0, 0, 1})
    bumper.writer->write(Bytes{0, 1, 0, 0, value});
  EXPECT_EQ(events.wait_for(3), (std::vector<std::string>{"terrainseg-near clear", "terrainseg-near blocked",
                                                          "terrainseg-near clear"}));
  bumper.writer->write(Bytes{0, 1, 0, 0, 0});
  events.wait_for(4);
  const Reference filter = pipeline.element("filter");
  gboolean clear = TRUE;
  const auto end = std::chrono::steady_clock::now() + patience;
  while (clear && std::chrono::steady_clock::now() < end)
    g_object_get(filter.get(), "near-clear", &clear, nullptr);
  EXPECT_FALSE(clear);
}

TEST_F(Ros2Sink, ARangeIsClearBeyondTheDistance) {
  Publisher sonar("/sonar", recording::message_type("sensor_msgs/Range"));
  Pipeline pipeline(live + sink + "near-clear-topic=sonar near-clear-type=range near-clear-distance=0.4");
  Events events(pipeline);
  pipeline.play();
  ASSERT_TRUE(sonar.has_reader());
  for (const float range : {0.41F, 0.39F, HUGE_VALF, -HUGE_VALF}) {
    Bytes bytes;
    recording::CdrWriter out(bytes);
    out.put(std::int32_t{5});
    out.put(std::uint32_t{0});
    out.put("sonar");
    out.put(std::uint8_t{0});
    for (const float value : {0.1F, 0.02F, 4.0F, range})
      out.put(value);
    sonar.writer->write(bytes);
  }
  EXPECT_EQ(events.wait_for(4),
            (std::vector<std::string>{"terrainseg-near clear", "terrainseg-near blocked",
                                      "terrainseg-near clear", "terrainseg-near blocked"}));
}

TEST_F(Ros2Sink, RefusesWhatIsNoPose) {
  Publisher poses("/pose", recording::message_type("geometry_msgs/PoseStamped"));
  Pipeline pipeline(live + sink + "pose-topic=pose pose-type=pose-stamped");
  Events events(pipeline);
  pipeline.play();
  ASSERT_TRUE(poses.has_reader());
  Bytes cut = pose(0, 0, 0), other = pose(0, 0, 0), longer = pose(0, 0, 0);
  cut.pop_back();
  other[1] = 0; // big endian
  longer.resize(100'000);
  for (const Bytes& bytes : {cut, other, longer})
    poses.writer->write(bytes);
  EXPECT_NE(pipeline.wait(GST_MESSAGE_WARNING).find("A message on pose-topic cannot be used"),
            std::string::npos);
  poses.writer->write(pose(0, 0, 0));
  EXPECT_EQ(events.wait_for(1).size(), 1u);
  EXPECT_EQ(pipeline.statistic("messages-refused"), 3u);
  EXPECT_EQ(pipeline.statistic("messages-taken"), 1u);
}

TEST_F(Ros2Sink, TwoSinksShareADomainAndEndOneByOne) {
  Subscriber one("/a/terrain/mask", Topic::mask), two("/b/terrain/mask", Topic::mask);
  Pipeline first(live + sink + "namespace=a"), second(live + sink + "namespace=b");
  first.play();
  second.play();
  EXPECT_TRUE(one.waits_for(2));
  EXPECT_TRUE(two.waits_for(2));
  first.stop();
  EXPECT_TRUE(two.waits_for(two.messages().size() + 3));
  first.play();
  EXPECT_TRUE(one.waits_for(one.messages().size() + 3));
}

} // namespace

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  gst_init(&argc, &argv);
  return RUN_ALL_TESTS();
}
