// SPDX-License-Identifier: LGPL-2.1-or-later
// Learned terrains from anywhere: as they are, then with their checksum put right.
#include "exchange/bytes.hpp"
#include "exchange/model_file.hpp"
#include "input.hpp"

namespace {

using namespace terrainseg;
using fuzz::require;

void check(std::span<const std::uint8_t> bytes) {
  const TerrainResult result = parse_terrain(bytes);
  require(result.terrain.has_value() == result.error.empty());
  if (!result.terrain)
    return;
  const Terrain& t = *result.terrain;
  require(t.models.size() <= max_models);
  require(t.negative_colors.empty() || t.negative_colors.size() == color_bins);
  const std::vector<std::uint8_t> again = serialize_terrain(t);
  require(std::vector<std::uint8_t>(bytes.begin(), bytes.end()) == again);
}

} // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  check({data, size});
  std::vector<std::uint8_t> whole(data, data + size);
  if (size >= 4) {
    const std::uint32_t crc = crc32(std::span(whole).first(size - 4));
    for (std::size_t i = 0; i < 4; ++i)
      whole[size - 4 + i] = static_cast<std::uint8_t>(crc >> (8 * i));
    check(whole);
  }
  return 0;
}
