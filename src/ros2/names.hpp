// SPDX-License-Identifier: LGPL-2.1-or-later
// Names and types of ROS 2 as DDS has them.
#pragma once

#include <string>

#include "recording/ros_messages.hpp"

namespace terrainseg::ros2 {

/// A topic's whole name: `name` itself when it begins with a slash, else below `name_space`.
std::string full_name(const std::string& name_space, const std::string& name);
/// What is wrong with a whole name (/terrain/scan), or an empty text. ROS 2 allows letters, digits and _
/// between slashes; no part begins with a digit.
std::string flaw_of_name(const std::string& name);

/// rt/terrain/scan for /terrain/scan.
std::string dds_topic(const std::string& name);
/// sensor_msgs::msg::dds_::LaserScan_ for sensor_msgs/msg/LaserScan.
std::string dds_type(const std::string& type);

/// RIHS01_..., the hash of the type's description that ROS 2 announces since Iron (REP 2011, REP 2016). It
/// depends on names and types of the members only, not on comments or constants.
std::string type_hash(const recording::MessageType& type);

} // namespace terrainseg::ros2
