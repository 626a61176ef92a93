// SPDX-License-Identifier: LGPL-2.1-or-later
#include "paper/reachable.hpp"

#include <algorithm>

#include "terrainseg/estimate.hpp"

namespace terrainseg {
namespace {

/// Extends the reached cells of a row to their free neighbours.
void spread(const std::uint8_t* free_row, std::span<std::uint8_t> reached) {
  const int width = static_cast<int>(reached.size());
  for (int x = 1; x < width; ++x)
    reached[x] |= reached[x - 1] & static_cast<std::uint8_t>(free_row[x] != 0);
  for (int x = width - 2; x >= 0; --x)
    reached[x] |= reached[x + 1] & static_cast<std::uint8_t>(free_row[x] != 0);
}

/// The row between `start` and `last`, searched upwards, that best separates traversable pixels below from
/// others above.
int parting_row(const GrayView& mask, int x, int start, int last) {
  int best = start, agreement = 0, most = 0;
  for (int y = start - 1; y >= last; --y) {
    agreement += mask.plane.row(y)[x] == mask_traversable ? 1 : -1;
    if (agreement > most) {
      most = agreement;
      best = y;
    }
  }
  return best;
}

} // namespace

void find_reachable(std::span<const std::uint8_t> free_cells, int width, const Rectangle& window_cells,
                    std::vector<std::int16_t>& top) {
  top.assign(static_cast<std::size_t>(width), -1);
  std::array<std::uint8_t, 32768> reached; // large enough for any grid
  const std::span<std::uint8_t> row_reached(reached.data(), static_cast<std::size_t>(width));
  const auto is_free = [&](int x, int y) { return free_cells[static_cast<std::size_t>(y) * width + x] != 0; };

  for (int y = window_cells.y + window_cells.height - 1; y >= window_cells.y; --y) {
    std::fill(row_reached.begin(), row_reached.end(), std::uint8_t{0});
    for (int x = window_cells.x; x < window_cells.x + window_cells.width; ++x)
      row_reached[x] = is_free(x, y);
    spread(&free_cells[static_cast<std::size_t>(y) * width], row_reached);
    for (int x = 0; x < width; ++x)
      if (row_reached[x])
        top[x] = static_cast<std::int16_t>(y);
  }
  for (int x = 0; x < width; ++x)
    while (top[x] > 0 && is_free(x, top[x] - 1))
      --top[x];
}

void refine_reachable(const Grid& grid, std::span<const std::int16_t> top, const GrayView& mask,
                      int mask_level, int frame_height, std::span<std::uint16_t> boundary) {
  const int half = (1 << grid.level) >> 1;
  for (int x = 0; x < mask.width; ++x) {
    const int cell = std::min(((x << mask_level) + half) >> grid.level, grid.width - 1);
    const int row = top[cell];
    if (row < 0) {
      boundary[x] = static_cast<std::uint16_t>(frame_height);
      continue;
    }
    const int centre = row << grid.level, above = std::max(row - 1, 0) << grid.level;
    const int parting =
        parting_row(mask, x, std::min(centre >> mask_level, mask.height - 1), above >> mask_level);
    boundary[x] = static_cast<std::uint16_t>(parting << mask_level);
  }
}

} // namespace terrainseg
