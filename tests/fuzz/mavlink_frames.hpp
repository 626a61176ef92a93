// SPDX-License-Identifier: LGPL-2.1-or-later
// What the fuzzers check of MAVLink that is sent.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "input.hpp"

namespace terrainseg::fuzz {

/// CRC-16/MCRF4XX bit by bit.
inline std::uint16_t crc(std::span<const std::uint8_t> bytes, std::uint8_t extra) {
  unsigned sum = 0xFFFF;
  const auto add = [&sum](std::uint8_t byte) {
    sum ^= byte;
    for (int bit = 0; bit < 8; ++bit)
      sum = sum & 1 ? sum >> 1 ^ 0x8408 : sum >> 1;
  };
  for (const std::uint8_t byte : bytes)
    add(byte);
  add(extra);
  return static_cast<std::uint16_t>(sum);
}

/// What is sent is whole frames, of the two kinds, with right checksums.
inline void check_messages(std::span<const std::uint8_t> bytes) {
  while (!bytes.empty()) {
    require(bytes.size() > 12 && bytes[0] == 0xFD);
    const std::size_t length = bytes[1];
    const unsigned id = bytes[7] | bytes[8] << 8 | bytes[9] << 16;
    require((id == 0 || id == 330) && bytes.size() >= 12 + length);
    const std::uint16_t sum = crc(bytes.subspan(1, 9 + length), id == 0 ? 50 : 23);
    require(bytes[10 + length] == (sum & 0xFF) && bytes[11 + length] == sum >> 8);
    bytes = bytes.subspan(12 + length);
  }
}

} // namespace terrainseg::fuzz
