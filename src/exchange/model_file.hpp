// SPDX-License-Identifier: LGPL-2.1-or-later
// What was learned as a file: versioned, checksummed, the same bytes on every machine.
//
// Layout, all numbers little-endian:
//   8 bytes   the letters "TERRAIN" and a line feed (a file that went through a text-mode copy is damaged)
//   u32       version, 2
//   u32       size of the content in bytes
//   content   u8 rgb (0 YUV, 1 RGB), u8 range (0 limited, 1 full), u8 matrix (0 BT.601, 1 BT.709, 2 BT.2020),
//             u8 number of models (0..8),
//             per model: 3 x u16 mean, 3 x u32 variance, u64 mass, as in terrain.hpp,
//             three histograms (negative colours, terrain texture, negative texture): u32 number of bins (0
//             or as many as terrain.hpp says), then u32 per bin, u32 exposure mean, u32 horizon, u32
//             generation, u16 width and u16 height of the frames of the kept line, u32 its row (not in
//             version 1)
//   u32       CRC-32 (the one of zlib and PNG) of everything before it
// A file whose fields leave the ranges of terrain.hpp is refused: what is loaded can be learned on from.
// A later version that only adds keeps reading version 1; an older reader refuses a newer file by name.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "terrainseg/terrain.hpp"

namespace terrainseg {

inline constexpr std::uint32_t model_file_version = 2;

/// A terrain, or why there is none.
struct TerrainResult {
  std::optional<Terrain> terrain;
  std::string error; ///< what is wrong and what to do; empty when there is a terrain
};

/// The bytes of a file. `terrain` has at most max_models models and histograms of the documented sizes.
std::vector<std::uint8_t> serialize_terrain(const Terrain& terrain);

/// Reads back what serialize_terrain() made. Anything else is refused: foreign, cut short, damaged or newer.
TerrainResult parse_terrain(std::span<const std::uint8_t> bytes);

/// Writes so that `path` holds either its old content or all of the new one, even when the machine loses
/// power: a temporary file in the same folder, fsync, rename. A symbolic link stays and the file that it
/// means is written; what is no regular file (a device, a pipe) is refused. Returns why it failed; empty when
/// it did not.
std::string write_file_atomically(const std::string& path, std::span<const std::uint8_t> bytes);

/// parse_terrain() of a regular file; the error names the path.
TerrainResult load_terrain(const std::string& path);

/// serialize_terrain() into a file, atomically. Returns why it failed; empty when it did not.
std::string save_terrain(const std::string& path, const Terrain& terrain);

} // namespace terrainseg
