// SPDX-License-Identifier: LGPL-2.1-or-later
// The file of a learned terrain: versioned, with a checksum, the same bytes on every machine.
//
// Layout, all numbers little-endian:
//   8 bytes   the letters "TERRAIN" and a line feed (detects text-mode copies)
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
// A file with a field outside the ranges of terrain.hpp is refused, because learning continues from it. A
// later version that only adds fields must still read version 1. A reader refuses a newer version and names
// it.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "terrainseg/terrain.hpp"

namespace terrainseg {

inline constexpr std::uint32_t model_file_version = 2;

/// A terrain, or the reason why there is none.
struct TerrainResult {
  std::optional<Terrain> terrain;
  std::string error; ///< cause and remedy; empty if there is a terrain
};

/// Returns the content of a file. `terrain` has at most max_models models and histograms of the documented
/// sizes.
std::vector<std::uint8_t> serialize_terrain(const Terrain& terrain);

/// Reads the output of serialize_terrain(). Refuses foreign, truncated, damaged and newer files.
TerrainResult parse_terrain(std::span<const std::uint8_t> bytes);

/// parse_terrain() of a regular file. The error contains the path.
TerrainResult load_terrain(const std::string& path);

/// Writes the output of serialize_terrain(). Replaces a file atomically, also if the machine loses power:
/// writes a temporary file in the same folder, then fsync and rename. If `path` is a symbolic link, its
/// target is replaced. Refuses paths that are not regular files (devices, pipes). Returns the error; empty on
/// success.
std::string save_terrain(const std::string& path, const Terrain& terrain);

} // namespace terrainseg
