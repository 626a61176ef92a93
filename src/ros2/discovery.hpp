// SPDX-License-Identifier: LGPL-2.1-or-later
// Converts the environment variables of ROS 2 for discovery to a configuration of Cyclone DDS.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace terrainseg::ros2 {

enum class DiscoveryRange : std::uint8_t { off, localhost, subnet, system_default };

struct Discovery {
  std::uint32_t domain = 0;
  DiscoveryRange range = DiscoveryRange::localhost;
  std::vector<std::string> peers; ///< addresses of other hosts
};

/// Reads ROS_DOMAIN_ID, ROS_AUTOMATIC_DISCOVERY_RANGE, ROS_LOCALHOST_ONLY and ROS_STATIC_PEERS with `get`,
/// which works like std::getenv(). Without these variables the range is localhost. On an error it returns
/// nothing and sets `error` to the variable and its valid values.
std::optional<Discovery> discovery_from(const char* (*get)(const char* name), std::string& error);

/// Returns the configuration as XML. It comes before the configuration of CYCLONEDDS_URI.
std::string cyclone_config(const Discovery& discovery);

} // namespace terrainseg::ros2
