// SPDX-License-Identifier: LGPL-2.1-or-later
#include "freespace/cues/color_bins.hpp"

#include <algorithm>
#include <array>

#include "base/fixed_log.hpp"

namespace terrainseg {
namespace {

/// Q4: the sum of three bands' noise, 7 grey levels. Without a floor compressed pictures lose most of their
/// texture evidence: half of it costs 0.3 points of error at 1 Hz, JPEG at quality 15 several.
constexpr int noise_floor = 112;
/// Of an octave of brightness, Q8, that roughness grows by for the surface to be the same.
constexpr int brightness_slope = 320;
constexpr int middle_grey = 1664; ///< log2(90) Q8
/// 24 bins over 10 octaves, Q16.
constexpr int bins_per_octave = 614;

// What a luma takes off the roughness, log2 Q8.
constexpr std::array<std::int16_t, 256> brightness = [] {
  std::array<std::int16_t, 256> table{};
  for (int y = 0; y < 256; ++y)
    table[static_cast<std::size_t>(y)] = static_cast<std::int16_t>(
        (brightness_slope * (middle_grey - log2_q8(static_cast<std::uint64_t>(y) + 16))) >> 8);
  return table;
}();

std::uint8_t normalised_chroma(int chroma, int gain) {
  return static_cast<std::uint8_t>(std::clamp(128 + (((chroma - 128) * gain) >> 8), 0, 255));
}

// Along one axis: `count` neighbours `slice` bins apart in every block.
void blur(std::span<const std::uint32_t> in, std::span<std::uint32_t> out, int slice, int count) {
  const int block = slice * count;
  for (int start = 0; start < color_bins; start += block) {
    const std::uint32_t* from = &in[static_cast<std::size_t>(start)];
    std::uint32_t* to = &out[static_cast<std::size_t>(start)];
    for (int i = 0; i < slice; ++i)
      to[i] = (3 * from[i] + from[i + slice]) >> 2;
    for (int i = slice; i < block - slice; ++i)
      to[i] = (from[i - slice] + 2 * from[i] + from[i + slice]) >> 2;
    for (int i = block - slice; i < block; ++i)
      to[i] = (from[i - slice] + 3 * from[i]) >> 2;
  }
}

} // namespace

void bin_cells(const Grid& grid, const std::vector<std::uint16_t>& texture, const ExposureTables& exposure,
               CellBins& out) {
  out.luma.resize(grid.size());
  out.u.resize(grid.size());
  out.v.resize(grid.size());
  out.color.resize(grid.size());
  out.texture.resize(grid.size());
  out.roughness.resize(grid.size());
  // Bytes may alias anything, also where the vectors' memory lies: without pointers of its own the loop would
  // look that up for every cell.
  for (int row = 0; row < grid.height; ++row) {
    const auto [grid_y, grid_u, grid_v] = grid.row(row);
    const std::size_t first = grid.at(row, 0);
    std::uint8_t* __restrict luma = &out.luma[first];
    std::uint8_t* __restrict out_u = &out.u[first];
    std::uint8_t* __restrict out_v = &out.v[first];
    std::uint16_t* __restrict color = &out.color[first];
    for (int j = 0; j < grid.width; ++j) {
      const int y = exposure.luma[grid_y[j]], gain = exposure.chroma_gain[grid_y[j]];
      const std::uint8_t u = normalised_chroma(grid_u[j], gain), v = normalised_chroma(grid_v[j], gain);
      luma[j] = static_cast<std::uint8_t>(y);
      out_u[j] = u;
      out_v[j] = v;
      color[j] = static_cast<std::uint16_t>((y >> luma_bin_shift) << 8 | (u >> chroma_bin_shift) << 4 |
                                            v >> chroma_bin_shift);
    }
  }
  const std::uint8_t* const luma = out.luma.data();
  const std::uint16_t* const differences = texture.data();
  std::int16_t* __restrict roughness = out.roughness.data();
  std::uint8_t* __restrict bin = out.texture.data();
  for (std::size_t i = 0; i < grid.size(); ++i) {
    const int rough =
        log2_q8(((static_cast<std::uint32_t>(differences[i]) * exposure.gain) >> 8) + noise_floor) - 512 +
        brightness[luma[i]];
    roughness[i] = static_cast<std::int16_t>(rough);
    bin[i] = static_cast<std::uint8_t>(std::clamp((rough * bins_per_octave) >> 16, 0, texture_bins - 1));
  }
}

void blur_colors(std::span<const std::uint32_t> in, std::span<std::uint32_t> between,
                 std::span<std::uint32_t> out) {
  blur(in, out, chroma_bins * chroma_bins, luma_bins);
  blur(out, between, chroma_bins, chroma_bins);
  blur(between, out, 1, chroma_bins);
}

} // namespace terrainseg
