// SPDX-License-Identifier: LGPL-2.1-or-later
// Records the messages of a stream: MCAP with ROS 2 topics.
#pragma once

#include <array>
#include <cstdint>
#include <string>

#include "recording/mcap_writer.hpp"
#include "recording/terrain_messages.hpp"

namespace terrainseg::recording {

class TerrainRecording : private MessageOutlet {
 public:
  TerrainRecording(ByteSink sink, MessageOptions options);

  /// Returns false if the file could not be written; see McapWriter.
  [[nodiscard]] bool add(const MessageFrame& frame) { return messages_.add(frame, *this); }
  [[nodiscard]] bool flush() { return writer_.flush(); }
  [[nodiscard]] bool finish() { return writer_.finish(); }

  /// Returns the metadata.yaml of a rosbag2 folder with this recording as the file `name`.
  std::string bag_metadata(const std::string& name) const;
  const McapWriter& writer() const { return writer_; }

 private:
  bool wants(Topic) override { return true; }
  bool put(Topic topic, std::uint64_t time, ByteView message) override {
    return writer_.write(channels_[static_cast<std::size_t>(topic)], time, message);
  }

  TerrainMessages messages_;
  McapWriter writer_;
  std::array<std::uint16_t, topic_count> channels_{};
};

} // namespace terrainseg::recording
