// SPDX-License-Identifier: LGPL-2.1-or-later
// Who finds whom: the environment variables of ROS 2 as a configuration of Cyclone DDS.
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
  std::vector<std::string> peers; ///< addresses of other machines
};

/// Reads ROS_DOMAIN_ID, ROS_AUTOMATIC_DISCOVERY_RANGE, ROS_LOCALHOST_ONLY and ROS_STATIC_PEERS by `get`, as
/// std::getenv(). Without any of them the range is localhost. On an error nothing, and `error` says which
/// variable and what was expected.
std::optional<Discovery> discovery_from(const char* (*get)(const char* name), std::string& error);

/// The configuration, as XML, that goes in front of what CYCLONEDDS_URI names.
std::string cyclone_config(const Discovery& discovery);

} // namespace terrainseg::ros2
