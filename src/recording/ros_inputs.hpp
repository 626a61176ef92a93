// SPDX-License-Identifier: LGPL-2.1-or-later
// The ROS 2 messages that come in: the vehicle's attitude and its near-range sensor. Anybody may send them.
#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "metric/mount.hpp"
#include "recording/ros_messages.hpp"

namespace terrainseg::recording {

MessageType odometry_type();     ///< nav_msgs/msg/Odometry
MessageType pose_stamped_type(); ///< geometry_msgs/msg/PoseStamped
MessageType imu_type();          ///< sensor_msgs/msg/Imu
MessageType bool_type();         ///< std_msgs/msg/Bool
MessageType range_type();        ///< sensor_msgs/msg/Range, as of Jazzy

/// The vehicle's orientation at a time.
struct Attitude {
  std::uint64_t time = 0;                     ///< nanoseconds since 1970, 0 = not stamped
  std::array<double, 4> rotation{0, 0, 0, 1}; ///< unit quaternion x, y, z, w: the body in a level frame
};

/// Each is nothing when the message is cut, too long, big endian, or holds what cannot be: a time before
/// 1970, a quaternion that is not a rotation, an Imu without an orientation.
std::optional<Attitude> decode_odometry(ByteView message);
std::optional<Attitude> decode_pose_stamped(ByteView message);
std::optional<Attitude> decode_imu(ByteView message);
std::optional<bool> decode_bool(ByteView message);
/// Metres as sensor_msgs/msg/Range has them (REP 117): -infinity = too close to measure, +infinity = nothing
/// in range; with and without the variance that came with Jazzy.
std::optional<float> decode_range(ByteView message);

/// No message is longer: names in it may have some hundred letters.
inline constexpr std::size_t longest_input = 4096;

/// The camera's angles for an attitude of the vehicle: roll and pitch of the vehicle with the mount's angles
/// on top; yaw counts from the vehicle's nose.
struct CameraAngles {
  double roll, pitch, yaw;
};
CameraAngles camera_angles(const std::array<double, 4>& vehicle, const metric::Mount& mount);

} // namespace terrainseg::recording
