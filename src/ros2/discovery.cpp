// SPDX-License-Identifier: LGPL-2.1-or-later
#include "ros2/discovery.hpp"

#include <glib.h>
#include <unistd.h>

#include <charconv>
#include <cstring>

namespace terrainseg::ros2 {
namespace {

constexpr std::uint32_t last_domain = 232; // larger domains would use ports above 65535

std::string escaped(const std::string& text) {
  gchar* safe = g_markup_escape_text(text.c_str(), -1);
  std::string copy = safe;
  g_free(safe);
  return copy;
}

std::optional<DiscoveryRange> range_of(const std::string& word) {
  constexpr struct {
    const char* word;
    DiscoveryRange range;
  } words[] = {{"OFF", DiscoveryRange::off},
               {"LOCALHOST", DiscoveryRange::localhost},
               {"SUBNET", DiscoveryRange::subnet},
               {"SYSTEM_DEFAULT", DiscoveryRange::system_default}};
  for (const auto& known : words)
    if (word == known.word)
      return known.range;
  return std::nullopt;
}

} // namespace

std::optional<Discovery> discovery_from(const char* (*get)(const char* name), std::string& error) {
  const auto value = [&](const char* name) {
    const char* text = get(name);
    return std::string(text ? text : "");
  };
  Discovery found;
  if (const std::string text = value("ROS_DOMAIN_ID"); !text.empty()) {
    const char* end = text.data() + text.size();
    const auto [stop, flaw] = std::from_chars(text.data(), end, found.domain);
    if (flaw != std::errc() || stop != end || found.domain > last_domain) {
      error = "ROS_DOMAIN_ID is \"" + text + "\": it must be a number from 0 to 232";
      return std::nullopt;
    }
  }
  const std::string only = value("ROS_LOCALHOST_ONLY"), range = value("ROS_AUTOMATIC_DISCOVERY_RANGE");
  if (!only.empty() && only != "0" && only != "1") {
    error = "ROS_LOCALHOST_ONLY is \"" + only + "\": it must be 0 or 1";
    return std::nullopt;
  }
  if (!range.empty()) {
    const auto known = range_of(range);
    if (!known) {
      error = "ROS_AUTOMATIC_DISCOVERY_RANGE is \"" + range +
              "\": it must be OFF, LOCALHOST, SUBNET or SYSTEM_DEFAULT";
      return std::nullopt;
    }
    found.range = *known;
  } else if (only == "0") {
    found.range = DiscoveryRange::subnet;
  }
  if (only == "1")
    found.range = DiscoveryRange::localhost;
  std::string peers = value("ROS_STATIC_PEERS");
  for (std::size_t at = 0; at < peers.size();) {
    const std::size_t end = std::min(peers.find(';', at), peers.size());
    if (end > at)
      found.peers.push_back(peers.substr(at, end - at));
    at = end + 1;
  }
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
    for (const std::string& peer : discovery.peers)
      finding += "<Peer address=\"" + escaped(peer) + "\"/>";
    finding += "</Peers>";
  }
  return "<CycloneDDS><Domain><General>" + general + "</General><Discovery>" + finding +
         "</Discovery></Domain></CycloneDDS>";
}

} // namespace terrainseg::ros2
