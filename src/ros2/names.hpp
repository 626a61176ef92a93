// SPDX-License-Identifier: LGPL-2.1-or-later
// Maps names, types and environment variables of ROS 2 to those of DDS.
#pragma once

#include <cstdint>
#include <stdexcept>
#include <string>
#include <vector>

#include "recording/ros_messages.hpp"

namespace terrainseg::ros2 {

/// What users can change: a variable, a name, the network. The text has no full stop.
class Problem : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// Returns the absolute name of a topic: `name` if it begins with a slash, otherwise `name_space` + `name`.
std::string full_name(const std::string& name_space, const std::string& name);
/// Checks an absolute name such as /terrain/scan; throws Problem. ROS 2 allows letters, digits and _ between
/// slashes; no part may begin with a digit.
void check_name(const std::string& name);

/// Returns rt/terrain/scan for /terrain/scan.
std::string dds_topic(const std::string& name);
/// Returns sensor_msgs::msg::dds_::LaserScan_ for sensor_msgs/msg/LaserScan.
std::string dds_type(const std::string& type);

enum class DiscoveryRange : std::uint8_t { off, localhost, subnet, system_default };

struct Discovery {
  std::uint32_t domain = 0;
  DiscoveryRange range = DiscoveryRange::localhost;
  std::vector<std::string> peers; ///< addresses of other hosts
};

/// Reads ROS_DOMAIN_ID, ROS_AUTOMATIC_DISCOVERY_RANGE, ROS_LOCALHOST_ONLY and ROS_STATIC_PEERS with `get`,
/// which works like std::getenv(). Without these variables the range is localhost. Throws Problem with the
/// variable and its valid values.
Discovery discovery_from(const char* (*get)(const char* name));

/// Returns the configuration as XML. It comes before the configuration of CYCLONEDDS_URI.
std::string cyclone_config(const Discovery& discovery);

} // namespace terrainseg::ros2
