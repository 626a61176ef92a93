// SPDX-License-Identifier: LGPL-2.1-or-later
// Maps ROS 2 names and types to those of DDS.
#pragma once

#include <string>

#include "recording/ros_messages.hpp"

namespace terrainseg::ros2 {

/// Returns the absolute name of a topic: `name` if it begins with a slash, otherwise `name_space` + `name`.
std::string full_name(const std::string& name_space, const std::string& name);
/// Checks an absolute name such as /terrain/scan; returns the error, or an empty text. ROS 2 allows letters,
/// digits and _ between slashes; no part may begin with a digit.
std::string flaw_of_name(const std::string& name);

/// Returns rt/terrain/scan for /terrain/scan.
std::string dds_topic(const std::string& name);
/// Returns sensor_msgs::msg::dds_::LaserScan_ for sensor_msgs/msg/LaserScan.
std::string dds_type(const std::string& type);

/// Returns RIHS01_..., the hash of the type description that ROS 2 announces since Iron (REP 2011, REP 2016).
/// It depends on the names and types of the members, not on comments or constants.
std::string type_hash(const recording::MessageType& type);

} // namespace terrainseg::ros2
