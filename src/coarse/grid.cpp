// SPDX-License-Identifier: LGPL-2.1-or-later
#include "coarse/grid.hpp"

#include <algorithm>
#include <cstring>

#include "base/lattice.hpp"
#include "terrainseg/estimate.hpp"
#include "terrainseg/settings.hpp"

namespace terrainseg {
namespace {

/// Sets pixels of a row of the mask to `label`. Returns how many of them were traversable.
std::uint64_t mark_row(std::uint8_t* first, std::uint8_t* end, std::uint8_t label) {
  const auto was_traversable = static_cast<std::uint64_t>(std::count(first, end, mask_traversable));
  std::fill(first, end, label);
  return was_traversable;
}

/// A range of pixels along one axis; `end` is exclusive.
struct Reach {
  int first, end;
};

/// Scales the range `first` to `end` - 1 of `from` pixels to `to` pixels of the same total length, including
/// all pixels that it touches.
Reach touched(int first, int end, int from, int to) {
  const auto scaled = [&](int edge) { return std::int64_t{edge} * to; };
  return {static_cast<int>(scaled(first) / from), static_cast<int>((scaled(end) + from - 1) / from)};
}

/// The cells of a level, of `count`, that are nearest to the frame's pixels `first` to `end` - 1.
Reach nearest_cells(int first, int end, int level, int count) {
  const int half = 1 << level >> 1;
  const auto nearest = [&](int pixel) { return std::min((pixel + half) >> level, count - 1); };
  return {nearest(first), nearest(end - 1) + 1};
}

bool is_vetoed(std::uint8_t pixel) {
  return pixel >= 128;
}

/// The next vetoed pixel of a row, or `width`. Tests eight pixels at a time, because few are vetoed.
int next_vetoed(const std::uint8_t* row, int x, int width) {
  for (; x + 8 <= width; x += 8) {
    std::uint64_t eight = 0;
    std::memcpy(&eight, row + x, sizeof eight);
    if (eight & 0x8080808080808080u)
      break;
  }
  return static_cast<int>(std::find_if(row + x, row + width, is_vetoed) - row);
}

} // namespace

void fill_ignored(std::span<const Rectangle> ignored, int level, int width, int height, std::uint8_t value,
                  std::uint8_t* cells) {
  for (const Rectangle& pixels : ignored) {
    const Rectangle r = cells_in(pixels, level, width, height);
    for (int y = r.y; y < r.y + r.height; ++y)
      std::fill_n(cells + static_cast<std::ptrdiff_t>(y) * width + r.x, r.width, value);
  }
}

std::uint64_t mark_ignored(std::span<const Rectangle> ignored, int mask_level, const MutablePlane& mask,
                           int width, int height) {
  std::uint64_t was_traversable = 0;
  for (const Rectangle& pixels : ignored) {
    const Rectangle r = cells_in(pixels, mask_level, width, height);
    for (int y = r.y; y < r.y + r.height; ++y) {
      std::uint8_t* const row = mask.row(y) + r.x;
      was_traversable += mark_row(row, row + r.width, mask_doubtful);
    }
  }
  return was_traversable;
}

int grid_level(int wanted, int width, int height) {
  int level = std::max(wanted, 0);
  if (wanted < 0)
    while (level < max_pyramid_levels && subsampled(width, level) >= 96)
      ++level;
  while (level > 0 && subsampled(std::min(width, height), level) < 4)
    --level;
  return level;
}

bool is_blank(const Grid& grid) {
  constexpr int noise = 2;
  for (const Plane& plane : grid.planes) {
    int least = 255, most = 0;
    for (int y = 0; y < grid.height; ++y) {
      const auto [low, high] = std::minmax_element(plane.row(y), plane.row(y) + grid.width);
      least = std::min<int>(least, *low);
      most = std::max<int>(most, *high);
      if (most - least > noise)
        return false;
    }
  }
  return true;
}

/// Calls `use(columns, rows)` for rectangles of the frame that together cover exactly the vetoed pixels.
template <typename Use> void VetoArea::each(Use use) const {
  for (const Rectangle& rectangle : veto_.rectangles)
    if (const Rectangle r = clipped(rectangle, width_, height_); !r.empty())
      use(Reach{r.x, r.x + r.width}, Reach{r.y, r.y + r.height});
  for (const GrayView& mask : veto_.masks) {
    if (mask.empty())
      continue;
    for (int y = 0; y < mask.height; ++y) {
      const std::uint8_t* const row = mask.plane.row(y);
      const Reach rows = touched(y, y + 1, mask.height, height_);
      for (int x = next_vetoed(row, 0, mask.width); x < mask.width;) {
        const int end = static_cast<int>(std::find_if_not(row + x, row + mask.width, is_vetoed) - row);
        use(touched(x, end, mask.width, width_), rows);
        x = next_vetoed(row, end, mask.width);
      }
    }
  }
}

bool VetoArea::touches_cell(int level, int x, int y) const {
  const int half = 1 << level >> 1;
  const auto pixels = [&](int cell, int size) {
    const bool last = cell == subsampled(size, level) - 1;
    return Reach{std::max((cell << level) - half, 0), last ? size : ((cell + 1) << level) - half};
  };
  const Reach columns = pixels(x, width_), rows = pixels(y, height_);
  for (const Rectangle& rectangle : veto_.rectangles) {
    const Rectangle r = clipped(rectangle, width_, height_);
    if (!r.empty() && r.x < columns.end && r.x + r.width > columns.first && r.y < rows.end &&
        r.y + r.height > rows.first)
      return true;
  }
  for (const GrayView& mask : veto_.masks) {
    if (mask.empty())
      continue;
    const Reach across = touched(columns.first, columns.end, width_, mask.width),
                down = touched(rows.first, rows.end, height_, mask.height);
    for (int row = down.first; row < down.end; ++row)
      if (next_vetoed(mask.plane.row(row), across.first, across.end) < across.end)
        return true;
  }
  return false;
}

void VetoArea::fill_cells(int level, int width, int height, std::uint8_t value, std::uint8_t* cells) const {
  each([&](Reach columns, Reach rows) {
    const Reach x = nearest_cells(columns.first, columns.end, level, width),
                y = nearest_cells(rows.first, rows.end, level, height);
    for (int row = y.first; row < y.end; ++row)
      std::fill_n(cells + static_cast<std::ptrdiff_t>(row) * width + x.first, x.end - x.first, value);
  });
}

// A mask pixel (x, y) covers the frame's pixels from (x, y) * 2^mask_level on.
std::uint64_t VetoArea::mark(int mask_level, const MutablePlane& mask, int width, int height) const {
  std::uint64_t was_traversable = 0;
  each([&](Reach columns, Reach rows) {
    const int left = columns.first >> mask_level,
              right = std::min(subsampled(columns.end, mask_level), width),
              bottom = std::min(subsampled(rows.end, mask_level), height);
    for (int y = rows.first >> mask_level; y < bottom; ++y) {
      std::uint8_t* const row = mask.row(y);
      was_traversable += mark_row(row + left, row + right, mask_not_traversable);
    }
  });
  return was_traversable;
}

void VetoArea::lower(int mask_level, std::span<std::uint16_t> rows) const {
  each([&](Reach columns, Reach below) {
    const int right = std::min(subsampled(columns.end, mask_level), static_cast<int>(rows.size()));
    for (int x = columns.first >> mask_level; x < right; ++x)
      rows[x] = std::max(rows[x], static_cast<std::uint16_t>(below.end));
  });
}

} // namespace terrainseg
