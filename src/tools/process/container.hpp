// SPDX-License-Identifier: LGPL-2.1-or-later
// Is a file as long as its own container says? Demuxers end a cut file like a whole one, so the tool asks
// itself.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>

namespace terrainseg::process {

/// Bytes that the file must have by the sizes written in it, when that is more than it has. Knows ISO base
/// media (MP4, MOV), RIFF (AVI) and Matroska (MKV, WebM); nothing for others, for whole files and for files
/// that cannot be read.
std::optional<std::uint64_t> missing_length(const std::filesystem::path& file);

/// True for a container whose header says how long it lasts, and not by an estimate: AVI, Matroska, FLV.
bool tells_duration(const std::filesystem::path& file);

/// True for a GIF whose last byte is not its end mark: it tells no length, but how it must end.
bool lacks_end_mark(const std::filesystem::path& file);

} // namespace terrainseg::process
