// SPDX-License-Identifier: LGPL-2.1-or-later
// A participant of DDS with writers and readers of ROS 2 topics.
#pragma once

#include <dds/dds.h>

#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "recording/ros_messages.hpp"
#include "ros2/discovery.hpp"
#include "ros2/raw_type.hpp"

namespace terrainseg::ros2 {

/// The domain's configuration lives as long as somebody in this process uses it.
class Domain;

class Participant {
 public:
  /// Joins the domain. nullptr on an error, which `error` tells. `enclave`: whether nodes of ROS 2 since Iron
  /// may list it.
  static std::unique_ptr<Participant> join(const Discovery& discovery, bool enclave, std::string& error);
  ~Participant();
  Participant(const Participant&) = delete;
  Participant& operator=(const Participant&) = delete;

  dds_entity_t entity() const { return entity_; }

 private:
  Participant(std::shared_ptr<Domain> domain, dds_entity_t entity);
  std::shared_ptr<Domain> domain_;
  dds_entity_t entity_;
};

enum class Durability : std::uint8_t { volatile_data, transient_local };

/// Writes a topic reliably. A message replaces the oldest of `depth` that readers have not acknowledged; one
/// that DDS does not take within 5 ms is dropped.
class Writer {
 public:
  /// `depth` messages are kept for readers that are slow, and for late ones of a transient local topic.
  Writer(const Participant& participant, const std::string& topic, const recording::MessageType& type,
         Durability durability, int depth);
  /// Writes ros_discovery_info.
  explicit Writer(const Participant& participant);
  ~Writer();
  Writer(const Writer&) = delete;
  Writer& operator=(const Writer&) = delete;

  /// Why it could not be made, or an empty text.
  const std::string& error() const { return error_; }
  std::uint32_t readers() const { return readers_; }
  /// False when it was dropped, which dropped() counts.
  bool write(recording::ByteView message);
  std::uint64_t written() const { return written_; }
  std::uint64_t dropped() const { return dropped_; }
  dds_entity_t entity() const { return entity_; }

 private:
  void open(const Participant& participant, Durability durability, int depth, const std::string& user_data);

  RawTopic topic_{};
  dds_entity_t entity_ = 0;
  std::string error_;
  std::atomic<std::uint32_t> readers_ = 0;
  std::atomic<std::uint64_t> written_ = 0, dropped_ = 0;
};

/// Reads a topic, best effort: it matches writers of every kind.
class Reader {
 public:
  /// `on_message` runs on a thread of DDS. It is given an empty message for one that is longer than
  /// `longest`.
  using OnMessage = std::function<void(recording::ByteView message)>;
  Reader(const Participant& participant, const std::string& topic, const recording::MessageType& type,
         std::size_t longest, OnMessage on_message);
  ~Reader();
  Reader(const Reader&) = delete;
  Reader& operator=(const Reader&) = delete;
  const std::string& error() const { return error_; }
  dds_entity_t entity() const { return entity_; }

 private:
  void take_all(dds_entity_t reader);

  RawTopic topic_{};
  dds_entity_t entity_ = 0;
  std::string error_;
  const std::size_t longest_;
  OnMessage on_message_;
  recording::Bytes message_;
};

/// The message of ros_discovery_info that lists a participant's readers and writers as those of a node.
/// `gid_size`: bytes of an identifier, 24 in Humble, 16 since Iron.
recording::Bytes participant_entities(const Participant& participant, std::size_t gid_size,
                                      const std::string& name_space, const std::string& node,
                                      const std::vector<dds_entity_t>& readers,
                                      const std::vector<dds_entity_t>& writers);

} // namespace terrainseg::ros2
