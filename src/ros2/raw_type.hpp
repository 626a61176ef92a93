// SPDX-License-Identifier: LGPL-2.1-or-later
// A type of which Cyclone DDS knows only the name: messages pass as the bytes that they are on the wire.
#pragma once

#include <dds/dds.h>

#include <string>

#include "recording/little_endian.hpp"

struct ddsi_sertype;

namespace terrainseg::ros2 {

struct RawTopic {
  dds_entity_t entity; ///< negative: an error of DDS
  const ddsi_sertype* type;
};
/// A new topic, of a type without a key.
RawTopic create_raw_topic(dds_entity_t participant, const std::string& name, const std::string& type);

/// Writes a whole message, its four bytes of encapsulation included. 0, or an error of DDS.
dds_return_t write_raw(dds_entity_t writer, const RawTopic& topic, recording::ByteView message);

/// Takes the next message; false when there is none. What is no data, or longer than `longest`, is empty.
bool take_raw(dds_entity_t reader, recording::Bytes& message, std::size_t longest);

} // namespace terrainseg::ros2
