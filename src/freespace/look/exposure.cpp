// SPDX-License-Identifier: LGPL-2.1-or-later
#include "freespace/look/exposure.hpp"

#include <algorithm>

#include "base/tuning.hpp"

namespace terrainseg {
namespace {

TERRAINSEG_TUNED(int, exposure, follow_shift, 4);
TERRAINSEG_TUNED(int, exposure, target_mean, 110);
TERRAINSEG_TUNED(std::uint32_t, exposure, darkest_mean,
                 8 << 8); ///< Q8: below it a gain amplifies only the sensor's noise

} // namespace

std::uint32_t mean_luma(const Grid& grid) {
  std::uint64_t sum = 0, count = 0;
  for (int i = grid.height / 2; i < grid.height; ++i) {
    const std::uint8_t *const luma = grid.planes[0].row(i), *const ignored = &grid.ignored[grid.at(i, 0)];
    for (int j = 0; j < grid.width; ++j)
      if (!ignored[j]) {
        sum += luma[j];
        ++count;
      }
  }
  return count ? static_cast<std::uint32_t>((sum << 8) / count) : target_mean << 8;
}

std::uint32_t follow_exposure(std::uint32_t mean, std::uint32_t now) {
  if (mean == 0)
    return std::max(now, 1u);
  const int step = (static_cast<int>(now) - static_cast<int>(mean)) >> follow_shift;
  return static_cast<std::uint32_t>(std::max(1, static_cast<int>(mean) + step));
}

void fill_exposure(std::uint32_t mean, ExposureTables& tables) {
  // With this gain the error of a dusk drive is 4 %, without it 12 %.
  const int g = mean == 0 ? 256 : (target_mean << 16) / static_cast<int>(std::max(mean, darkest_mean));
  tables.gain = g;
  for (int y = 0; y < 256; ++y) {
    const int n = std::min(255, (y * g) >> 8);
    tables.luma[y] = static_cast<std::uint8_t>(n);
    tables.chroma_gain[y] = static_cast<std::uint16_t>(std::min(65535, g * 128 * 3 / (n + 24)));
  }
}

TerrainModel in_this_light(const TerrainModel& learned, const ExposureTables& exposure) {
  TerrainModel model = learned;
  const int luma = std::min(learned.mean[0] * 256 / exposure.gain, 255 << 8); // Q8
  const int chroma_gain = std::max<int>(exposure.chroma_gain[static_cast<std::size_t>(luma >> 8)], 1);
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

} // namespace terrainseg
