// SPDX-License-Identifier: LGPL-2.1-or-later
// A DDS participant with writers and readers of ROS 2 topics.
#pragma once

#include <dds/dds.h>

#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "recording/ros_messages.hpp"
#include "ros2/names.hpp"

struct ddsi_sertype;

namespace terrainseg::ros2 {

struct RawTopic {
  dds_entity_t entity; ///< negative = an error code of DDS
  const ddsi_sertype* type;
};
/// Creates a topic of a type without a key.
RawTopic create_raw_topic(dds_entity_t participant, const std::string& name, const std::string& type);

/// Takes the next message; returns false if there is none. The message is empty if it has no data or is
/// longer than `longest`.
bool take_raw(dds_entity_t reader, recording::Bytes& message, std::size_t longest);

/// The configuration of a domain exists as long as the process has a user of it.
class Domain;

class Participant {
 public:
  /// Joins the domain. Throws Problem. `enclave`: whether nodes of ROS 2 Iron and later may list the
  /// participant.
  Participant(const Discovery& discovery, bool enclave);
  ~Participant();
  Participant(const Participant&) = delete;
  Participant& operator=(const Participant&) = delete;

  dds_entity_t entity() const { return entity_; }

 private:
  std::unique_ptr<Domain> domain_;
  dds_entity_t entity_;
};

/// What a writer and a reader share. Their constructors throw Problem.
class Endpoint {
 public:
  Endpoint(const Endpoint&) = delete;
  Endpoint& operator=(const Endpoint&) = delete;
  dds_entity_t entity() const { return entity_; }

 protected:
  Endpoint(const Participant& participant, const std::string& topic, const std::string& type);
  ~Endpoint() { close(); }
  /// Must be called by each destructor: listeners use the members of the class.
  void close();

  RawTopic topic_;
  dds_entity_t entity_ = 0;
};

enum class Durability : std::uint8_t { volatile_data, transient_local };

/// Writes a topic with reliable delivery. A message replaces the oldest of `depth` messages that readers have
/// not acknowledged. A message that DDS does not accept within 5 ms is dropped.
class Writer : public Endpoint {
 public:
  /// Keeps `depth` messages for slow readers, and for late readers of a transient local topic.
  Writer(const Participant& participant, const std::string& topic, const recording::MessageType& type,
         Durability durability, int depth);
  /// Writes ros_discovery_info.
  explicit Writer(const Participant& participant);
  ~Writer() { close(); }

  std::uint32_t readers() const { return readers_; }
  /// Returns false if the message was dropped; dropped() counts these.
  bool write(recording::ByteView message);
  std::uint64_t written() const { return written_; }
  std::uint64_t dropped() const { return dropped_; }

 private:
  /// Names of DDS.
  Writer(const Participant& participant, const std::string& topic, const std::string& type,
         const std::string& user_data, Durability durability, int depth);

  std::atomic<std::uint32_t> readers_ = 0;
  std::atomic<std::uint64_t> written_ = 0, dropped_ = 0;
};

/// Reads a topic with best-effort delivery, which matches writers of every kind.
class Reader : public Endpoint {
 public:
  /// `on_message` runs in a thread of DDS. For a message longer than `longest` bytes it gets an empty one.
  using OnMessage = std::function<void(recording::ByteView message)>;
  Reader(const Participant& participant, const std::string& topic, const recording::MessageType& type,
         std::size_t longest, OnMessage on_message);
  ~Reader() { close(); }

 private:
  void take_all(dds_entity_t reader);

  const std::size_t longest_;
  OnMessage on_message_;
  recording::Bytes message_;
};

/// Returns the message for ros_discovery_info that lists the readers and writers of a participant as a
/// node's. `gid_size` is the size of an identifier in bytes: 24 in Humble, 16 since Iron.
recording::Bytes participant_entities(const Participant& participant, std::size_t gid_size,
                                      const std::string& name_space, const std::string& node,
                                      const std::vector<dds_entity_t>& readers,
                                      const std::vector<dds_entity_t>& writers);

} // namespace terrainseg::ros2
