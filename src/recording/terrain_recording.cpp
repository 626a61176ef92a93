// SPDX-License-Identifier: LGPL-2.1-or-later
#include "recording/terrain_recording.hpp"

#include <utility>

namespace terrainseg::recording {
namespace {

/// Recordings have no /tf_static: /tf contains the transforms of the mount with every frame too.
struct Channel {
  Topic topic;
  const char* name;
};
constexpr Channel recorded[] = {{Topic::scan, "/terrain/scan"},
                                {Topic::points, "/terrain/points"},
                                {Topic::grid, "/terrain/grid"},
                                {Topic::mask, "/terrain/mask"},
                                {Topic::camera_info, "/camera/camera_info"},
                                {Topic::video, "/camera/video"},
                                {Topic::picture, "/camera/image/compressed"},
                                {Topic::tf, "/tf"},
                                {Topic::diagnostics, "/diagnostics"}};

McapWriter::Channel channel_of(const char* topic, MessageType type) {
  return {topic, "cdr", type.name, "ros2msg", std::move(type.text), {{"offered_qos_profiles", ""}}, 0};
}

/// A text in double quotes.
std::string quoted_yaml(const std::string& text) {
  constexpr const char* digits = "0123456789abcdef";
  std::string quoted = "\"";
  for (const char c : text) {
    const auto byte = static_cast<unsigned char>(c);
    if (byte < 0x20)
      (quoted += "\\x") += {digits[byte >> 4], digits[byte & 15]};
    else if (c == '"' || c == '\\')
      (quoted += '\\') += c;
    else
      quoted += c;
  }
  return quoted += '"';
}

} // namespace

TerrainRecording::TerrainRecording(ByteSink sink, MessageOptions options)
    : messages_(std::move(options)), writer_(std::move(sink), "ros2", "terrainseg") {
  const auto channel = [&](Topic topic) -> std::uint16_t& {
    return channels_[static_cast<std::size_t>(topic)];
  };
  for (const auto& [topic, name] : recorded)
    channel(topic) = writer_.add_channel(channel_of(name, type_of(topic)));
  channel(Topic::tf_static) = channel(Topic::tf);
}

std::string TerrainRecording::bag_metadata(const std::string& name) const {
  const std::string start = std::to_string(writer_.start_time());
  const std::string duration = std::to_string(writer_.end_time() - writer_.start_time());
  const std::string messages = std::to_string(writer_.messages());
  std::string text = "rosbag2_bagfile_information:\n  version: 5\n  storage_identifier: mcap\n  duration:\n"
                     "    nanoseconds: " +
                     duration + "\n  starting_time:\n    nanoseconds_since_epoch: " + start +
                     "\n  message_count: " + messages + "\n  topics_with_message_count:\n";
  for (const McapWriter::Channel& channel : writer_.channels())
    if (channel.messages > 0)
      text +=
          "    - topic_metadata:\n        name: " + channel.topic + "\n        type: " + channel.schema +
          "\n        serialization_format: cdr\n        offered_qos_profiles: \"\"\n      message_count: " +
          std::to_string(channel.messages) + "\n";
  const std::string quoted = quoted_yaml(name);
  text += "  compression_format: \"\"\n  compression_mode: \"\"\n  relative_file_paths:\n    - " + quoted +
          "\n  files:\n    - path: " + quoted +
          "\n      starting_time:\n        nanoseconds_since_epoch: " + start +
          "\n      duration:\n        nanoseconds: " + duration + "\n      message_count: " + messages + "\n";
  return text;
}

} // namespace terrainseg::recording
