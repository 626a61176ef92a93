// SPDX-License-Identifier: LGPL-2.1-or-later
// The ROS 2 messages that are received: the vehicle's attitude and its near-range sensor. They are untrusted.
#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "metric/mount.hpp"
#include "recording/ros_messages.hpp"

namespace terrainseg::recording {

/// The orientation of the vehicle at a time.
struct Attitude {
  std::uint64_t time = 0;                     ///< nanoseconds since 1970, 0 = no time stamp
  std::array<double, 4> rotation{0, 0, 0, 1}; ///< unit quaternion x, y, z, w: from the body to a level frame
};

/// Each returns nothing if the message is truncated, too long, big-endian or invalid: a time before 1970, a
/// quaternion that is not a rotation, an Imu without orientation.
std::optional<Attitude> decode_odometry(ByteView message);
std::optional<Attitude> decode_pose_stamped(ByteView message);
std::optional<Attitude> decode_imu(ByteView message);
std::optional<bool> decode_bool(ByteView message); ///< std_msgs/msg/Bool
/// Range in metres as in sensor_msgs/msg/Range (REP 117): -infinity = too close to measure, +infinity = no
/// object. The field `variance`, new in Jazzy, is optional.
std::optional<float> decode_range(ByteView message);

/// Longest message in bytes. The names in a message may have some hundred characters.
inline constexpr std::size_t longest_input = 4096;

/// The camera's angles in radians: the vehicle's roll and pitch combined with the mount's rotation. The yaw
/// is relative to the vehicle.
struct CameraAngles {
  double roll, pitch, yaw;
};
CameraAngles camera_angles(const std::array<double, 4>& vehicle, const metric::Mount& mount);

} // namespace terrainseg::recording
