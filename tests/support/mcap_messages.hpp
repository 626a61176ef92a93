// SPDX-License-Identifier: LGPL-2.1-or-later
// The messages of a whole recording by topic, for tests that compare with it.
#pragma once

#include <zstd.h>

#include <cstdint>
#include <cstring>
#include <map>
#include <string>
#include <vector>

namespace terrainseg::test {

using Payload = std::vector<std::uint8_t>;

/// Calls `visit` with the topic, the time and the content of each message, in the order of the file.
template <class Visit> void each_mcap_message(const std::string& file, const Visit& visit) {
  std::map<std::uint16_t, std::string> topics;
  const auto number = [](const char* at, auto value) {
    std::memcpy(&value, at, sizeof value);
    return value;
  };
  const auto read = [&](const auto& self, const std::string& records, std::size_t at) -> void {
    while (at + 9 <= records.size()) {
      const char kind = records[at];
      const char* body = records.data() + at + 9;
      const auto size = static_cast<std::size_t>(number(records.data() + at + 1, std::uint64_t{}));
      if (kind == 4) { // channel
        topics[number(body, std::uint16_t{})] = std::string(body + 8, number(body + 4, std::uint32_t{}));
      } else if (kind == 5) { // message
        visit(topics[number(body, std::uint16_t{})], number(body + 6, std::uint64_t{}),
              Payload(body + 22, body + size));
      } else if (kind == 6) { // chunk
        const auto whole = static_cast<std::size_t>(number(body + 16, std::uint64_t{}));
        const std::size_t records_at = 28 + 4 + number(body + 28, std::uint32_t{}) + 8;
        std::string unpacked(whole, 0);
        if (ZSTD_decompress(unpacked.data(), whole, body + records_at, size - records_at) == whole)
          self(self, unpacked, 0);
      }
      at += 9 + size;
    }
  };
  read(read, file, 8);
}

inline std::map<std::string, std::vector<Payload>> mcap_messages(const std::string& file) {
  std::map<std::string, std::vector<Payload>> messages;
  each_mcap_message(file, [&](const std::string& topic, std::uint64_t, const Payload& message) {
    messages[topic].push_back(message);
  });
  return messages;
}

} // namespace terrainseg::test
