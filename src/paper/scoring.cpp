// SPDX-License-Identifier: LGPL-2.1-or-later
#include "paper/scoring.hpp"

#include <algorithm>
#include <array>
#include <cstring>
#include <numeric>

#include "base/fixed.hpp"
#include "base/workers.hpp"
#include "kernels/reduce.hpp"
#include "learning/terrain_model.hpp"
#include "terrainseg/estimate.hpp"

namespace terrainseg {
namespace {

static_assert(kernels::most_models == max_models);

/// Prepares rows of formats that the kernel cannot read directly, piece by piece: extracts the upper 8 bits
/// of two-byte samples, and supplies neutral chroma for grey.
class StagedRow {
 public:
  static constexpr int most_pixels = 2048;

  StagedRow() { chroma_.fill(128); }

  static bool needed(const FormatLayout& layout) {
    return layout.sample_bytes() == 2 || layout.component_count == 1;
  }

  /// Returns `count` <= most_pixels pixels of row y, starting at the even pixel x.
  kernels::PixelRow piece(const Frame& frame, int x, int y, int count) {
    const FormatLayout& layout = layout_of(frame.format);
    const int bytes = layout.sample_bytes();
    std::array<const std::uint8_t*, 3> planes{};
    for (int p = 0; p < layout.planes; ++p) {
      const ComponentLayout& part = layout.components[p];
      const std::uint8_t* row =
          frame.planes[p].row(y >> part.y_shift) + static_cast<std::ptrdiff_t>(x >> part.x_shift) * part.step;
      planes[p] = row;
      if (bytes == 1)
        continue;
      std::uint8_t* room = room_[p].data();
      kernels::narrow(row, layout.upper_shift(), row_bytes(layout, p, count) / bytes, 0, room);
      planes[p] = room;
    }
    if (layout.component_count == 1)
      return {{planes[0], chroma_.data(), chroma_.data()}, 1, 1, 0};
    const auto& [first, second, third] = layout.components;
    return {{planes[first.plane] + first.offset / bytes, planes[second.plane] + second.offset / bytes,
             planes[third.plane] + third.offset / bytes},
            first.step / bytes,
            second.step / bytes,
            second.x_shift};
  }

 private:
  std::array<std::array<std::uint8_t, most_pixels>, 3> room_;
  std::array<std::uint8_t, most_pixels> chroma_;
};

/// Squared distance from a bin's centre to the mean, as a fraction of the squared threshold.
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
      *out++ = score(grid.color({static_cast<std::int16_t>(x), static_cast<std::int16_t>(y)}));
}

std::uint32_t ScoreTable::label_row(const kernels::PixelRow& row, std::uint8_t* mask, int width) const {
  return by_parts_ ? kernels::classify_row_by_parts(row, scores_, mask, width)
                   : kernels::classify_row(row, table_.data(), table_shift_, mask, width);
}

template <typename Label>
std::uint64_t ScoreTable::label_rows(int width, int height, int first_row, const MutablePlane& mask,
                                     Workers& workers, const Label& label) const {
  std::array<std::uint64_t, max_threads> counts{};
  const int bands = std::min(workers.count(), max_threads);
  workers.run(bands, [&](int band) {
    std::uint64_t count = 0;
    for (int y = height * band / bands; y < height * (band + 1) / bands; ++y)
      if (y < first_row)
        std::memset(mask.row(y), mask_not_traversable, static_cast<std::size_t>(width));
      else
        count += label(y);
    counts[band] = count;
  });
  return std::accumulate(counts.begin(), counts.end(), std::uint64_t{0});
}

std::uint64_t ScoreTable::label(const Frame& frame, int first_row, const MutablePlane& mask,
                                Workers& workers) const {
  const FormatLayout& layout = layout_of(frame.format);
  if (StagedRow::needed(layout))
    return label_rows(frame.width, frame.height, first_row, mask, workers, [&](int y) {
      StagedRow staged;
      std::uint64_t count = 0;
      for (int x = 0; x < frame.width; x += StagedRow::most_pixels) {
        const int pixels = std::min(StagedRow::most_pixels, frame.width - x);
        count += label_row(staged.piece(frame, x, y, pixels), mask.row(y) + x, pixels);
      }
      return count;
    });
  const auto& parts = layout.components;
  return label_rows(frame.width, frame.height, first_row, mask, workers, [&](int y) {
    kernels::PixelRow row{{}, parts[0].step, parts[1].step, parts[1].x_shift};
    for (int c = 0; c < 3; ++c)
      row.component[c] = frame.planes[parts[c].plane].row(y >> parts[c].y_shift) + parts[c].offset;
    return std::uint64_t{label_row(row, mask.row(y), frame.width)};
  });
}

std::uint64_t ScoreTable::label(const Grid& grid, int first_row, const MutablePlane& mask,
                                Workers& workers) const {
  return label_rows(grid.width, grid.height, first_row, mask, workers, [&](int y) {
    const auto [first, second, third] = grid.row(y);
    const kernels::PixelRow row{{first, second, third}, 1, 1, 0};
    return std::uint64_t{label_row(row, mask.row(y), grid.width)};
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

} // namespace terrainseg
