// SPDX-License-Identifier: LGPL-2.1-or-later
#include "freespace/look/connected_ground.hpp"

#include <algorithm>
#include <cstdlib>

#include "base/tuning.hpp"
#include "kernels/cells.hpp"

namespace terrainseg {
namespace {

kernels::ComponentRow row_from(const Grid& grid, int row, int column) {
  kernels::ComponentRow components = grid.row(row);
  for (const std::uint8_t*& component : components)
    component += column;
  return components;
}

} // namespace

void measure_color_steps(const Grid& grid, int gain_q8, bool diagonal, ColorSteps& steps) {
  // Measures from every cell to the one `down` rows below and `right` columns to the right.
  const auto measure = [&](int down, int right, std::vector<std::uint16_t>& out) {
    out.resize(grid.size());
    const int first = right < 0 ? 1 : 0, count = grid.width - std::abs(right);
    for (int i = 0; i + down < grid.height; ++i)
      kernels::color_steps(row_from(grid, i, first), row_from(grid, i + down, first + right), gain_q8,
                           most_color_step, count, &out[grid.at(i, 0)] + first);
  };
  measure(0, 1, steps.right);
  measure(1, 0, steps.down);
  if (!diagonal)
    return;
  measure(1, -1, steps.down_left);
  measure(1, 1, steps.down_right);
}

namespace {

/// Largest chroma difference of taught and of vouched cells from the seeds, sum of both components, in
/// quarters of a grey level. Without a limit an indoor floor includes walls: 3.47 % error, 3.33 % with 48.
TERRAINSEG_TUNED(int, connected_ground, most_chroma, 48);
/// Vouched cells are darker than the seeds by at most 1/6: 16.4 % unsafe off the road, 17.3 % without this
/// limit.
TERRAINSEG_TUNED(int, connected_ground, vouched_darker, 6);
/// Smallest texture of the seeds; night shows less. Without it a smooth car in the window at dusk causes cars
/// to be taken for ground.
TERRAINSEG_TUNED(int, connected_ground, least_texture, 56);
/// Rows above and below a boundary within which an edge counts: the curve is smooth, edges are not.
TERRAINSEG_TUNED(int, connected_ground, edge_reach, 3);
/// Added to the sum of two lumas, in quarters of a grey level, because differences in the dark are noise.
TERRAINSEG_TUNED(int, connected_ground, dark_luma, 32);

// Smooths along a row: 1-2-1, with repeated ends. The result is four times the value.
template <typename In> void smooth_columns(const In* in, int width, std::int16_t* out) {
  const auto smoothed = [in](int left, int j, int right) {
    return static_cast<std::int16_t>(in[left] + 2 * in[j] + in[right]);
  };
  for (int j = 1; j < width - 1; ++j)
    out[j] = smoothed(j - 1, j, j + 1);
  out[0] = smoothed(0, 0, std::min(1, width - 1));
  out[width - 1] = smoothed(std::max(width - 2, 0), width - 1, width - 1);
}

// All values here fit 16 bits, and so do their differences.
std::int16_t distance(std::int16_t a, std::int16_t b) {
  return static_cast<std::int16_t>(std::max(a, b) - std::min(a, b));
}

// 6 % of the luma, 2.4 grey levels of chroma, a third of an octave of roughness.
constexpr kernels::LookLimits joined_limits{32, 9, 369, 1};
// 10 %, 4 grey levels, 0.6 octaves. The luma limit is relative: an absolute limit of 8 grey levels would miss
// a quarter of the true edges at dusk.
constexpr kernels::LookLimits edge_limits{20, 16, 616, 0};

} // namespace

void ConnectedGround::look(const Grid& grid, const CellBins& cells) {
  for (auto& values : smooth_)
    values.resize(grid.size());
  for (int i = 0; i < grid.height; ++i) {
    const std::size_t row = grid.at(i, 0);
    for (std::size_t c = 0; c < 3; ++c)
      smooth_columns(grid.planes[c].row(i), grid.width, &smooth_[c][row]);
    smooth_columns(&cells.roughness[row], grid.width, &smooth_[3][row]);
  }
}

// Compares every cell with the one `to` - `from` cells after it, in row order.
void ConnectedGround::compare(const Grid& grid, std::size_t from, std::size_t to,
                              const kernels::LookLimits& limits, std::vector<std::uint8_t>& alike) const {
  alike.resize(grid.size());
  const std::size_t farther = std::max(from, to);
  if (farther >= grid.size())
    return;
  const auto row_at = [&](std::size_t at) -> kernels::LookRow {
    return {{&smooth_[0][at], &smooth_[1][at], &smooth_[2][at], &smooth_[3][at]}, &grid.ignored[at]};
  };
  kernels::compare_looks(row_at(from), row_at(to), limits, dark_luma, static_cast<int>(grid.size() - farther),
                         &alike[from]);
}

const std::vector<std::uint8_t>& ConnectedGround::grow(const Grid& grid, const std::vector<Cell>& seeds) {
  joined_.assign(grid.size(), 0);
  taught_.assign(grid.size(), 0);
  means_ = {};
  if (seeds.empty())
    return joined_;
  const auto width = static_cast<std::size_t>(grid.width);
  int lowest = 0;
  for (const Cell& seed : seeds) {
    joined_[grid.at(seed.y, seed.x)] = 1;
    lowest = std::max(lowest, int{seed.y});
  }
  means_ = means_of(grid, seeds);
  compare(grid, 0, 1, joined_limits, right_);
  compare(grid, 0, width, joined_limits, down_);
  compare(grid, 1, width, joined_limits, down_left_);
  compare(grid, 0, width + 1, joined_limits, down_right_);
  for (int i = lowest; i >= 0; --i) {
    if (i < lowest)
      climb(grid.at(i, 0), width);
    spread(grid.at(i, 0), width);
  }
  keep_like_seeds();
  return joined_;
}

std::array<int, 3> ConnectedGround::means_of(const Grid& grid, const std::vector<Cell>& seeds) const {
  std::array<std::int64_t, 3> sums{};
  for (const Cell& seed : seeds)
    for (std::size_t c = 0; c < sums.size(); ++c)
      sums[c] += smooth_[c][grid.at(seed.y, seed.x)];
  std::array<int, 3> means{};
  for (std::size_t c = 0; c < means.size(); ++c)
    means[c] = static_cast<int>(sums[c] / static_cast<std::int64_t>(seeds.size()));
  return means;
}

void ConnectedGround::keep_like_seeds() {
  const std::int16_t *const u = smooth_[1].data(), *const v = smooth_[2].data();
  const auto most = static_cast<std::int16_t>(most_chroma), seeds_u = static_cast<std::int16_t>(means_[1]),
             seeds_v = static_cast<std::int16_t>(means_[2]);
  const std::uint8_t* const in = joined_.data();
  std::uint8_t* __restrict out = taught_.data();
  for (std::size_t i = 0, count = taught_.size(); i < count; ++i) {
    const auto chroma = static_cast<std::int16_t>(distance(u[i], seeds_u) + distance(v[i], seeds_v));
    out[i] = static_cast<std::uint8_t>(in[i] & (chroma <= most));
  }
}

const std::vector<std::uint8_t>& ConnectedGround::vouched(const Grid& grid, const std::vector<Cell>& seeds,
                                                          const std::vector<std::uint16_t>& texture) {
  vouched_.assign(grid.size(), 0);
  if (seeds.empty())
    return vouched_;
  std::int64_t sum = 0;
  for (const Cell& seed : seeds)
    sum += texture[grid.at(seed.y, seed.x)];
  if (sum < least_texture * static_cast<std::int64_t>(seeds.size()))
    return vouched_;
  const auto darkest = static_cast<std::int16_t>(means_[0] - (means_[0] + dark_luma) / vouched_darker);
  const std::int16_t* const y = smooth_[0].data();
  const std::uint8_t* const in = taught_.data();
  std::uint8_t* __restrict out = vouched_.data();
  for (std::size_t i = 0, count = vouched_.size(); i < count; ++i)
    out[i] = static_cast<std::uint8_t>(in[i] & (y[i] >= darkest));
  return vouched_;
}

// Extends a row from the three cells below each cell.
void ConnectedGround::climb(std::size_t row, std::size_t width) {
  std::uint8_t* const here = &joined_[row];
  const std::uint8_t *const below = here + width, *const down = &down_[row], *const left = &down_left_[row],
                            *const right = &down_right_[row];
  for (std::size_t j = 0; j < width; ++j)
    here[j] |= below[j] & down[j];
  for (std::size_t j = 1; j < width; ++j)
    here[j] |= below[j - 1] & left[j];
  for (std::size_t j = 0; j + 1 < width; ++j)
    here[j] |= below[j + 1] & right[j];
}

// Extends along a row in both directions.
void ConnectedGround::spread(std::size_t row, std::size_t width) {
  std::uint8_t* const here = &joined_[row];
  const std::uint8_t* const right = &right_[row];
  for (std::size_t j = 1; j < width; ++j)
    here[j] |= here[j - 1] & right[j - 1];
  for (std::size_t j = width - 1; j > 0; --j)
    here[j - 1] |= here[j] & right[j - 1];
}

const std::vector<std::uint8_t>& ConnectedGround::edgeless(const Grid& grid) {
  const auto width = static_cast<std::size_t>(grid.width);
  compare(grid, 0, width, edge_limits, unbroken_);
  edgeless_.assign(grid.size(), 0);
  for (int r = 1; r < grid.height; ++r) {
    std::uint8_t* const out = &edgeless_[grid.at(r, 0)];
    std::fill_n(out, width, std::uint8_t{1});
    // The edge between rows k - 1 and k.
    for (int k = std::max(r - edge_reach, 1); k <= std::min(r + edge_reach, grid.height - 1); ++k) {
      const std::uint8_t* const alike = &unbroken_[grid.at(k - 1, 0)];
      for (std::size_t j = 0; j < width; ++j)
        out[j] &= alike[j];
    }
  }
  return edgeless_;
}

} // namespace terrainseg
