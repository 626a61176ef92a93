// SPDX-License-Identifier: LGPL-2.1-or-later
// Right checksums for a mutated KLV unit, so that what lies behind them is reached.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "exchange/bytes.hpp"
#include "exchange/vmti_codec.hpp"
#include "exchange/vmti_klv.hpp"

namespace terrainseg {

/// CRC-32 of a VMTI set whose private set's sum is the last 4 bytes of item 74 of the UAS Datalink Local Set
/// `unit`, and where those 4 bytes are; 0 where there is none.
inline std::uint32_t nested_crc(std::span<const std::uint8_t> unit, std::size_t& at) {
  vmti::Cursor in(unit);
  in.take(16);
  vmti::Cursor set(in.item());
  at = 0;
  while (in.ok() && set.ok() && !set.done()) {
    const std::uint32_t tag = set.tag();
    const auto item = set.item();
    if (tag != vmti::uas_vmti || item.size() < 4)
      continue;
    at = static_cast<std::size_t>(item.data() + item.size() - unit.data()) - 4;
    vmti::Bytes head(vmti_label.begin(), vmti_label.end());
    vmti::put_length(head, item.size() + vmti::checksum_size);
    return crc32(item.first(item.size() - 4), crc32(head));
  }
  return 0;
}

/// Writes the private set's CRC-32 and the unit's checksum over its last bytes, or in a UAS Datalink Local
/// Set where item 74 ends; nothing where it is shorter.
inline void put_sums(std::vector<std::uint8_t>& unit) {
  const std::size_t n = unit.size();
  if (n < 8)
    return;
  std::size_t at = n - 8;
  std::uint32_t crc = crc32(std::span(unit).first(at));
  if (vmti::begins_with(unit, uas_label)) {
    crc = nested_crc(unit, at);
    if (at == 0)
      return;
  }
  for (std::size_t i = 0; i < 4; ++i)
    unit[at + i] = static_cast<std::uint8_t>(crc >> (24 - 8 * i));
  std::uint16_t sum = 0;
  for (std::size_t i = 0; i < n - 2; ++i)
    sum = static_cast<std::uint16_t>(sum + (unit[i] << (i % 2 ? 0 : 8)));
  unit[n - 2] = static_cast<std::uint8_t>(sum >> 8);
  unit[n - 1] = static_cast<std::uint8_t>(sum);
}

} // namespace terrainseg
