// SPDX-License-Identifier: LGPL-2.1-or-later
// Names, type hashes and discovery of ROS 2, and the messages that come in.
#include <glib.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <limits>
#include <map>
#include <numbers>
#include <sstream>
#include <string>
#include <vector>

#include "metric/mount.hpp"
#include "recording/cdr.hpp"
#include "recording/ros_inputs.hpp"
#include "recording/terrain_messages.hpp"
#include "ros2/names.hpp"

namespace terrainseg::ros2 {
namespace {

using recording::Bytes;
using recording::CdrWriter;

/// std_msgs/msg/Header for std_msgs/Header.
std::string long_name(const std::string& name) {
  const std::size_t slash = name.find('/');
  return name.substr(0, slash) + "/msg" + name.substr(slash);
}

/// A member as the type description of REP 2016 has it: `float64[36] covariance`, `geometry_msgs/Pose[] a`.
std::string field_of(const std::string& type, const std::string& name) {
  // Numbers of type_description_interfaces/msg/FieldType.
  const std::map<std::string, int> primitives = {
      {"int8", 2},   {"uint8", 3}, {"int16", 4},  {"uint16", 5},   {"int32", 6},
      {"uint32", 7}, {"int64", 8}, {"uint64", 9}, {"float32", 10}, {"float64", 11},
      {"char", 13},  {"bool", 15}, {"byte", 16},  {"string", 17}};
  const int nested_type = 1, array_offset = 48, sequence_offset = 144;
  const std::size_t bracket = type.find('[');
  const std::string element = type.substr(0, bracket);
  const bool nested = primitives.count(element) == 0;
  int id = nested ? nested_type : primitives.at(element), capacity = 0;
  if (bracket != std::string::npos) {
    capacity = std::atoi(type.c_str() + bracket + 1);
    id += capacity > 0 ? array_offset : sequence_offset;
  }
  return "{\"name\": \"" + name + "\", \"type\": {\"type_id\": " + std::to_string(id) +
         ", \"capacity\": " + std::to_string(capacity) +
         ", \"string_capacity\": 0, \"nested_type_name\": \"" + (nested ? long_name(element) : "") + "\"}}";
}

/// The hash that belongs to a definition: the SHA-256 of its type description as JSON (REP 2011).
std::string hash_of(const std::string& type, const std::string& text) {
  std::map<std::string, std::string> parts; // descriptions of the used types, by name
  std::string name = type, fields, main;
  const auto finish = [&] {
    std::string& into = main.empty() ? main : parts[name];
    into = "{\"type_name\": \"" + name + "\", \"fields\": [" + fields + "]}";
    fields.clear();
  };
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);) {
    if (line.starts_with("====")) {
      finish();
    } else if (line.starts_with("MSG: ")) {
      name = long_name(line.substr(5));
    } else if (const std::size_t space = line.find(' ');
               space != std::string::npos && line.find('=', space) == std::string::npos) { // not a constant
      fields += (fields.empty() ? "" : ", ") + field_of(line.substr(0, space), line.substr(space + 1));
    }
  }
  finish();
  std::string referenced;
  for (const auto& [part, description] : parts)
    referenced += (referenced.empty() ? "" : ", ") + description;
  const std::string json =
      "{\"type_description\": " + main + ", \"referenced_type_descriptions\": [" + referenced + "]}";
  g_autofree gchar* sum = g_compute_checksum_for_string(G_CHECKSUM_SHA256, json.c_str(), -1);
  return std::string("RIHS01_") + sum;
}

std::vector<recording::MessageType> all_types() {
  std::vector<recording::MessageType> types;
  for (std::size_t i = 0; i < recording::topic_count; ++i)
    types.push_back(recording::type_of(static_cast<recording::Topic>(i)));
  for (const char* name : {"nav_msgs/Odometry", "geometry_msgs/PoseStamped", "sensor_msgs/Imu",
                           "std_msgs/Bool", "sensor_msgs/Range"})
    types.push_back(recording::message_type(name));
  return types;
}

TEST(TypeHash, BelongsToTheDefinition) {
  for (const recording::MessageType& type : all_types())
    EXPECT_EQ(type.hash, hash_of(type.name, type.text)) << type.name;
}

TEST(TypeHash, IsThatOfTheDistributions) {
  // As ROS 2 Jazzy announces them.
  const std::map<std::string, std::string> known = {
      {"std_msgs/msg/String", "df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18"},
      {"sensor_msgs/msg/LaserScan", "64c191398013af96509d518dac71d5164f9382553fce5c1f8cca5be7924bd828"},
      {"sensor_msgs/msg/PointCloud2", "9198cabf7da3796ae6fe19c4cb3bdd3525492988c70522628af5daa124bae2b5"},
      {"sensor_msgs/msg/CameraInfo", "b3dfd68ff46c9d56c80fd3bd4ed22c7a4ddce8c8348f2f59c299e73118e7e275"},
      {"sensor_msgs/msg/Image", "d31d41a9a4c4bc8eae9be757b0beed306564f7526c88ea6a4588fb9582527d47"},
      {"tf2_msgs/msg/TFMessage", "e369d0f05a23ae52508854b66f6aa0437f3449d652e8cbf22d5abe85d020f087"},
      {"nav_msgs/msg/Odometry", "3cc97dc7fb7502f8714462c526d369e35b603cfc34d946e3f2eda2766dfec6e0"},
      {"sensor_msgs/msg/Imu", "7d9a00ff131080897a5ec7e26e315954b8eae3353c3f995c55faf71574000b5b"},
      {"diagnostic_msgs/msg/DiagnosticArray",
       "5a8a36efb05fb25070fa0fb3810290c0e6cd4862b54a8fb975a1ee8dc55a333e"},
      {"sensor_msgs/msg/Range", "b42b62562e93cbfe9d42b82fe5994dfa3d63d7d5c90a317981703f7388adff3a"},
  };
  std::map<std::string, std::string> ours = {
      {"std_msgs/msg/String", hash_of("std_msgs/msg/String", "string data\n")}};
  for (const recording::MessageType& type : all_types())
    ours[type.name] = type.hash;
  for (const auto& [name, hash] : known)
    EXPECT_EQ(ours[name], "RIHS01_" + hash) << name;
}

TEST(Names, AreThoseOfRos2) {
  EXPECT_EQ(full_name("", "terrain/scan"), "/terrain/scan");
  EXPECT_EQ(full_name("rover1", "terrain/scan"), "/rover1/terrain/scan");
  EXPECT_EQ(full_name("/fleet/rover1", "scan"), "/fleet/rover1/scan");
  EXPECT_EQ(full_name("rover1", "/tf"), "/tf");
  EXPECT_EQ(dds_topic("/terrain/scan"), "rt/terrain/scan");
  EXPECT_EQ(dds_type("sensor_msgs/msg/LaserScan"), "sensor_msgs::msg::dds_::LaserScan_");
  for (const char* name : {"/tf", "/terrain/scan", "/_a/b2"})
    EXPECT_NO_THROW(check_name(name)) << name;
  for (const char* name : {"", "/", "tf", "//tf", "/a//b", "/a/", "/2a", "/a/2b", "/a b", "/a-b", "/~a"})
    EXPECT_THROW(check_name(name), Problem) << name;
  EXPECT_THROW(check_name("/" + std::string(300, 'a')), Problem);
}

std::map<std::string, std::string> environment;
const char* get(const char* name) {
  const auto found = environment.find(name);
  return found == environment.end() ? nullptr : found->second.c_str();
}

std::optional<Discovery> discovery_of(std::map<std::string, std::string> variables,
                                      std::string* said = nullptr) {
  environment = std::move(variables);
  try {
    return discovery_from(get);
  } catch (const Problem& problem) {
    if (said)
      *said = problem.what();
    return std::nullopt;
  }
}

TEST(Discovery, IsLocalhostUnlessTheEnvironmentSaysOtherwise) {
  EXPECT_EQ(discovery_of({})->range, DiscoveryRange::localhost);
  EXPECT_EQ(discovery_of({})->domain, 0u);
  EXPECT_EQ(discovery_of({{"ROS_DOMAIN_ID", "42"}})->domain, 42u);
  EXPECT_EQ(discovery_of({{"ROS_DOMAIN_ID", "42"}})->range, DiscoveryRange::localhost);
  EXPECT_EQ(discovery_of({{"ROS_LOCALHOST_ONLY", "0"}})->range, DiscoveryRange::subnet);
  EXPECT_EQ(discovery_of({{"ROS_AUTOMATIC_DISCOVERY_RANGE", "SUBNET"}})->range, DiscoveryRange::subnet);
  EXPECT_EQ(discovery_of({{"ROS_AUTOMATIC_DISCOVERY_RANGE", "OFF"}, {"ROS_LOCALHOST_ONLY", "0"}})->range,
            DiscoveryRange::off);
  EXPECT_EQ(discovery_of({{"ROS_AUTOMATIC_DISCOVERY_RANGE", "SUBNET"}, {"ROS_LOCALHOST_ONLY", "1"}})->range,
            DiscoveryRange::localhost)
      << "as in ROS 2 the older variable wins when it restricts";
  EXPECT_EQ(discovery_of({{"ROS_STATIC_PEERS", "192.168.0.2;;rover"}})->peers,
            (std::vector<std::string>{"192.168.0.2", "rover"}));
}

TEST(Discovery, SaysWhichVariableIsWrong) {
  for (const auto& [name, value] :
       std::map<std::string, std::string>{{"ROS_DOMAIN_ID", "x"},
                                          {"ROS_AUTOMATIC_DISCOVERY_RANGE", "NEAR"},
                                          {"ROS_LOCALHOST_ONLY", "yes"}}) {
    std::string said;
    EXPECT_FALSE(discovery_of({{name, value}}, &said));
    EXPECT_NE(said.find(name + " is \"" + value + "\""), std::string::npos) << said;
  }
  for (const char* domain : {"233", "-1", "1 ", "99999999999999999999"})
    EXPECT_FALSE(discovery_of({{"ROS_DOMAIN_ID", domain}})) << domain;
}

TEST(Discovery, MulticastIsOffOnLocalhost) {
  const std::string local = cyclone_config({});
  EXPECT_NE(local.find("<AllowMulticast>false</AllowMulticast>"), std::string::npos) << local;
  EXPECT_NE(local.find("<Peer address=\"127.0.0.1\"/>"), std::string::npos) << local;
  const std::string subnet = cyclone_config({0, DiscoveryRange::subnet, {"a\"<b"}});
  EXPECT_EQ(subnet.find("AllowMulticast"), std::string::npos) << subnet;
  EXPECT_EQ(subnet.find("127.0.0.1"), std::string::npos) << subnet;
  EXPECT_NE(subnet.find("<Peer address=\"a&quot;&lt;b\"/>"), std::string::npos) << subnet;
  EXPECT_NE(cyclone_config({0, DiscoveryRange::off, {}}).find("<Tag>"), std::string::npos);
}

// ---- what comes in ---------------------------------------------------------------------------------------

void put_header(CdrWriter& out) {
  out.put(std::int32_t{1'700'000'000});
  out.put(std::uint32_t{250'000'000});
  out.put("odom");
}

void put_reals(CdrWriter& out, int count, double value = 0.5) {
  for (int i = 0; i < count; ++i)
    out.put(value);
}

void put_rotation(CdrWriter& out, const recording::Quaternion& q) {
  for (const double value : q)
    out.put(value);
}

const recording::Quaternion turned = recording::rotation_of(0.7, 0.1, -0.2);

Bytes odometry(const recording::Quaternion& q = turned) {
  Bytes bytes;
  CdrWriter out(bytes);
  put_header(out);
  out.put("base_link");
  put_reals(out, 3);
  put_rotation(out, q);
  put_reals(out, 36 + 6 + 36);
  return bytes;
}

Bytes pose_stamped() {
  Bytes bytes;
  CdrWriter out(bytes);
  put_header(out);
  put_reals(out, 3);
  put_rotation(out, turned);
  return bytes;
}

Bytes imu(double first_covariance = 0) {
  Bytes bytes;
  CdrWriter out(bytes);
  put_header(out);
  put_rotation(out, turned);
  put_reals(out, 1, first_covariance);
  put_reals(out, 8 + 3 + 9 + 3 + 9);
  return bytes;
}

Bytes range(float value, bool variance) {
  Bytes bytes;
  CdrWriter out(bytes);
  put_header(out);
  out.put(std::uint8_t{1});
  for (const float v : {0.1F, 0.02F, 4.0F, value})
    out.put(v);
  if (variance)
    out.put(0.01F);
  return bytes;
}

TEST(RosInputs, AttitudesAreRead) {
  for (const auto& read : {recording::decode_odometry(odometry()),
                           recording::decode_pose_stamped(pose_stamped()), recording::decode_imu(imu())}) {
    ASSERT_TRUE(read);
    EXPECT_EQ(read->time, 1'700'000'000'250'000'000u);
    for (std::size_t i = 0; i < 4; ++i)
      EXPECT_NEAR(read->rotation[i], turned[i], 1e-15);
  }
  EXPECT_FALSE(recording::decode_imu(imu(-1))) << "an Imu that does not know its orientation";
}

TEST(RosInputs, AQuaternionMustBeARotation) {
  constexpr double nan = std::numeric_limits<double>::quiet_NaN(),
                   inf = std::numeric_limits<double>::infinity();
  EXPECT_TRUE(recording::decode_odometry(odometry({0, 0, 0, 1.005})));
  for (const recording::Quaternion& q :
       {recording::Quaternion{0, 0, 0, 0}, {0, 0, 0, 1.1}, {nan, 0, 0, 1}, {0, inf, 0, 1}, {0, 0, 0, 1e300}})
    EXPECT_FALSE(recording::decode_odometry(odometry(q)));
}

TEST(RosInputs, TheNearRangeSensorIsRead) {
  EXPECT_EQ(recording::decode_bool(Bytes{0, 1, 0, 0, 1}), std::optional(true));
  EXPECT_EQ(recording::decode_bool(Bytes{0, 1, 0, 0, 0, 0, 0, 0}), std::optional(false)) << "filled up";
  EXPECT_FALSE(recording::decode_bool(Bytes{0, 1, 0, 0, 2}));
  EXPECT_FALSE(recording::decode_bool(Bytes{0, 1, 0, 0}));
  for (const bool variance : {false, true}) {
    EXPECT_EQ(recording::decode_range(range(1.5F, variance)), std::optional(1.5F)) << "Humble, Jazzy";
    EXPECT_EQ(recording::decode_range(range(-std::numeric_limits<float>::infinity(), variance)),
              std::optional(-std::numeric_limits<float>::infinity()));
    EXPECT_FALSE(recording::decode_range(range(std::numeric_limits<float>::quiet_NaN(), variance)));
  }
}

/// Cut at every length, in another encoding, too long: nothing, and no byte beyond the end is read (the
/// sanitizers see to that).
template <class Decode> void refuses_damage(const Bytes& whole, Decode decode) {
  ASSERT_TRUE(decode(whole));
  for (std::size_t size = 0; size < whole.size(); ++size)
    EXPECT_FALSE(decode(Bytes(whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(size)))) << size;
  for (const std::uint8_t encoding : {0, 2, 3, 7, 9}) {
    Bytes other = whole;
    other[1] = encoding;
    EXPECT_FALSE(decode(other)) << "0 = big endian: " << int{encoding};
  }
  Bytes longer = whole;
  longer.resize((whole.size() + 3) / 4 * 4 + 4);
  EXPECT_FALSE(decode(longer));
  longer.resize(1 << 20);
  EXPECT_FALSE(decode(longer));
}

TEST(RosInputs, DamagedMessagesAreRefused) {
  refuses_damage(odometry(), recording::decode_odometry);
  refuses_damage(pose_stamped(), recording::decode_pose_stamped);
  refuses_damage(imu(), recording::decode_imu);
  refuses_damage(Bytes{0, 1, 0, 0, 1}, recording::decode_bool);
  Bytes lying = odometry(); // a frame_id that claims to be longer than the message
  lying[12] = lying[13] = lying[14] = lying[15] = 0xff;
  EXPECT_FALSE(recording::decode_odometry(lying));
  Bytes early = odometry(); // before 1970
  early[7] = 0x80;
  EXPECT_FALSE(recording::decode_odometry(early));
  Bytes long_second = odometry();
  long_second[11] = 0x7f;
  EXPECT_FALSE(recording::decode_odometry(long_second));
}

TEST(CameraAngles, AreTheMountsOnTopOfTheVehicles) {
  using recording::camera_angles, recording::rotation_of;
  metric::Mount mount{0.5};
  const auto level = camera_angles(rotation_of(2, 0.1, -0.2), mount);
  EXPECT_NEAR(level.roll, -0.2, 1e-12);
  EXPECT_NEAR(level.pitch, 0.1, 1e-12);
  EXPECT_NEAR(level.yaw, 0, 1e-12) << "where the vehicle heads does not count";
  mount.pitch = 0.3;
  EXPECT_NEAR(camera_angles(rotation_of(-1, 0.1, 0), mount).pitch, 0.4, 1e-12);
  mount = {0.5, 0, 0, std::numbers::pi / 2}; // looks to the left
  const double pitch = 0.1, roll = 0.2;
  const auto left = camera_angles(rotation_of(0, pitch, roll), mount);
  EXPECT_NEAR(left.pitch, -std::asin(std::cos(pitch) * std::sin(roll)), 1e-12)
      << "the vehicle's left rises: the camera looks up";
  EXPECT_NEAR(left.roll, std::atan2(std::sin(pitch), std::cos(pitch) * std::cos(roll)), 1e-12)
      << "the camera's right is the vehicle's front, which is down";
}

} // namespace
} // namespace terrainseg::ros2
