// SPDX-License-Identifier: LGPL-2.1-or-later
#include "freespace/look/texture.hpp"

#include <algorithm>
#include <cstdlib>

#include "base/tuning.hpp"
#include "kernels/cells.hpp"

namespace terrainseg {
namespace {

TERRAINSEG_TUNED(int, texture, bands_wanted, 3);

// Adds |right - left| to the sums of the columns: for every pair of pixels, or without pairs for every two
// neighbours.
void add_differences(const std::uint8_t* luma, int step, int whole, int count, int width,
                     std::uint16_t* sums) {
  if (step == 2)
    kernels::add_differences(luma, whole, sums);
  else
    for (int j = 0; j < whole; ++j)
      sums[j] = static_cast<std::uint16_t>(sums[j] + std::abs(luma[j + 1] - luma[j]));
  const int last = std::abs(luma[width - 1] - luma[width - 2]);
  for (int j = whole; j < count; ++j)
    sums[j] = static_cast<std::uint16_t>(sums[j] + last);
}

} // namespace

void TextureReader::read(const Pyramid& pyramid, const Grid& grid, const ColorTransform& transform, bool rgb,
                         std::vector<std::uint16_t>& texture) {
  texture.assign(grid.size(), 0);
  const int bands = std::clamp(grid.level, 1, bands_wanted);
  for (int band = 1; band <= bands; ++band) {
    const int level = std::max(grid.level - band, 0);
    // Level 0 has no finer band: one difference per cell, between neighbouring columns.
    const int step = grid.level == 0 ? 1 : 2, per_cell = 1 << (band - 1);
    // Centres the box of differences on the cell.
    const int before = per_cell / 2;
    const int width = pyramid.width(level), height = pyramid.height(level);
    if (width < 2)
      continue;
    const int count = grid.width * per_cell, whole = std::min(count, (width - (step == 1 ? 1 : 0)) / step);
    columns_.resize(static_cast<std::size_t>(before + count));
    std::uint16_t* columns = columns_.data() + before;
    luma_.resize(static_cast<std::size_t>(width));
    for (int i = 0; i < grid.height; ++i) {
      std::fill(columns_.begin(), columns_.end(), std::uint16_t{0});
      for (int k = 0; k < per_cell; ++k) {
        const int row = std::min(std::max(i * per_cell + k - before, 0) * step, (height - 1) / step * step);
        const std::uint8_t* luma = pyramid.plane(level, 0).row(row);
        if (rgb) {
          transform_luma_row(transform,
                             {luma, pyramid.plane(level, 1).row(row), pyramid.plane(level, 2).row(row)},
                             luma_.data(), width);
          luma = luma_.data();
        }
        add_differences(luma, step, whole, count, width, columns);
      }
      const int shift = 4 - 2 * (band - 1);              // Q4 of the mean of per_cell^2 differences
      std::fill_n(columns_.begin(), before, columns[0]); // the first cell's box ends at the edge of the
                                                         // picture
      kernels::add_boxes(columns_.data(), per_cell, shift, grid.width, &texture[grid.at(i, 0)]);
    }
  }
  // The differences are of unconverted YUV luma: the sums get the gain of its range.
  const int gain = ((rgb ? 1 << 16 : transform.matrix[0][0]) * bands_wanted / bands) >> 8;
  if (gain != 256)
    for (std::uint16_t& t : texture)
      t = static_cast<std::uint16_t>(std::min(65535, (t * gain) >> 8));
}

} // namespace terrainseg
