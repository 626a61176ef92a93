// SPDX-License-Identifier: LGPL-2.1-or-later
// A type without description for Cyclone DDS: messages are passed as serialized bytes.
#pragma once

#include <dds/dds.h>

#include <string>

#include "recording/little_endian.hpp"

struct ddsi_sertype;

namespace terrainseg::ros2 {

struct RawTopic {
  dds_entity_t entity; ///< negative = an error code of DDS
  const ddsi_sertype* type;
};
/// Creates a topic of a type without a key.
RawTopic create_raw_topic(dds_entity_t participant, const std::string& name, const std::string& type);

/// Writes a complete message with its 4-byte encapsulation header. Returns 0 or an error code of DDS.
dds_return_t write_raw(dds_entity_t writer, const RawTopic& topic, recording::ByteView message);

/// Takes the next message; returns false if there is none. The message is empty if it has no data or is
/// longer than `longest`.
bool take_raw(dds_entity_t reader, recording::Bytes& message, std::size_t longest);

} // namespace terrainseg::ros2
