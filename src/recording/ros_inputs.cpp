// SPDX-License-Identifier: LGPL-2.1-or-later
#include "recording/ros_inputs.hpp"

#include <algorithm>
#include <cmath>

#include "recording/cdr_reader.hpp"
#include "recording/message_parts.hpp"
#include "recording/rotation.hpp"

namespace terrainseg::recording {
namespace {

/// Nanoseconds. Nothing if the time is before 1970 or the nanoseconds are a second or more.
std::optional<std::uint64_t> read_header(CdrReader& in) {
  const std::int32_t seconds = in.i32();
  const std::uint32_t nanoseconds = in.u32();
  in.string(); // frame_id
  if (seconds < 0 || nanoseconds >= second)
    return std::nullopt;
  return static_cast<std::uint64_t>(seconds) * second + nanoseconds;
}

Quaternion read_quaternion(CdrReader& in) {
  Quaternion q;
  for (double& value : q)
    value = in.f64();
  return q;
}

/// The attitude if the whole message was read and the quaternion is a rotation: a length of 1 +- 0.01.
std::optional<Attitude> checked(const CdrReader& in, std::optional<std::uint64_t> time, Quaternion q) {
  const double length = std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
  if (!in.whole() || !time || !(std::abs(length - 1) < 0.01)) // refuses NaN too
    return std::nullopt;
  for (double& value : q)
    value /= length;
  return Attitude{*time, q};
}

bool fits(ByteView message) {
  return message.size() <= longest_input;
}

} // namespace

MessageType odometry_type() {
  return {
      "nav_msgs/msg/Odometry",
      schema("std_msgs/Header header\nstring child_frame_id\ngeometry_msgs/PoseWithCovariance pose\n"
             "geometry_msgs/TwistWithCovariance twist\n",
             {header_type,
              time_type,
              {"geometry_msgs/PoseWithCovariance", "geometry_msgs/Pose pose\nfloat64[36] covariance\n"},
              pose_type,
              point_type,
              quaternion_type,
              {"geometry_msgs/TwistWithCovariance", "geometry_msgs/Twist twist\nfloat64[36] covariance\n"},
              {"geometry_msgs/Twist", "geometry_msgs/Vector3 linear\ngeometry_msgs/Vector3 angular\n"},
              vector_type})};
}

MessageType pose_stamped_type() {
  return {"geometry_msgs/msg/PoseStamped",
          schema("std_msgs/Header header\ngeometry_msgs/Pose pose\n",
                 {header_type, time_type, pose_type, point_type, quaternion_type})};
}

MessageType imu_type() {
  return {"sensor_msgs/msg/Imu",
          schema("std_msgs/Header header\ngeometry_msgs/Quaternion orientation\n"
                 "float64[9] orientation_covariance\ngeometry_msgs/Vector3 angular_velocity\n"
                 "float64[9] angular_velocity_covariance\ngeometry_msgs/Vector3 linear_acceleration\n"
                 "float64[9] linear_acceleration_covariance\n",
                 {header_type, time_type, quaternion_type, vector_type})};
}

MessageType bool_type() {
  return {"std_msgs/msg/Bool", schema("bool data\n", {})};
}

MessageType range_type() {
  return {"sensor_msgs/msg/Range",
          schema("std_msgs/Header header\nuint8 ULTRASOUND=0\nuint8 INFRARED=1\nuint8 radiation_type\n"
                 "float32 field_of_view\nfloat32 min_range\nfloat32 max_range\nfloat32 range\n"
                 "float32 variance\n",
                 {header_type, time_type})};
}

std::optional<Attitude> decode_odometry(ByteView message) {
  if (!fits(message))
    return std::nullopt;
  CdrReader in(message);
  const auto time = read_header(in);
  in.string();      // child_frame_id
  in.skip_reals(3); // position
  const Quaternion rotation = read_quaternion(in);
  in.skip_reals(36 + 6 + 36); // its covariance, twist, its covariance
  return checked(in, time, rotation);
}

std::optional<Attitude> decode_pose_stamped(ByteView message) {
  if (!fits(message))
    return std::nullopt;
  CdrReader in(message);
  const auto time = read_header(in);
  in.skip_reals(3); // position
  const Quaternion rotation = read_quaternion(in);
  return checked(in, time, rotation);
}

std::optional<Attitude> decode_imu(ByteView message) {
  if (!fits(message))
    return std::nullopt;
  CdrReader in(message);
  const auto time = read_header(in);
  const Quaternion rotation = read_quaternion(in);
  constexpr double no_orientation = -1; // first element of the covariance, as sensor_msgs/msg/Imu defines it
  if (in.f64() == no_orientation)
    return std::nullopt;
  in.skip_reals(8 + 3 + 9 + 3 + 9);
  return checked(in, time, rotation);
}

std::optional<bool> decode_bool(ByteView message) {
  CdrReader in(message);
  const bool value = in.boolean();
  return in.whole() ? std::optional(value) : std::nullopt;
}

std::optional<float> decode_range(ByteView message) {
  if (!fits(message))
    return std::nullopt;
  CdrReader in(message);
  const auto time = read_header(in);
  in.u8();                    // radiation_type
  for (int i = 0; i < 3; ++i) // field_of_view, min_range, max_range
    in.f32();
  const float range = in.f32();
  if (in.left() >= sizeof(float))
    in.f32(); // variance
  return in.whole() && time && !std::isnan(range) ? std::optional(range) : std::nullopt;
}

CameraAngles camera_angles(const std::array<double, 4>& vehicle, const metric::Mount& mount) {
  const auto angles = [](const Quaternion& q) {
    const auto [x, y, z, w] = q;
    return CameraAngles{std::atan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y)),
                        std::asin(std::clamp(2 * (w * y - z * x), -1.0, 1.0)),
                        std::atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))};
  };
  const CameraAngles body = angles(vehicle);
  return angles(
      product(rotation_of(0, body.pitch, body.roll), rotation_of(mount.yaw, mount.pitch, mount.roll)));
}

} // namespace terrainseg::recording
