// SPDX-License-Identifier: LGPL-2.1-or-later
// What tells two recordings apart by what is in them, without reading all of it.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

namespace terrainseg::process {

/// Survives touching, renaming, moving and copying. An edit that keeps the length and leaves every sampled
/// block as it was is not noticed.
struct Identity {
  std::uint64_t bytes = 0; ///< of all files together
  std::string fingerprint; ///< hexadecimal; empty = unknown (a stream, an unreadable file)
  bool operator==(const Identity&) const = default;
};

/// SHA-256 over the length, the first and the last 64 KiB, and 64 blocks of 4 KiB spread evenly between.
Identity identity_of(const std::filesystem::path& file);

/// Of a sequence: SHA-256 over the lengths and the first and last 4 KiB of every image, in order.
Identity identity_of(const std::vector<std::filesystem::path>& images);

} // namespace terrainseg::process
