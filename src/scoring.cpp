// SPDX-License-Identifier: LGPL-2.1-or-later
#include "scoring.hpp"

#include <algorithm>
#include <array>
#include <cstring>
#include <numeric>

#include "clustering.hpp"
#include "fixed.hpp"
#include "kernels/score_parts.hpp"
#include "terrainseg/estimate.hpp"
#include "workers.hpp"

namespace terrainseg {
namespace {

static_assert(kernels::most_models == max_models);

/// Squared distance of a bin's centre to the mean, in parts of the squared threshold.
std::uint8_t scaled_distance(std::uint8_t centre, std::uint16_t mean, std::uint32_t variance,
                             std::uint64_t threshold_squared) {
  const std::int64_t d = (std::int64_t{centre} << 8) - mean;
  const std::uint64_t square = static_cast<std::uint64_t>(d * d); // Q16, <= 2^32
  if (square == 0)
    return 0;
  const std::uint64_t scale = threshold_squared * variance; // Q16 * Q8, <= 2^48
  if (scale == 0)
    return 255;
  return static_cast<std::uint8_t>(
      std::min<std::uint64_t>(255, rounded_quotient((square << 8) * kernels::score_limit, scale)));
}

} // namespace

void ScoreTable::build(std::span<const TerrainModel> learned, int threshold_q8, int bit_shift) {
  if (bit_shift != table_shift_) {
    table_.assign(kernels::color_table_size(bit_shift), 0);
    table_.shrink_to_fit();
    used_.assign(kernels::color_table_rows(bit_shift), 0);
    table_shift_ = bit_shift;
  }
  scores_.models = 0;
  scores_.bit_shift = bit_shift;
  const std::uint64_t threshold_squared = static_cast<std::uint64_t>(threshold_q8) * threshold_q8;
  for (const TerrainModel& model : learned) {
    if (model.mass == 0)
      continue;
    auto& entries = scores_.entries[scores_.models++];
    for (int c = 0; c < 3; ++c)
      for (int bin = 0; bin < 256 >> bit_shift; ++bin)
        entries[c][bin] = scaled_distance(bin_centre(bin << bit_shift, bit_shift), model.mean[c],
                                          model.variance[c], threshold_squared);
  }
  by_parts_ = kernels::parts_are_faster(bit_shift);
  if (!by_parts_)
    kernels::fill_color_table(scores_, table_.data(), used_.data());
}

void ScoreTable::score(const Grid& grid, std::vector<std::uint8_t>& scores) const {
  scores.resize(static_cast<std::size_t>(grid.width) * grid.height);
  auto out = scores.begin();
  for (int y = 0; y < grid.height; ++y)
    for (int x = 0; x < grid.width; ++x)
      *out++ = score(grid.at({static_cast<std::int16_t>(x), static_cast<std::int16_t>(y)}));
}

template <typename RowOf>
std::uint64_t ScoreTable::label_rows(int width, int height, int first_row, const MutablePlane& mask,
                                     Workers& workers, const RowOf& row_of) const {
  std::array<std::uint64_t, max_threads> counts{};
  const int bands = std::min(workers.count(), max_threads);
  workers.run(bands, [&](int band) {
    std::uint64_t count = 0;
    for (int y = height * band / bands; y < height * (band + 1) / bands; ++y)
      if (y < first_row)
        std::memset(mask.row(y), mask_not_traversable, static_cast<std::size_t>(width));
      else if (by_parts_)
        count += kernels::classify_row_by_parts(row_of(y), scores_, mask.row(y), width);
      else
        count += kernels::classify_row(row_of(y), table_.data(), table_shift_, mask.row(y), width);
    counts[static_cast<std::size_t>(band)] = count;
  });
  return std::accumulate(counts.begin(), counts.end(), std::uint64_t{0});
}

std::uint64_t ScoreTable::label(const Frame& frame, int first_row, const MutablePlane& mask,
                                Workers& workers) const {
  const auto& parts = layout_of(frame.format).components;
  return label_rows(frame.width, frame.height, first_row, mask, workers, [&](int y) {
    kernels::PixelRow row{{}, parts[0].step, parts[1].step, parts[1].x_shift};
    for (int c = 0; c < 3; ++c)
      row.component[c] = frame.planes[parts[c].plane].row(y >> parts[c].y_shift) + parts[c].offset;
    return row;
  });
}

std::uint64_t ScoreTable::label(const Grid& grid, int first_row, const MutablePlane& mask,
                                Workers& workers) const {
  return label_rows(grid.width, grid.height, first_row, mask, workers, [&](int y) {
    return kernels::PixelRow{{grid.planes[0].row(y), grid.planes[1].row(y), grid.planes[2].row(y)}, 1, 1, 0};
  });
}

std::uint8_t mean_closeness(std::span<const std::uint8_t> scores, int grid_width, const Rectangle& cells) {
  std::uint64_t sum = 0;
  for (int y = cells.y; y < cells.y + cells.height; ++y)
    for (int x = cells.x; x < cells.x + cells.width; ++x)
      sum += scores[static_cast<std::size_t>(y) * grid_width + x];
  return static_cast<std::uint8_t>(
      255 - rounded_quotient(sum, static_cast<std::uint64_t>(cells.width) * cells.height));
}

std::uint64_t mark_ignored(std::span<const Rectangle> ignored, int mask_level, const MutablePlane& mask,
                           int width, int height) {
  std::uint64_t was_traversable = 0;
  for (const Rectangle& pixels : ignored) {
    const Rectangle r = cells_in(pixels, mask_level, width, height);
    for (int y = r.y; y < r.y + r.height; ++y) {
      std::uint8_t* row = mask.row(y) + r.x;
      was_traversable += static_cast<std::uint64_t>(std::count(row, row + r.width, mask_traversable));
      std::fill_n(row, r.width, mask_doubtful);
    }
  }
  return was_traversable;
}

} // namespace terrainseg
