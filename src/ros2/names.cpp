// SPDX-License-Identifier: LGPL-2.1-or-later
#include "ros2/names.hpp"

#include <glib.h>
#include <unistd.h>

#include <charconv>
#include <map>
#include <sstream>

namespace terrainseg::ros2 {

std::string full_name(const std::string& name_space, const std::string& name) {
  if (name.starts_with('/'))
    return name;
  return (name_space.empty() || name_space.starts_with('/') ? "" : "/") + name_space +
         (name_space.ends_with('/') ? "" : "/") + name;
}

void check_name(const std::string& name) {
  const auto refuse_if = [&name](bool wrong, const char* flaw) {
    if (wrong)
      throw Problem("\"" + name + "\" is not a topic name: " + flaw);
  };
  // DDS allows 256 characters, including rt/
  refuse_if(name.size() < 2 || name[0] != '/' || name.size() > 247, "a name has 1 to 246 letters");
  char before = 0;
  for (const char c : name) {
    refuse_if(c != '/' && c != '_' && !g_ascii_isalnum(c), "only letters, digits, _ and / are allowed");
    refuse_if(before == '/' && (c == '/' || g_ascii_isdigit(c)), "a part is empty or begins with a digit");
    before = c;
  }
  refuse_if(before == '/', "it ends with a slash");
}

std::string dds_topic(const std::string& name) {
  return "rt" + name;
}

std::string dds_type(const std::string& type) {
  const std::size_t slash = type.find('/'), last = type.rfind('/');
  return type.substr(0, slash) + "::" + type.substr(slash + 1, last - slash - 1) +
         "::dds_::" + type.substr(last + 1) + "_";
}

Discovery discovery_from(const char* (*get)(const char* name)) {
  const auto value = [&](const char* name) {
    const char* text = get(name);
    return std::string(text ? text : "");
  };
  constexpr std::uint32_t last_domain = 232; // larger domains would use ports above 65535
  const std::map<std::string, DiscoveryRange> ranges = {{"OFF", DiscoveryRange::off},
                                                        {"LOCALHOST", DiscoveryRange::localhost},
                                                        {"SUBNET", DiscoveryRange::subnet},
                                                        {"SYSTEM_DEFAULT", DiscoveryRange::system_default}};
  Discovery found;
  if (const std::string text = value("ROS_DOMAIN_ID"); !text.empty()) {
    const char* end = text.data() + text.size();
    const auto [stop, flaw] = std::from_chars(text.data(), end, found.domain);
    if (flaw != std::errc() || stop != end || found.domain > last_domain)
      throw Problem("ROS_DOMAIN_ID is \"" + text + "\": it must be a number from 0 to 232");
  }
  const std::string only = value("ROS_LOCALHOST_ONLY"), range = value("ROS_AUTOMATIC_DISCOVERY_RANGE");
  if (!only.empty() && only != "0" && only != "1")
    throw Problem("ROS_LOCALHOST_ONLY is \"" + only + "\": it must be 0 or 1");
  if (!range.empty()) {
    const auto known = ranges.find(range);
    if (known == ranges.end())
      throw Problem("ROS_AUTOMATIC_DISCOVERY_RANGE is \"" + range +
                    "\": it must be OFF, LOCALHOST, SUBNET or SYSTEM_DEFAULT");
    found.range = known->second;
  } else if (only == "0") {
    found.range = DiscoveryRange::subnet;
  }
  if (only == "1")
    found.range = DiscoveryRange::localhost;
  std::istringstream peers(value("ROS_STATIC_PEERS"));
  for (std::string peer; std::getline(peers, peer, ';');)
    if (!peer.empty())
      found.peers.push_back(peer);
  return found;
}

std::string cyclone_config(const Discovery& discovery) {
  std::string general, finding;
  if (discovery.range == DiscoveryRange::off) {
    // A unique tag: participants find only others with the same tag.
    general = "<AllowMulticast>false</AllowMulticast>";
    finding =
        "<ParticipantIndex>none</ParticipantIndex><Tag>terrainseg_" + std::to_string(getpid()) + "</Tag>";
  } else if (discovery.range != DiscoveryRange::system_default) {
    const bool local = discovery.range == DiscoveryRange::localhost;
    if (local)
      general = "<AllowMulticast>false</AllowMulticast>";
    // Peers are queried at the ports of this many participants.
    finding = "<ParticipantIndex>auto</ParticipantIndex><MaxAutoParticipantIndex>32</MaxAutoParticipantIndex>"
              "<SPDPInterval>1s</SPDPInterval><Peers>";
    finding += local ? "<Peer address=\"127.0.0.1\"/>" : "";
    for (const std::string& peer : discovery.peers) {
      g_autofree gchar* safe = g_markup_escape_text(peer.c_str(), -1);
      finding += std::string("<Peer address=\"") + safe + "\"/>";
    }
    finding += "</Peers>";
  }
  return "<CycloneDDS><Domain><General>" + general + "</General><Discovery>" + finding +
         "</Discovery></Domain></CycloneDDS>";
}

} // namespace terrainseg::ros2
