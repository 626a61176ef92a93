// SPDX-License-Identifier: LGPL-2.1-or-later
#include "geodesic.hpp"

#include <algorithm>

namespace terrainseg {
namespace {

constexpr int far = 1 << 20;
/// Distance without a penalty, and the highest one: it may outweigh colour, not colour and texture together.
constexpr int free_distance = 10;
constexpr int most = 40;
/// What a step may differ by for nothing: twice the ground's own mean step and a little more. In the dark the
/// gain blows up every grey level, hence the limit.
constexpr int least_own_step = 2, greatest_own_step = 8;
/// An eighth of the distance is forgiven with every row: a stop line across the whole road must not cut off
/// what lies behind it (cropped to the road, a drive in town is 4.4 % wrong with it and 5.6 without).
constexpr int forgive_shift = 3;
constexpr int most_step = 1023;

} // namespace

void GeodesicPenalty::raise(const CoarseGrid& grid, const std::vector<Cell>& seeds, int gain_q8,
                            std::vector<std::int8_t>& penalty) {
  if (seeds.empty())
    return;
  const int width = grid.width;
  const auto size = static_cast<std::size_t>(width);
  measure_steps(grid, gain_q8);
  const int free = own_step(grid, seeds);
  is_seed_.assign(grid.size(), 0);
  int lowest = 0;
  for (const Cell& seed : seeds) {
    is_seed_[grid.at(seed.y, seed.x)] = 1;
    lowest = std::max(lowest, int{seed.y});
  }
  here_.resize(size);
  below_.assign(size, far);
  const auto price = [&](const std::vector<std::uint16_t>& steps, std::size_t a, std::size_t b) {
    // What is ignored is crossed for nothing.
    return std::max(steps[a] - free, 0) * (1 - (grid.ignored[a] | grid.ignored[b]));
  };
  for (int i = lowest; i >= 0; --i) {
    const std::size_t row = grid.at(i, 0);
    int* here = here_.data();
    const int* below = below_.data();
    for (int j = 0; j < width; ++j)
      here[j] = is_seed_[row + static_cast<std::size_t>(j)] ? 0 : far;
    if (i < lowest) {
      for (std::size_t j = 0; j < size; ++j)
        here[j] = std::min(here[j], below[j] + price(down_, row + j, row + size + j));
      for (std::size_t j = 1; j < size; ++j)
        here[j] = std::min(here[j], below[j - 1] + price(down_left_, row + j, row + size + j - 1));
      for (std::size_t j = 0; j + 1 < size; ++j)
        here[j] = std::min(here[j], below[j + 1] + price(down_right_, row + j, row + size + j + 1));
    }
    for (std::size_t j = 1; j < size; ++j)
      here[j] = std::min(here[j], here[j - 1] + price(right_, row + j - 1, row + j));
    for (std::size_t j = size - 1; j > 0; --j)
      here[j - 1] = std::min(here[j - 1], here[j] + price(right_, row + j - 1, row + j));
    std::int8_t* out = &penalty[row];
    for (int j = 0; j < width; ++j) {
      out[j] = static_cast<std::int8_t>(std::max<int>(out[j], std::clamp(here[j] - free_distance, 0, most)));
      here[j] -= here[j] >> forgive_shift;
    }
    here_.swap(below_);
  }
}

// Colour steps from every cell to its neighbours. Those that run over an end of a row are never looked at.
void GeodesicPenalty::measure_steps(const CoarseGrid& grid, int gain_q8) {
  const auto measure = [&](std::size_t from, std::size_t to, std::vector<std::uint16_t>& steps) {
    steps.resize(grid.size());
    const std::size_t count = grid.size() - std::min(grid.size(), std::max(from, to));
    if (count > 0)
      kernels::color_steps(components_at(grid, from), components_at(grid, to), gain_q8, most_step,
                           static_cast<int>(count), &steps[from]);
  };
  const auto width = static_cast<std::size_t>(grid.width);
  measure(0, 1, right_);
  measure(0, width, down_);
  measure(1, width, down_left_);
  measure(0, width + 1, down_right_);
}

// The mean step from the cells of the window to those left of and above them, as far as it counts.
int GeodesicPenalty::own_step(const CoarseGrid& grid, const std::vector<Cell>& seeds) const {
  std::int64_t sum = 0, count = 0;
  for (const Cell& seed : seeds) {
    const std::size_t cell = grid.at(seed.y, seed.x);
    if (seed.x > 0) {
      sum += right_[cell - 1];
      ++count;
    }
    if (seed.y > 0) {
      sum += down_[cell - static_cast<std::size_t>(grid.width)];
      ++count;
    }
  }
  const int mean = count > 0 ? static_cast<int>(sum / count) : 0;
  return std::min(least_own_step + 2 * mean, greatest_own_step);
}

} // namespace terrainseg
