// SPDX-License-Identifier: LGPL-2.1-or-later
#include "freespace/look/color_bins.hpp"

#include <algorithm>
#include <array>

#include "base/fixed.hpp"
#include "base/tuning.hpp"
#include "kernels/cells.hpp"

namespace terrainseg {
namespace {

TERRAINSEG_TUNED(int, exposure, follow_shift, 4);
TERRAINSEG_TUNED(int, exposure, target_mean, 110);
TERRAINSEG_TUNED(std::uint32_t, exposure, darkest_mean,
                 8 << 8); ///< Q8: below it a gain amplifies only the sensor's noise
/// Inverse of the share of the cells that is darker than black.
TERRAINSEG_TUNED(std::uint32_t, exposure, darkest_share, 200);
/// Mean luma, Q8, from which nothing is subtracted, and inverse of the share of what is missing to it that is
/// subtracted at most: in a bright picture the darkest luma belongs to the ground, not to the lens.
TERRAINSEG_TUNED(std::uint32_t, exposure, dark_mean, 112 << 8);
TERRAINSEG_TUNED(std::uint32_t, exposure, most_of_missing, 10);

} // namespace

Light light_of(const Grid& grid) {
  std::array<std::uint32_t, 256> histogram{};
  std::uint32_t count = 0, sum = 0, darker = 0, black = 0;
  for (int i = grid.height / 2; i < grid.height; ++i) {
    const std::uint8_t *const luma = grid.planes[0].row(i), *const ignored = &grid.ignored[grid.at(i, 0)];
    for (int j = 0; j < grid.width; ++j)
      histogram[luma[j]] += ignored[j] == 0;
  }
  for (std::uint32_t y = 0; y < 256; ++y) {
    count += histogram[y];
    sum += histogram[y] * y;
  }
  if (count == 0)
    return {static_cast<std::uint32_t>(target_mean << 8), 0};
  while ((darker += histogram[black]) * darkest_share <= count)
    ++black;
  return {static_cast<std::uint32_t>((std::uint64_t{sum} << 8) / count), black << 8};
}

std::uint32_t follow_slowly(std::uint32_t followed, std::uint32_t now) {
  if (followed == 0)
    return std::max(now, 1u);
  const int step = (static_cast<int>(now) - static_cast<int>(followed)) >> follow_shift;
  return static_cast<std::uint32_t>(std::max(1, static_cast<int>(followed) + step));
}

void fill_exposure(const Light& light, ExposureTables& tables) {
  const std::uint32_t most = (dark_mean - std::min(light.mean, dark_mean)) / most_of_missing,
                      black = std::min({light.black, light.mean, most});
  // With this gain the error of a dusk drive is 4 %, without it 12 %.
  const int g = light.mean == 0
                    ? 256
                    : (target_mean << 16) / static_cast<int>(std::max(light.mean - black, darkest_mean));
  tables.gain = g;
  tables.black = static_cast<int>(black >> 8);
  for (int y = 0; y < 256; ++y) {
    const int n = std::min(255, (std::max(y - tables.black, 0) * g) >> 8);
    tables.luma[y] = static_cast<std::uint8_t>(n);
    tables.chroma_gain[y] = static_cast<std::uint16_t>(std::min(65535, g * 128 * 3 / (n + 24)));
  }
}

TerrainModel in_this_light(const TerrainModel& learned, const ExposureTables& exposure) {
  TerrainModel model = learned;
  const int luma = std::min(learned.mean[0] * 256 / exposure.gain + (exposure.black << 8), 255 << 8); // Q8
  const int chroma_gain = std::max<int>(exposure.chroma_gain[luma >> 8], 1);
  for (int c = 0; c < 3; ++c) {
    const std::int64_t gain = c == 0 ? exposure.gain : chroma_gain; // 64 bits for the square of the chroma
                                                                    // gain
    if (c > 0)
      model.mean[c] = static_cast<std::uint16_t>(
          std::clamp<std::int64_t>((128 << 8) + (learned.mean[c] - (128 << 8)) * 256 / gain, 0, 255 << 8));
    model.variance[c] = static_cast<std::uint32_t>(std::max<std::uint64_t>(
        std::uint64_t{learned.variance[c]} * 65536 / static_cast<std::uint64_t>(gain * gain), 1));
  }
  model.mean[0] = static_cast<std::uint16_t>(luma);
  return model;
}

namespace {

/// Inverse of the reach of the light around a cell, in widths of the grid. 4 costs 0.05 points on the drives.
TERRAINSEG_TUNED(int, color_bins, light_reach, 5);
/// Share of the picture without differences of light in the luma of bright surroundings, Q8; the rest is the
/// picture as it is. Error / unsafe of the drives and of the stills: 4.36 / 9.7 and 7.66 / 26.8 with 0, 4.28
/// / 10.6 and 7.57 / 27.0 with 96, 4.27 / 11.4 and 7.53 / 26.8 with 128; 256 costs points by dusk and on
/// Mars. The same for dark surroundings costs unsafe pixels: the hedges beside a trail become as bright as
/// the trail.
TERRAINSEG_TUNED(std::uint32_t, color_bins, light_share, 96);
constexpr std::uint32_t light_floor = 8; ///< added to both lumas of a ratio

/// Q4: the sum of the noise of three bands, 7 grey levels. Without it compressed pictures lose most of their
/// texture evidence. Half of it costs 0.3 points of error at 1 Hz, and several points for JPEG at quality 15.
constexpr int noise_floor = 112;
/// The gain of a dark picture amplifies its noise too: the floor grows by a quarter of the gain above 1. With
/// all of it dusk has 2 points more unsafe pixels; without it 0.17 points more error in pictures of other
/// cameras, most of it on Mars.
constexpr int noise_growth_shift = 2;
/// Increase of the roughness per octave of brightness on the same surface, in Q8 of an octave.
constexpr int brightness_slope = 320;
constexpr int middle_grey = 1664; ///< log2(90) Q8
/// 24 bins over 10 octaves, Q16.
TERRAINSEG_TUNED(int, color_bins, bins_per_octave, 614);

/// Sums of differences are multiplied by 2^lookup_shift for the look-up, which makes them at least 2^10.
constexpr int lookup_shift = 4;
static_assert(noise_floor << lookup_shift >= 1 << 10);

// For each luma what turns the logarithm of a sum of differences into roughness, Q8.
constexpr std::array<std::int16_t, 256> roughness_offset = [] {
  std::array<std::int16_t, 256> table{};
  for (int y = 0; y < 256; ++y)
    table[y] = static_cast<std::int16_t>(
        ((brightness_slope * (middle_grey - log2_q8(static_cast<std::uint64_t>(y) + 16))) >> 8) -
        256 * lookup_shift - 512);
  return table;
}();

// Table of log2 in Q8.
constexpr auto octave_table = [] {
  std::array<std::int16_t, kernels::octaves_of_table * 256 + 1> table{};
  for (std::uint64_t i = 0; i + 1 < table.size(); ++i)
    table[i] = static_cast<std::int16_t>(log2_q8((256 + i % 256) << (i / 256 + 2)));
  return table;
}();

// The gain is below 2^12, that of the darkest mean. Auto-vectorised.
void scale_differences(const std::uint16_t* __restrict differences, std::uint32_t gain, std::size_t count,
                       std::uint32_t* __restrict out) {
  const std::uint32_t amplified = std::max(gain, 256u) - 256,
                      floor = noise_floor + (noise_floor * amplified >> (8 + noise_growth_shift));
  for (std::size_t i = 0; i < count; ++i)
    out[i] = ((differences[i] * gain >> 8) + floor) << lookup_shift;
}

// Auto-vectorised.
void bin_roughness(const std::int16_t* __restrict roughness, std::size_t count,
                   std::uint8_t* __restrict bin) {
  for (std::size_t i = 0; i < count; ++i) {
    const auto at = static_cast<std::int16_t>((roughness[i] * bins_per_octave) >> 16);
    const std::int16_t least = at < 0 ? std::int16_t{0} : at;
    bin[i] = static_cast<std::uint8_t>(std::min(least, std::int16_t{texture_bins - 1}));
  }
}

// Looks up the normalised luma and the gain of the chroma.
void look_up_exposure(const std::uint8_t* __restrict in, const ExposureTables& exposure, int count,
                      std::uint8_t* __restrict luma, std::uint16_t* __restrict gain) {
  for (int j = 0; j < count; ++j) {
    luma[j] = exposure.luma[in[j]];
    gain[j] = exposure.chroma_gain[in[j]];
  }
}

// Reduces the luma of cells with surroundings brighter than the `mean` (Q8). All are seen above `black`.
void flatten_light(const std::vector<std::uint8_t>& around, std::uint32_t mean, int black,
                   std::vector<std::uint8_t>& luma) {
  std::array<std::uint16_t, 256> factor{}; // Q8
  const auto over_black = [black](int value) {
    return static_cast<std::uint32_t>(std::max(value - black, 0)) + light_floor;
  };
  const std::uint32_t level =
      mean - std::min(mean, static_cast<std::uint32_t>(black) << 8) + (light_floor << 8);
  for (int y = 0; y < 256; ++y) {
    const std::uint32_t ratio = std::min(level / over_black(y), 256u);
    factor[y] = static_cast<std::uint16_t>(256 - ((256 - ratio) * light_share >> 8));
  }
  for (std::size_t i = 0; i < luma.size(); ++i)
    luma[i] = static_cast<std::uint8_t>(luma[i] * factor[around[i]] >> 8);
}

// This function and the next are auto-vectorised, this one in 16 bits: no product of a chroma and a byte of
// the gain is larger.
void normalise_chroma(const std::uint8_t* __restrict in, const std::uint16_t* __restrict gain, int count,
                      std::uint8_t* __restrict out) {
  using Short = std::int16_t;
  for (int j = 0; j < count; ++j) {
    const auto chroma = static_cast<Short>(in[j] - 128);
    const auto whole = static_cast<Short>(chroma * (gain[j] >> 8)),
               rest = static_cast<Short>(chroma * (gain[j] & 255));
    const auto sum = static_cast<Short>(128 + whole + (rest >> 8));
    const Short least = sum < 0 ? Short{0} : sum;
    out[j] = static_cast<std::uint8_t>(least < 255 ? least : Short{255});
  }
}

void bin_colors(const std::uint8_t* __restrict y, const std::uint8_t* __restrict u,
                const std::uint8_t* __restrict v, int count, std::uint16_t* __restrict color) {
  for (int j = 0; j < count; ++j)
    color[j] = static_cast<std::uint16_t>((y[j] >> luma_bin_shift) << 8 | (u[j] >> chroma_bin_shift) << 4 |
                                          v[j] >> chroma_bin_shift);
}

// Blurs `count` bins along one axis, with the bins so far before and after each. Auto-vectorised.
void blur(const std::uint32_t* from, int before, int after, int count, std::uint32_t* __restrict to) {
  for (int i = 0; i < count; ++i)
    to[i] = (from[i - before] + 2 * from[i] + from[i + after]) >> 2;
}

} // namespace

void log2_q8(const std::uint32_t* values, int count, std::int16_t* out) {
  kernels::look_up_octaves(values, octave_table.data(), count, out);
}

void mean_around(const Grid& grid, int reach, std::vector<std::uint8_t>& between,
                 std::vector<std::uint32_t>& sums, std::vector<std::uint8_t>& out) {
  const int w = grid.width, h = grid.height;
  sums.resize(2 * w + 2 * reach + 1);
  between.resize(grid.size());
  out.resize(grid.size());
  const Plane& luma = grid.planes[0];
  kernels::average_rows(luma.row(0), luma.stride, w, h, reach, sums.data(), between.data());
  kernels::average_columns(between.data(), w, h, reach, sums.data());
  kernels::average_rows(between.data(), w, w, h, reach, sums.data(), out.data());
  kernels::average_columns(out.data(), w, h, reach, sums.data());
}

void bin_cells(const Grid& grid, const std::vector<std::uint16_t>& texture, const ExposureTables& exposure,
               std::uint32_t mean, CellBins& out) {
  out.luma.resize(grid.size());
  out.u.resize(grid.size());
  out.v.resize(grid.size());
  out.color.resize(grid.size());
  out.texture.resize(grid.size());
  out.roughness.resize(grid.size());
  out.gain.resize(grid.width);
  for (int row = 0; row < grid.height; ++row) {
    const auto [grid_y, grid_u, grid_v] = grid.row(row);
    const std::size_t first = grid.at(row, 0);
    look_up_exposure(grid_y, exposure, grid.width, &out.luma[first], out.gain.data());
    normalise_chroma(grid_u, out.gain.data(), grid.width, &out.u[first]);
    normalise_chroma(grid_v, out.gain.data(), grid.width, &out.v[first]);
  }
  if (mean > 0) {
    mean_around(grid, std::max(grid.width / light_reach, 1), out.half_around, out.sums, out.around);
    flatten_light(out.around, mean, exposure.black, out.luma);
  }
  bin_colors(out.luma.data(), out.u.data(), out.v.data(), static_cast<int>(grid.size()), out.color.data());
  out.differences.resize(grid.size());
  scale_differences(texture.data(), static_cast<std::uint32_t>(exposure.gain), grid.size(),
                    out.differences.data());
  log2_q8(out.differences.data(), static_cast<int>(grid.size()), out.roughness.data());
  for (std::size_t i = 0; i < grid.size(); ++i)
    out.roughness[i] = static_cast<std::int16_t>(out.roughness[i] + roughness_offset[out.luma[i]]);
  bin_roughness(out.roughness.data(), grid.size(), out.texture.data());
}

BinRange range_of_u(const std::vector<std::uint16_t>& colors) {
  std::int16_t least = 255, greatest = 0;
  for (const std::uint16_t color : colors) {
    const auto u = static_cast<std::int16_t>(color & 0xf0);
    least = std::min(least, u);
    greatest = std::max(greatest, u);
  }
  return {least >> 4, (greatest >> 4) + 1};
}

void blur_colors(std::span<const std::uint32_t> in, BinRange u, std::span<std::uint32_t> between,
                 std::span<std::uint32_t> out) {
  constexpr int last = chroma_bins - 1, slice = chroma_bins * chroma_bins;
  const BinRange wide = with_neighbours(u);
  for (int l = 0; l < luma_bins; ++l) {
    const int first = l * slice + wide.first * chroma_bins;
    blur(&in[first], l > 0 ? slice : 0, l + 1 < luma_bins ? slice : 0, wide.count() * chroma_bins,
         &out[first]);
  }
  for (int l = 0; l < luma_bins; ++l)
    for (int i = u.first; i < u.end; ++i) {
      const int first = l * slice + i * chroma_bins;
      blur(&out[first], i > 0 ? chroma_bins : 0, i < last ? chroma_bins : 0, chroma_bins, &between[first]);
    }
  for (int l = 0; l < luma_bins; ++l) {
    const std::uint32_t* const from = &between[l * slice];
    std::uint32_t* const to = &out[l * slice];
    blur(from + u.first * chroma_bins + 1, 1, 1, u.count() * chroma_bins - 2, to + u.first * chroma_bins + 1);
    for (int i = u.first * chroma_bins; i < u.end * chroma_bins; i += chroma_bins) { // the ends
      blur(from + i, 0, 1, 1, to + i);
      blur(from + i + last, 1, 0, 1, to + i + last);
    }
  }
}

} // namespace terrainseg
