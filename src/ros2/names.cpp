// SPDX-License-Identifier: LGPL-2.1-or-later
#include "ros2/names.hpp"

#include <glib.h>
#include <unistd.h>

#include <charconv>
#include <map>
#include <sstream>
#include <string_view>

namespace terrainseg::ros2 {
namespace {

/// Numbers of type_description_interfaces/msg/FieldType.
const std::map<std::string_view, int> primitive_types = {
    {"int8", 2},   {"uint8", 3}, {"int16", 4},  {"uint16", 5},   {"int32", 6},
    {"uint32", 7}, {"int64", 8}, {"uint64", 9}, {"float32", 10}, {"float64", 11},
    {"char", 13},  {"bool", 15}, {"byte", 16},  {"string", 17}};
constexpr int nested_type = 1, bounded_string = 21;
constexpr int array_offset = 48, bounded_sequence_offset = 96, sequence_offset = 144;

/// Returns std_msgs/msg/Header for std_msgs/Header.
std::string long_name(const std::string& name) {
  const std::size_t slash = name.find('/');
  return name.substr(0, slash) + "/msg" + name.substr(slash);
}

/// Returns the number after `mark`, or 0.
int number_behind(std::string_view text, std::string_view mark) {
  const std::size_t at = text.find(mark);
  int number = 0;
  if (at != std::string_view::npos)
    std::from_chars(text.data() + at + mark.size(), text.data() + text.size(), number);
  return number;
}

/// One member as JSON: `float64[36] covariance`, `string<=256 name`, `geometry_msgs/Pose[] poses`.
std::string field_of(const std::string& type, const std::string& name) {
  const std::size_t bracket = type.find('[');
  const std::string element = type.substr(0, bracket);
  const std::string array = bracket == std::string::npos ? "" : type.substr(bracket);
  const int string_capacity = number_behind(element, "<=");
  const auto primitive = primitive_types.find(element);
  const bool nested = string_capacity == 0 && primitive == primitive_types.end();
  int id = nested ? nested_type : string_capacity > 0 ? bounded_string : primitive->second;
  int capacity = 0;
  if (array.starts_with("[<=")) {
    id += bounded_sequence_offset;
    capacity = number_behind(array, "<=");
  } else if (array == "[]") {
    id += sequence_offset;
  } else if (!array.empty()) {
    id += array_offset;
    capacity = number_behind(array, "[");
  }
  return "{\"name\": \"" + name + "\", \"type\": {\"type_id\": " + std::to_string(id) +
         ", \"capacity\": " + std::to_string(capacity) +
         ", \"string_capacity\": " + std::to_string(string_capacity) + ", \"nested_type_name\": \"" +
         (nested ? long_name(element) : "") + "\"}}";
}

constexpr std::uint32_t last_domain = 232; // larger domains would use ports above 65535

std::string escaped(const std::string& text) {
  g_autofree gchar* safe = g_markup_escape_text(text.c_str(), -1);
  return safe;
}

const std::map<std::string_view, DiscoveryRange> ranges = {
    {"OFF", DiscoveryRange::off},
    {"LOCALHOST", DiscoveryRange::localhost},
    {"SUBNET", DiscoveryRange::subnet},
    {"SYSTEM_DEFAULT", DiscoveryRange::system_default}};

} // namespace

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

std::string type_hash(const recording::MessageType& type) {
  std::map<std::string, std::string> parts; // descriptions of the used types, by name
  std::string name = type.name, fields, main;
  const auto finish = [&] {
    std::string& into = main.empty() ? main : parts[name];
    into = "{\"type_name\": \"" + name + "\", \"fields\": [" + fields + "]}";
    fields.clear();
  };
  std::istringstream lines(type.text);
  for (std::string line; std::getline(lines, line);) {
    if (line.starts_with("====")) {
      finish();
    } else if (line.starts_with("MSG: ")) {
      name = long_name(line.substr(5));
    } else if (const std::size_t space = line.find(' ');
               space != std::string::npos && line.find('=', space) == std::string::npos) { // not a constant
      fields += (fields.empty() ? "" : ", ") + field_of(line.substr(0, space), line.substr(space + 1));
    }
  }
  finish();
  std::string referenced;
  for (const auto& [part, description] : parts)
    referenced += (referenced.empty() ? "" : ", ") + description;
  const std::string json =
      "{\"type_description\": " + main + ", \"referenced_type_descriptions\": [" + referenced + "]}";
  g_autofree gchar* sum = g_compute_checksum_for_string(G_CHECKSUM_SHA256, json.c_str(), -1);
  return std::string("RIHS01_") + sum;
}

Discovery discovery_from(const char* (*get)(const char* name)) {
  const auto value = [&](const char* name) {
    const char* text = get(name);
    return std::string(text ? text : "");
  };
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
    for (const std::string& peer : discovery.peers)
      finding += "<Peer address=\"" + escaped(peer) + "\"/>";
    finding += "</Peers>";
  }
  return "<CycloneDDS><Domain><General>" + general + "</General><Discovery>" + finding +
         "</Discovery></Domain></CycloneDDS>";
}

} // namespace terrainseg::ros2
