// SPDX-License-Identifier: LGPL-2.1-or-later
// Sends the messages of a frame to the topics of a participant.
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

/// Topics without a reader are not encoded, except two that late readers get at once: the grid is sent every
/// two seconds, the transform of the mount once.
class Outlet : public recording::MessageOutlet {
 public:
  explicit Outlet(const Participant& participant) : participant_(participant) {}
  /// Opens a topic by its absolute name. Throws Problem.
  void open(recording::Topic topic, const std::string& name);
  /// Returns nullptr if the topic is not open.
  const Writer* writer(recording::Topic topic) const {
    return writers_[static_cast<std::size_t>(topic)].get();
  }
  std::vector<dds_entity_t> entities() const;

  bool wants(recording::Topic topic) override;
  /// Always returns true: a dropped message is not an error. The writer counts it.
  bool put(recording::Topic topic, std::uint64_t time, recording::ByteView message) override;

 private:
  const Participant& participant_;
  std::array<std::unique_ptr<Writer>, recording::topic_count> writers_;
  std::optional<std::int64_t> last_grid_; ///< monotonic time, microseconds
  bool sent_static_ = false;              ///< sent, and no attitude of a frame sent since
};

} // namespace terrainseg::ros2
