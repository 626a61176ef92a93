// SPDX-License-Identifier: LGPL-2.1-or-later
// Sends the messages of frames to the topics of a participant.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "recording/terrain_messages.hpp"
#include "ros2/participant.hpp"

namespace terrainseg::ros2 {

/// A topic without a reader is not encoded, but two that late readers get at once: the grid goes out every
/// two seconds, the transform of the mount once.
class Outlet : public recording::MessageOutlet {
 public:
  explicit Outlet(const Participant& participant) : participant_(participant) {}
  /// Opens a topic under its whole name. False on an error, which `error` tells.
  bool open(recording::Topic topic, const std::string& name, std::string& error);
  /// nullptr for a topic that is not open.
  const Writer* writer(recording::Topic topic) const {
    return writers_[static_cast<std::size_t>(topic)].get();
  }
  std::vector<dds_entity_t> entities() const;

  bool wants(recording::Topic topic) override;
  /// True: a message that is dropped ends nothing, and is counted by its writer.
  bool put(recording::Topic topic, std::uint64_t time, recording::ByteView message) override;

 private:
  const Participant& participant_;
  std::array<std::unique_ptr<Writer>, recording::topic_count> writers_;
  std::optional<std::int64_t> last_grid_; ///< monotonic, microseconds
  bool sent_static_ = false;              ///< and no transform of the moment since
};

} // namespace terrainseg::ros2
