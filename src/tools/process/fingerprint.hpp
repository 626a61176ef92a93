// SPDX-License-Identifier: LGPL-2.1-or-later
// Identifies a recording by its content without reading all of it.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

namespace terrainseg::process {

/// Does not change when a file is touched, renamed, moved or copied. A change that keeps the length and all
/// sampled blocks is not detected.
struct Identity {
  std::uint64_t bytes = 0; ///< of all files
  std::string fingerprint; ///< hexadecimal; empty = unknown (a stream, or an unreadable file)
  bool operator==(const Identity&) const = default;
};

/// For a file: SHA-256 over the length, the first and the last 64 KiB, and 64 blocks of 4 KiB evenly between.
Identity identity_of(const std::filesystem::path& file);

/// For a sequence: SHA-256 over the lengths and the first and last 4 KiB of every image, in order.
Identity identity_of(const std::vector<std::filesystem::path>& images);

} // namespace terrainseg::process
