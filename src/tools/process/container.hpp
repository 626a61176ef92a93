// SPDX-License-Identifier: LGPL-2.1-or-later
// Checks whether a file is as long as its container says. Demuxers end a truncated file like a complete one.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>

namespace terrainseg::process {

/// Returns the number of bytes that the file must have according to its size fields, if it has fewer. Reads
/// ISO base media (MP4, MOV), RIFF (AVI) and Matroska (MKV, WebM). Returns nothing for other containers,
/// complete files and unreadable files.
std::optional<std::uint64_t> missing_length(const std::filesystem::path& file);

/// Whether the container's header has the exact duration: AVI, Matroska, FLV.
bool tells_duration(const std::filesystem::path& file);

/// Whether a GIF does not end with the trailer byte. A GIF has no duration, but a defined end.
bool lacks_end_mark(const std::filesystem::path& file);

} // namespace terrainseg::process
