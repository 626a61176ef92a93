// SPDX-License-Identifier: LGPL-2.1-or-later
#include "freespace/holes/hole.hpp"

#include "base/lattice.hpp"

namespace terrainseg {
namespace {

constexpr std::uint16_t no_row = 65535;

// Uses 16-bit values throughout, so that compilers vectorise it.
void outline_row(const std::uint16_t* __restrict safe, std::uint16_t row, std::size_t count,
                 std::uint8_t* __restrict in) {
  for (std::size_t x = 0; x < count; ++x)
    in[x] = static_cast<std::uint8_t>(safe[x] <= row);
}

void outline_behind(const std::uint16_t* __restrict first, const std::uint16_t* __restrict end,
                    std::uint16_t row, std::size_t count, std::uint8_t* __restrict in) {
  for (std::size_t x = 0; x < count; ++x)
    in[x] |= static_cast<std::uint8_t>((first[x] <= row) & (end[x] > row));
}

// Labels traversable pixels. Returns their number. Auto-vectorised.
unsigned label_row(std::uint8_t* pixels, int count, std::uint8_t label) {
  unsigned turned = 0;
  for (int x = 0; x < count; ++x) {
    const bool traversable = pixels[x] == mask_traversable;
    turned += traversable;
    pixels[x] = traversable ? label : pixels[x];
  }
  return turned;
}

} // namespace

bool GroundOutline::draw(const FreeSpaceCurves& curves, const OutlineView& view) {
  const int k = view.level, half = 1 << k >> 1;
  stride_ = view.stride;
  const auto cells_of = [&](const FrameCurve& rows, std::vector<std::uint16_t>& out) {
    out.assign(stride_, no_row);
    for (int j = 0; j < view.width; ++j) {
      const int x = j << k >> view.column_spacing << view.column_spacing >> curves.level;
      out[j] = static_cast<std::uint16_t>((rows[x] + half) >> k);
    }
  };
  cells_of(curves.safe, safe_);
  first_ = *std::min_element(safe_.begin(), safe_.end());
  behind_first_.reserve(stride_);
  behind_end_.reserve(stride_);
  if (curves.ground_behind) {
    cells_of(curves.behind_first, behind_first_);
    cells_of(curves.behind_end, behind_end_);
    for (int j = 0; j < view.width; ++j)
      if (behind_first_[j] < behind_end_[j])
        first_ = std::min<int>(first_, behind_first_[j]);
  }
  if (first_ >= view.height)
    return false;
  cells_.resize(stride_ * view.height + 1);
  cells_[first_ * stride_] = 0;
  for (int i = first_; i < view.height; ++i) {
    const auto row = static_cast<std::uint16_t>(i);
    std::uint8_t* const in = &cells_[i * stride_ + 1];
    outline_row(safe_.data(), row, stride_, in);
    if (curves.ground_behind)
      outline_behind(behind_first_.data(), behind_end_.data(), row, stride_, in);
  }
  for (const Rectangle& region : view.ignored) {
    const Rectangle cells = cells_in(region, k, view.width, view.height);
    for (int i = std::max(cells.y, first_); i < cells.y + cells.height; ++i)
      std::fill_n(&cells_[i * stride_ + 1] + cells.x, cells.width, std::uint8_t{0});
  }
  return true;
}

Hole hole_of_cells(int level, int row, int from, int to) {
  const int half = 1 << level >> 1;
  const auto edge = [&](int cell) { return static_cast<std::uint16_t>(std::max((cell << level) - half, 0)); };
  return {edge(from), edge(row), edge(to), edge(row + 1), edge(row + 1)};
}

void lower_below(const Detection& found, int mask_level, FrameCurve& rows) {
  for (const Hole& hole : found.holes) {
    const int right = std::min(subsampled(hole.right, mask_level), static_cast<int>(rows.size()));
    for (int x = subsampled(hole.left, mask_level); x < right; ++x)
      rows[x] = std::max(rows[x], hole.free_from);
  }
  found.veto.lower(mask_level, {rows.data(), rows.size()});
}

std::uint64_t mark(const Detection& found, const MutablePlane& mask, int width, int height, int mask_level) {
  std::uint64_t turned = 0;
  for (const Hole& hole : found.holes) {
    const int left = subsampled(hole.left, mask_level),
              count = std::max(std::min(subsampled(hole.right, mask_level), width) - left, 0),
              bottom = std::min(subsampled(hole.bottom, mask_level), height);
    for (int y = subsampled(hole.top, mask_level); y < bottom; ++y)
      turned += label_row(mask.row(y) + left, count, found.label);
  }
  return turned + found.veto.mark(mask_level, mask, width, height);
}

} // namespace terrainseg
