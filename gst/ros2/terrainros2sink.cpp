// SPDX-License-Identifier: LGPL-2.1-or-later

#include <gst/base/gstbasesink.h>
#include <gst/video/video.h>

#include <array>
#include <atomic>
#include <cstdlib>
#include <mutex>
#include <optional>
#include <string>
#include <utility>

#include "recording/frame_reader.hpp"
#include "recording/ros_inputs.hpp"
#include "ros2/names.hpp"
#include "ros2/participant.hpp"
#include "support/element.hpp"
#include "support/meta.hpp"
#include "support/times.hpp"
#include "terrainseg_config.h"

GST_DEBUG_CATEGORY_STATIC(terrainros2sink_debug);
#define GST_CAT_DEFAULT terrainros2sink_debug

using namespace terrainseg;

namespace {

using recording::Topic;
using recording::topic_count;

enum class Distribution : std::uint8_t { none, humble, jazzy };
enum class PoseType : std::uint8_t { odometry, pose_stamped, imu };
enum class NearType : std::uint8_t { boolean, range };

constexpr Choice distributions[] = {
    {"none", "No node is announced: topics only"},
    {"humble", "A node as ROS 2 Humble lists it"},
    {"jazzy", "A node as ROS 2 Iron, Jazzy and later list it"},
};
constexpr Choice pose_types[] = {
    {"odometry", "nav_msgs/msg/Odometry"},
    {"pose-stamped", "geometry_msgs/msg/PoseStamped"},
    {"imu", "sensor_msgs/msg/Imu"},
};
constexpr Choice near_types[] = {
    {"bool", "std_msgs/msg/Bool: true = clear"},
    {"range", "sensor_msgs/msg/Range: clear beyond near-clear-distance"},
};

struct SinkSettings {
  MessageSettings messages;
  std::string name_space;
  std::string node_name = "terrainseg";
  Distribution distribution = Distribution::none;
  std::string pose_topic;
  PoseType pose = PoseType::odometry;
  std::string near_topic;
  NearType near = NearType::boolean;
  double near_distance = 0.5;
};

/// The property with the name of a published topic.
struct TopicProperty {
  Topic topic;
  const char *stem, *nick, *what;
};
constexpr TopicProperty topics[] = {
    {Topic::scan, "scan", "Scan topic", "LaserScan"},
    {Topic::points, "points", "Points topic", "PointCloud2"},
    {Topic::grid, "grid", "Grid topic", "OccupancyGrid"},
    {Topic::mask, "mask", "Mask topic", "Image (mono8) of the mask"},
    {Topic::camera_info, "camera-info", "Camera info topic", "CameraInfo"},
    {Topic::video, "video", "Video topic", "CompressedVideo (H.264)"},
    {Topic::picture, "picture", "Picture topic", "CompressedImage (JPEG)"},
    {Topic::tf, "tf", "Transform topic", "TFMessage with the attitude at the frame"},
    {Topic::tf_static, "tf-static", "Static transform topic", "TFMessage of the mount"},
    {Topic::diagnostics, "diagnostics", "Diagnostics topic", "DiagnosticArray"},
};
static_assert(std::size(topics) == topic_count);

/// Sends the messages of a frame to the topics of a participant. Topics without a reader are not encoded,
/// except two that late readers get at once: the grid is sent every two seconds, the transform of the mount
/// once.
class Outlet : public recording::MessageOutlet {
 public:
  explicit Outlet(const ros2::Participant& participant) : participant_(participant) {}
  /// Opens a topic by its absolute name. Throws ros2::Problem.
  void open(Topic topic, const std::string& name) {
    ros2::check_name(name);
    const bool late = topic == Topic::grid || topic == Topic::tf_static;
    // A decoder needs every picture.
    const int depth = late ? 1 : topic == Topic::video ? 30 : 5;
    writers_[static_cast<std::size_t>(topic)] = std::make_unique<ros2::Writer>(
        participant_, name, recording::type_of(topic),
        late ? ros2::Durability::transient_local : ros2::Durability::volatile_data, depth);
  }
  /// Returns nullptr if the topic is not open.
  ros2::Writer* writer(Topic topic) const { return writers_[static_cast<std::size_t>(topic)].get(); }
  std::vector<dds_entity_t> entities() const {
    std::vector<dds_entity_t> entities;
    for (const auto& writer : writers_)
      if (writer)
        entities.push_back(writer->entity());
    return entities;
  }

  bool wants(Topic topic) override {
    const ros2::Writer* open = writer(topic);
    if (!open)
      return false;
    if (topic == Topic::tf_static)
      return !sent_static_;
    if (topic == Topic::grid && open->readers() == 0)
      return !last_grid_ || g_get_monotonic_time() - *last_grid_ >= 2 * G_USEC_PER_SEC;
    return open->readers() > 0;
  }
  /// A dropped message is not an error: the writer counts it.
  void put(Topic topic, std::uint64_t, recording::ByteView message) override {
    const bool written = writer(topic)->write(message);
    if (topic == Topic::grid)
      last_grid_ = g_get_monotonic_time();
    if (topic == Topic::tf_static)
      sent_static_ = written;
    if (topic == Topic::tf)
      sent_static_ = false;
  }

 private:
  const ros2::Participant& participant_;
  std::array<std::unique_ptr<ros2::Writer>, topic_count> writers_;
  std::optional<std::int64_t> last_grid_; ///< monotonic time, microseconds
  bool sent_static_ = false;              ///< sent, and no attitude of a frame sent since
};

/// Everything behind the instance.
struct Ros2State {
  GstElement* element = nullptr;
  SinkSettings settings;                       // under the object lock
  std::array<InternedName, topic_count> names; // of the topics

  std::mutex mutex; // guards what `stats` reads during construction and destruction
  std::unique_ptr<ros2::Participant> participant;     // streaming
  std::unique_ptr<Outlet> outlet;                     // streaming
  std::unique_ptr<ros2::Writer> node;                 // streaming
  std::unique_ptr<ros2::Reader> poses, near;          // streaming
  std::optional<recording::TerrainMessages> messages; // streaming
  PictureKind kind = PictureKind::raw;                // streaming
  bool warned_metadata = false;                       // streaming

  metric::Mount mount; // set before the readers are created
  std::atomic<std::uint64_t> frames = 0, taken = 0, refused = 0;
  enum Near : std::uint8_t { near_unknown, near_clear, near_blocked };
  std::atomic<Near> near_state = near_unknown; // an atomic optional would need libatomic
  std::atomic<bool> warned_input = false;

  Ros2State() noexcept { // the names are short strings and need no allocation
    for (std::size_t i = 0; i < topic_count; ++i)
      names[i] = recording::topic_kinds[i].name;
  }
};

/**
 * SECTION:element-terrainros2sink
 * @title: terrainros2sink
 * @short_description: terrain metadata and video as ROS 2 topics
 *
 * Sends the terrain metadata of video to ROS 2 over DDS, and the video with it when it is H.264 or JPEG. It
 * needs no installed ROS 2. Poses and the near-range sensor come back as events.
 *
 * ## Example launch line
 * |[
 * gst-launch-1.0 terrainscenesrc is-live=true ! terrainseg ! terrainros2sink
 * ]|
 *
 * Since: 0.2
 */
using GstTerrainRos2Sink = Instance<GstBaseSink, Ros2State>;
using GstTerrainRos2SinkClass = GstBaseSinkClass;

G_DEFINE_TYPE(GstTerrainRos2Sink, gst_terrain_ros2_sink, GST_TYPE_BASE_SINK)

// ---- what comes in ---------------------------------------------------------------------------------------

/// Sends an event upstream to terrainseg.
void push_upstream(Ros2State& s, GstStructure* fields) {
  gst_pad_push_event(GST_BASE_SINK_PAD(s.element), gst_event_new_custom(GST_EVENT_CUSTOM_UPSTREAM, fields));
}

/// Counts an invalid message, and warns about the first one.
void refuse(Ros2State& s, const char* what) {
  ++s.refused;
  if (!s.warned_input.exchange(true))
    GST_ELEMENT_WARNING(
        s.element, STREAM, FORMAT,
        ("A message on %s cannot be used: it is truncated, too long, big-endian or invalid.", what),
        (nullptr));
}

/// Converts a time of day to running time; uses the current time if the sender's clock is not this machine's.
/// Returns nothing while the pipeline is not playing.
std::optional<GstClockTime> running_time_at(Ros2State& s, std::uint64_t utc) {
  g_autoptr(GstClock) clock = gst_element_get_clock(s.element);
  if (!clock)
    return std::nullopt;
  const auto now =
      static_cast<GstClockTimeDiff>(gst_clock_get_time(clock) - gst_element_get_base_time(s.element));
  constexpr GstClockTimeDiff farthest = 2 * GST_SECOND;
  const GstClockTimeDiff age = g_get_real_time() * 1000 - static_cast<GstClockTimeDiff>(utc);
  const GstClockTimeDiff then = age > -farthest && age < farthest ? now - age : now;
  return then >= 0 ? std::optional<GstClockTime>(then) : std::nullopt;
}

void take_pose(Ros2State& s, std::optional<recording::Attitude> attitude) {
  if (!attitude)
    return refuse(s, "pose-topic");
  ++s.taken;
  const auto time = running_time_at(s, attitude->time);
  if (!time)
    return;
  const recording::CameraAngles angles = recording::camera_angles(attitude->rotation, s.mount);
  push_upstream(s, gst_structure_new("terrainseg-pose", "roll", G_TYPE_DOUBLE, angles.roll, "pitch",
                                     G_TYPE_DOUBLE, angles.pitch, "yaw", G_TYPE_DOUBLE, angles.yaw,
                                     "running-time", G_TYPE_UINT64, static_cast<guint64>(*time), nullptr));
}

void take_near(Ros2State& s, std::optional<bool> clear) {
  if (!clear)
    return refuse(s, "near-clear-topic");
  ++s.taken;
  const auto state = *clear ? Ros2State::near_clear : Ros2State::near_blocked;
  if (s.near_state.exchange(state) != state)
    push_upstream(s, gst_structure_new("terrainseg-near", "clear", G_TYPE_BOOLEAN, *clear, nullptr));
}

/// Creates a reader for a topic, if it has a name. `take` runs in a thread of DDS.
template <class Take>
std::unique_ptr<ros2::Reader> read(Ros2State& s, const SinkSettings& set, const std::string& topic,
                                   const char* type, Take take) {
  if (topic.empty())
    return nullptr;
  const std::string name = ros2::full_name(set.name_space, topic);
  ros2::check_name(name);
  return std::make_unique<ros2::Reader>(
      *s.participant, name, recording::message_type(type), recording::longest_input,
      [&s, take](recording::ByteView bytes) { guarded(s.element, [&] { take(bytes); }); });
}

void read_poses(Ros2State& s, const SinkSettings& set) {
  struct Kind {
    const char* type;
    std::optional<recording::Attitude> (*decode)(recording::ByteView);
  };
  constexpr Kind kinds[] = {{"nav_msgs/Odometry", recording::decode_odometry},
                            {"geometry_msgs/PoseStamped", recording::decode_pose_stamped},
                            {"sensor_msgs/Imu", recording::decode_imu}};
  const Kind& kind = kinds[static_cast<std::size_t>(set.pose)];
  s.poses = read(s, set, set.pose_topic, kind.type,
                 [&s, decode = kind.decode](recording::ByteView bytes) { take_pose(s, decode(bytes)); });
}

void read_near(Ros2State& s, const SinkSettings& set) {
  if (set.near == NearType::boolean)
    s.near = read(s, set, set.near_topic, "std_msgs/Bool",
                  [&s](recording::ByteView bytes) { take_near(s, recording::decode_bool(bytes)); });
  else
    s.near = read(s, set, set.near_topic, "sensor_msgs/Range",
                  [&s, distance = set.near_distance](recording::ByteView bytes) {
                    const auto range = recording::decode_range(bytes);
                    take_near(s, range ? std::optional(*range > distance) : std::nullopt);
                  });
}

// ---- the topics ------------------------------------------------------------------------------------------

void open_topic(Ros2State& s, const SinkSettings& set, Topic topic) {
  const char* name = s.names[static_cast<std::size_t>(topic)].c_str();
  if (*name && !s.outlet->writer(topic))
    s.outlet->open(topic, ros2::full_name(set.name_space, name));
}

/// Announces the topics as those of a node.
void announce(Ros2State& s, const SinkSettings& set) {
  if (set.distribution == Distribution::none)
    return;
  if (!s.node)
    s.node = std::make_unique<ros2::Writer>(*s.participant);
  std::vector<dds_entity_t> readers;
  for (const auto* reader : {s.poses.get(), s.near.get()})
    if (reader)
      readers.push_back(reader->entity());
  s.node->write(ros2::participant_entities(*s.participant, set.distribution == Distribution::humble ? 24 : 16,
                                           set.name_space.empty() ? "/" : ros2::full_name("", set.name_space),
                                           set.node_name, readers, s.outlet->entities()));
}

bool close_topics(Ros2State& s) {
  s.poses.reset(); // waits for a message in progress
  s.near.reset();
  const std::lock_guard lock(s.mutex);
  s.node.reset();
  s.outlet.reset();
  s.participant.reset();
  s.messages.reset();
  return true;
}

/// Creates everything that depends on the settings.
void make_topics(Ros2State& s, const SinkSettings& set, recording::MessageOptions options) {
  const auto get = +[](const char* name) -> const char* { return std::getenv(name); };
  const ros2::Discovery discovery = ros2::discovery_from(get);
  const std::lock_guard lock(s.mutex);
  s.participant = std::make_unique<ros2::Participant>(discovery, set.distribution != Distribution::none);
  s.outlet = std::make_unique<Outlet>(*s.participant);
  std::vector<Topic> wanted = {Topic::scan, Topic::points, Topic::grid, Topic::mask, Topic::diagnostics};
  if (options.camera)
    wanted.push_back(Topic::camera_info);
  if (options.mount)
    wanted.insert(wanted.end(), {Topic::tf, Topic::tf_static});
  s.messages.emplace(std::move(options));
  for (const Topic topic : wanted)
    open_topic(s, set, topic);
  read_poses(s, set);
  read_near(s, set);
  announce(s, set);
}

/// Runs `body`. Posts what it throws as an error, when the mutex is free: a handler may read `stats`.
template <class Body> bool reported(Ros2State& s, Body body) {
  try {
    body();
    return true;
  } catch (const ros2::Problem& problem) {
    GST_ELEMENT_ERROR(s.element, RESOURCE, FAILED, ("%s.", problem.what()), (nullptr));
    return false;
  }
}

bool start(Ros2State& s) {
  const SinkSettings set = locked_copy(s.element, s.settings);
  auto options = read_options(s.element, set.messages);
  if (!options)
    return false;
  s.mount = options->mount.value_or(metric::Mount{});
  s.frames = s.taken = s.refused = 0;
  s.near_state = Ros2State::near_unknown;
  s.warned_metadata = s.warned_input = false;
  const bool made = reported(s, [&] { make_topics(s, set, std::move(*options)); });
  if (!made)
    close_topics(s);
  return made;
}

// ---- frames ----------------------------------------------------------------------------------------------

/// The time of day of a frame: its own, or else the time at which it is due.
std::uint64_t time_of(Ros2State& s, GstBuffer* buffer) {
  if (const auto utc = utc_of(buffer))
    return *utc;
  const auto now = static_cast<std::uint64_t>(g_get_real_time()) * 1000;
  const GstClockTime due = running_time_of(GST_BASE_SINK(s.element)->segment, GST_BUFFER_PTS(buffer));
  g_autoptr(GstClock) clock = gst_element_get_clock(s.element);
  if (!clock || !GST_CLOCK_TIME_IS_VALID(due))
    return now;
  const GstClockTime running = gst_clock_get_time(clock) - gst_element_get_base_time(s.element);
  return now - running + due;
}

GstFlowReturn send(Ros2State& s, GstBuffer* buffer) {
  const FrameReader reader(buffer, s.kind, s.settings.messages.source.c_str());
  if (!reader.check(s.element, "receivers of messages", "sent", s.warned_metadata))
    return GST_FLOW_ERROR;
  recording::MessageFrame frame = reader.frame(time_of(s, buffer));
  const auto near = s.near_state.load();
  if (near != Ros2State::near_unknown)
    frame.near_clear = near == Ros2State::near_clear;
  GST_LOG_OBJECT(s.element, "%s at %" G_GUINT64_FORMAT ": %" GST_PTR_FORMAT, reader.content(), frame.time,
                 printable(buffer));
  ++s.frames;
  s.messages->add(frame, *s.outlet);
  return GST_FLOW_OK;
}

bool set_caps(Ros2State& s, GstCaps* caps) {
  GST_DEBUG_OBJECT(s.element, "caps %" GST_PTR_FORMAT, printable(caps));
  s.kind = kind_of(caps);
  if (s.kind == PictureKind::raw)
    return true;
  const SinkSettings set = locked_copy(s.element, s.settings);
  return reported(s, [&] {
    const std::lock_guard lock(s.mutex);
    open_topic(s, set, s.kind == PictureKind::h264 ? Topic::video : Topic::picture);
    announce(s, set);
  });
}

// ---- the object ------------------------------------------------------------------------------------------

GstStructure* statistics_of(gpointer object) {
  Ros2State& s = GstTerrainRos2Sink::state_of(object);
  const std::lock_guard lock(s.mutex);
  GstStructure* all = gst_structure_new("terrainros2sink-stats", "frames", G_TYPE_UINT64, s.frames.load(),
                                        "messages-taken", G_TYPE_UINT64, s.taken.load(), "messages-refused",
                                        G_TYPE_UINT64, s.refused.load(), nullptr);
  for (const TopicProperty& topic : topics)
    if (const ros2::Writer* writer = s.outlet ? s.outlet->writer(topic.topic) : nullptr) {
      g_autoptr(GstStructure) one =
          gst_structure_new(topic.stem, "readers", G_TYPE_UINT, writer->readers(), "written", G_TYPE_UINT64,
                            writer->written(), "dropped", G_TYPE_UINT64, writer->dropped(), nullptr);
      gst_structure_set(all, topic.stem, GST_TYPE_STRUCTURE, one, nullptr);
    }
  return all;
}

constexpr auto common = message_rows<&SinkSettings::messages>(
    "Calibration file of the camera (ROS, Kalibr or OpenCV YAML) for the topic of camera-info-topic, none = "
    "without this topic",
    "Pose of the camera over the ground (a file, or height=..,pitch=..) for the transform, and added to the "
    "poses of pose-topic; none = without a transform, and poses are those of the camera",
    "Size of a cell of the grid in metres, doubled until a side has at most 512 cells");
const Property<SinkSettings> table[] = {
    common[0],
    common[1],
    common[2],
    common[3],
    common[4],
    common[5],
    stats_row<SinkSettings>(
        "Counts since the start: frames, messages-taken and messages-refused; for each open topic readers "
        "(connected now), written and dropped (not accepted by DDS within 5 ms)",
        statistics_of),
    {"namespace", "Namespace", "Prefix of the node name and of topic names that do not begin with a slash",
     property_before_start, field<&SinkSettings::name_space>()},
    {"node-name", "Node name", "Name of the node that ROS 2 lists if distribution is set",
     property_before_start, field<&SinkSettings::node_name>()},
    {"distribution", "Distribution",
     "ROS 2 distribution for which the topics are announced as those of a node (ros_discovery_info)",
     property_before_start, field<&SinkSettings::distribution>("GstTerrainRos2Distribution", distributions)},
    {"pose-topic", "Pose topic",
     "Topic whose messages are sent upstream as terrainseg-pose events, none = poses are not read",
     property_before_start, field<&SinkSettings::pose_topic>()},
    {"pose-type", "Pose type", "Type of the messages on pose-topic", property_before_start,
     field<&SinkSettings::pose>("GstTerrainRos2PoseType", pose_types)},
    {"near-clear-topic", "Near-clear topic",
     "Topic whose messages are sent upstream as terrainseg-near events, none = the near-range sensor is not "
     "read",
     property_before_start, field<&SinkSettings::near_topic>()},
    {"near-clear-type", "Near-clear type", "Type of the messages on near-clear-topic", property_before_start,
     field<&SinkSettings::near>("GstTerrainRos2NearType", near_types)},
    {"near-clear-distance", "Near-clear distance",
     "Range in metres from which the training window is clear, for near-clear-type=range",
     property_before_start, field<&SinkSettings::near_distance>(0, 1000)},
};

constexpr guint first_topic_id = std::size(table) + 1;

void set_property(GObject* object, guint id, const GValue* value, GParamSpec* spec) {
  if (id < first_topic_id)
    return set_in_table<GstTerrainRos2Sink, table>(object, id, value, spec);
  const gchar* text = g_value_get_string(value);
  GstTerrainRos2Sink::state_of(object).names.at(id - first_topic_id) = text ? text : "";
}

void get_property(GObject* object, guint id, GValue* value, GParamSpec* spec) {
  if (id < first_topic_id)
    return get_in_table<GstTerrainRos2Sink, table>(object, id, value, spec);
  const char* name = GstTerrainRos2Sink::state_of(object).names.at(id - first_topic_id).c_str();
  g_value_set_static_string(value, *name ? name : nullptr);
}

void install_topics(GObjectClass* object_class) {
  for (guint i = 0; i < topic_count; ++i) {
    const TopicProperty& topic = topics[i];
    const std::string name = std::string(topic.stem) + "-topic";
    const std::string blurb = std::string("Name of the topic of the ") + topic.what + ", none = not sent";
    g_object_class_install_property(
        object_class, first_topic_id + i,
        g_param_spec_string(name.c_str(), topic.nick, blurb.c_str(), recording::topic_kinds[i].name,
                            static_cast<GParamFlags>(G_PARAM_READWRITE | GST_PARAM_MUTABLE_READY)));
  }
}

void gst_terrain_ros2_sink_class_init(GstTerrainRos2SinkClass* klass) {
  GST_DEBUG_CATEGORY_INIT(terrainros2sink_debug, "terrainros2sink", 0, "terrain metadata as ROS 2 topics");
  init_class<GstTerrainRos2Sink, gst_terrain_ros2_sink_parent_class, table>(
      klass, {"ROS 2 sink", "Sink/Network/Metadata/Video",
              "Sends terrain metadata and video as ROS 2 topics over DDS"});
  init_message_sink_class(klass);
  GstBaseSinkClass* sink_class = GST_BASE_SINK_CLASS(klass);
  sink_class->start = GstTerrainRos2Sink::call<start>;
  sink_class->stop = GstTerrainRos2Sink::call<close_topics>;
  sink_class->set_caps = GstTerrainRos2Sink::call<set_caps>;
  sink_class->render = GstTerrainRos2Sink::call<send>;
  GObjectClass* object_class = G_OBJECT_CLASS(klass);
  object_class->set_property = set_property;
  object_class->get_property = get_property;
  install_topics(object_class);
}

void gst_terrain_ros2_sink_init(GstTerrainRos2Sink* self) {
  self->make_state();
  gst_base_sink_set_last_sample_enabled(GST_BASE_SINK(self), FALSE);
}

} // namespace

GST_ELEMENT_REGISTER_DEFINE(terrainros2sink, "terrainros2sink", GST_RANK_NONE,
                            gst_terrain_ros2_sink_get_type())

// A separate plugin, so that the main one does not depend on Cyclone DDS.
static gboolean plugin_init(GstPlugin* plugin) {
  return register_metas() && GST_ELEMENT_REGISTER(terrainros2sink, plugin);
}

GST_PLUGIN_DEFINE(GST_VERSION_MAJOR, GST_VERSION_MINOR, terrainros2,
                  "Terrain metadata as ROS 2 topics over DDS", plugin_init, TERRAINSEG_VERSION, "LGPL",
                  "terrainseg", TERRAINSEG_ORIGIN)
