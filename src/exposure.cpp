// SPDX-License-Identifier: LGPL-2.1-or-later
#include "exposure.hpp"

#include <algorithm>

namespace terrainseg {
namespace {

constexpr int follow_shift = 4;
constexpr int target_mean = 110;
constexpr std::uint32_t darkest_mean = 8 << 8; ///< Q8: below it a gain shows the sensor's noise only

} // namespace

std::uint32_t mean_luma(const CoarseGrid& grid) {
  std::uint64_t sum = 0, count = 0;
  for (std::size_t i = static_cast<std::size_t>(grid.height / 2) * grid.width; i < grid.size(); ++i)
    if (!grid.ignored[i]) {
      sum += grid.y[i];
      ++count;
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
  // With the gain a dusk drive is off by 4 %, without it by 12.
  const int g = mean == 0 ? 256 : (target_mean << 16) / static_cast<int>(std::max(mean, darkest_mean));
  tables.gain = g;
  for (int y = 0; y < 256; ++y) {
    const int n = std::min(255, (y * g) >> 8);
    tables.luma[y] = static_cast<std::uint8_t>(n);
    tables.chroma_gain[y] = static_cast<std::uint16_t>(std::min(65535, g * 128 * 3 / (n + 24)));
  }
}

} // namespace terrainseg
