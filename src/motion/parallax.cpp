// SPDX-License-Identifier: LGPL-2.1-or-later
#include "motion/parallax.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <cstdlib>

#include "base/tuning.hpp"
#include "kernels/ground_warp.hpp"
#include "kernels/point_fit.hpp"

namespace terrainseg {
namespace {

TERRAINSEG_TUNED(int, parallax, ahead_margin,
                 20); ///< pixels that the hypothesis of a standing obstacle may lie above its cell when
                      ///< driving forward
TERRAINSEG_TUNED(int, parallax, behind_margin, 8); ///< pixels that a control may lie below its cell
TERRAINSEG_TUNED(int, parallax, side_margin, 32);  ///< multiple of the segments of 16 pixels
TERRAINSEG_TUNED(int, parallax, block,
                 16); ///< neighbouring pixels that share the direction of the translation
TERRAINSEG_TUNED(int, parallax, anchor_rows, 4); ///< rows between exactly mapped rows
/// Hypotheses: the position as ground, positions of standing obstacles (pixels along the translation), and
/// controls: below the ground (reflections, repeated patterns) and across the translation (misalignment).
constexpr std::array<int, 9> standing{1, 2, 3, 4, 6, 8, 11, 15, 20};
constexpr std::array<int, 3> sunken{-2, -4, -7};
constexpr int aside_q1 = 3; ///< halves of a pixel
/// Indices of the compared positions: ground, five controls, uniform grey (the contrast of the cell),
/// standing.
constexpr int first_control = 1, end_control = 6, even_grey = 6, first_standing = 7, end_standing = 16,
              hypotheses = 16;
static_assert(hypotheses == kernels::most_offsets && first_standing + standing.size() == end_standing);
TERRAINSEG_TUNED(int, parallax, most_left,
                 11); ///< sixteenths of the contrast that a match may leave unexplained
constexpr kernels::HypothesisOrder order{first_control, end_control, even_grey, first_standing, end_standing};

/// sqrt((k + 1/2) << 24) for k = 64..255.
constexpr auto roots = [] {
  std::array<std::uint32_t, 256> table{};
  for (std::uint64_t k = 0; k < 256; ++k) {
    std::uint64_t root = 0;
    for (int bit = 15; bit >= 0; --bit)
      if (const std::uint64_t next = root | (std::uint64_t{1} << bit); next * next <= (2 * k + 1) << 23)
        root = next;
    table[k] = static_cast<std::uint32_t>(root);
  }
  return table;
}();

/// A direction in the picture: unit vector in Q14, and length.
struct Direction {
  int x = 0, y = 0;
  std::int64_t length = 0;
};

Direction direction_of(std::int64_t x, std::int64_t y) {
  const auto most = static_cast<std::uint64_t>(std::max(std::abs(x), std::abs(y)));
  if (most == 0)
    return {};
  const int shift = static_cast<int>(std::bit_width(most)) - 15;
  const auto scaled = [shift](std::int64_t value) {
    return shift >= 0 ? value >> shift : value * (std::int64_t{1} << -shift);
  };
  const std::int64_t a = scaled(x), b = scaled(y);
  auto square = static_cast<std::uint64_t>(a * a + b * b); // 2^28 .. 2^31
  const bool half = square < std::uint64_t{1} << 30;
  if (half)
    square <<= 2;
  const auto root = std::int64_t{roots[std::min<std::uint64_t>(square >> 24, 255)]} >> (half ? 1 : 0);
  Direction d;
  const auto narrow = static_cast<std::int32_t>(root);
  d.x = static_cast<std::int32_t>(a) * 16384 / narrow;
  d.y = static_cast<std::int32_t>(b) * 16384 / narrow;
  d.length = shift >= 0 ? root << shift : root >> -shift;
  return d;
}

/// Direction of the ground's translation at a pixel, from t.x - x t.z and t.y - y t.z (Q24).
Direction ground_direction(const Translation& t, const GroundCamera& view, int across, int below) {
  const std::int64_t x = std::int64_t{across} * 32768 / view.focal, // Q16
      y = std::int64_t{below} * 256 / view.focal;
  return direction_of(t.x - (x * t.z >> 16), t.y - (y * t.z >> 16));
}

constexpr kernels::HypothesisShifts shifts = [] {
  kernels::HypothesisShifts all{};
  for (std::size_t k = 0; k < sunken.size(); ++k)
    all.along[first_control + k] = 2 * sunken[k];
  all.aside[end_control - 2] = aside_q1;
  all.aside[end_control - 1] = -aside_q1;
  for (std::size_t k = 0; k < standing.size(); ++k) {
    all.along[first_standing + k] = 2 * standing[k];
    all.least_reach[first_standing + k] = 80 * standing[k]; // s <= 1.2 |T| + 0.5
  }
  return all;
}();

} // namespace

int ground_shift(const PlaneMotion& motion, const GroundCamera& view, int across, int below) {
  const Direction d = ground_direction(translation_of(motion), view, across, below);
  return static_cast<int>(std::clamp<std::int64_t>(std::int64_t{below} * d.length >> 24, 0, 1 << 20));
}

std::int64_t MotionZone::near_from(int y) const {
  const std::int64_t square = std::int64_t{y} * y, limit = std::int64_t{near_row} * near_row;
  return y > 0 ? limit * limit / square - square : INT64_MAX;
}

void Parallax::resize(int width, int height) {
  columns_ = width / 4;
  rows_ = height / 4;
  segments_ = (width + 15) / 16 + 2 * side_margin / 16;
  stride_ = std::ptrdiff_t{16} * segments_;
  const int rows = height + ahead_margin + behind_margin;
  nodes_.assign((rows + anchor_rows) * (segments_ + 1) * 2, 0);
  across_.assign(segments_ + 1, 0);
  warped_.assign((rows + 4) * stride_, 128);
  sums_.assign((rows_ + 1) * hypotheses * (columns_ + 2), 0);
  seen_.assign((rows_ + 1) * (columns_ + 2), 0);
  shifts_.assign(rows_ * columns_, 0);
  costs_.assign(6 * columns_ + 2, 0);
  near_.assign(columns_ + 2, 0);
}

/// Warps the key frame to the current frame as if everything were ground, starting `above_` rows above the
/// first cells.
void Parallax::warp(const PassedView& key, const PlaneMotion& motion, const GroundCamera& view, int first,
                    int end) {
  const int top = 4 * first - above_, rows = 4 * (end - first) + ahead_margin + behind_margin;
  const std::ptrdiff_t numbers = std::ptrdiff_t{2} * (segments_ + 1);
  const kernels::PointMap map = pixel_map(motion, view);
  for (int s = 0; s <= segments_; ++s)
    across_[s] = across(view, 16 * s - side_margin);
  for (int y = 0; y <= rows; y += anchor_rows) {
    std::int32_t* node = nodes_.data() + y * numbers;
    kernels::map_row(map, across_.data(), below(view, top + y), segments_ + 1, node);
    for (std::ptrdiff_t i = 0; i < numbers; ++i)
      node[i] *= 256;
  }
  for (int y = 0; y < rows; y += anchor_rows) {
    const std::int32_t *from = nodes_.data() + y * numbers, *to = from + anchor_rows * numbers;
    for (int k = 1; k < anchor_rows; ++k) {
      std::int32_t* between = nodes_.data() + (y + k) * numbers;
      for (std::ptrdiff_t i = 0; i < numbers; ++i)
        between[i] = from[i] + (to[i] - from[i]) / anchor_rows * k;
    }
  }
  kernels::warp_rows(key, nodes_.data(), segments_, rows, warped_.data(), stride_);
}

/// Computes the offsets of all hypotheses from a block of cells. Returns the length of the ground's
/// translation there, in Q4 of a pixel.
int Parallax::place(const Translation& t, const GroundCamera& view, int left, int down, std::ptrdiff_t at,
                    std::int32_t* offsets) const {
  const Direction d = ground_direction(t, view, across(view, left) + block - 1, down);
  const auto length =
      static_cast<int>(std::clamp<std::int64_t>(std::int64_t{down} * d.length >> 28, 0, 65535));
  kernels::place_hypotheses(shifts, d.x, d.y, 6 * length + 40, above_, ahead_margin + behind_margin - above_,
                            static_cast<int>(stride_), offsets);
  offsets[even_grey] =
      static_cast<std::int32_t>(static_cast<std::ptrdiff_t>(warped_.size()) - 4 * stride_ - at);
  return length;
}

/// Computes the sums of a row of cells; 0 for cells that are not judged.
void Parallax::compare_row(const PassedView& picture, const Translation& t, const GroundCamera& view,
                           const std::uint8_t* ground, int row, const MotionZone& zone) {
  const int first = zone.first;
  const std::ptrdiff_t plane = columns_ + 2;
  std::uint16_t* sums = sums_.data() + (row - first) * hypotheses * plane + 1;
  std::uint16_t* seen = seen_.data() + (row - first) * plane + 1;
  std::uint16_t* shift = shifts_.data() + (row - first) * columns_;
  std::fill_n(sums - 1, hypotheses * plane, std::uint16_t{0});
  std::fill_n(seen - 1, plane, std::uint16_t{0});
  std::fill_n(shift, columns_, std::uint16_t{0});
  const int down = below(view, 4 * row) + 384;
  const std::uint8_t *here = ground + row * columns_, *above = row > 0 ? here - columns_ : here,
                     *under = row + 1 < rows_ ? here + columns_ : here;
  for (int j = 0; j < columns_; ++j)
    near_[j + 1] = above[j] | here[j] | under[j];
  const std::int64_t near_from = zone.near_from(down >> 8);
  for (int next = 0; next < columns_; next += block / 4) {
    const int j = std::min(next, columns_ - block / 4);
    const std::uint8_t* ground_around = near_.data() + j; // starts with the cell to the left
    const std::int64_t x = across(view, 4 * j + block / 2) / 2;
    if ((x * x >= near_from) != zone.near ||
        std::none_of(ground_around, ground_around + 6, [](std::uint8_t cell) { return cell != 0; }))
      continue;
    const std::ptrdiff_t at = (4 * (row - first) + above_) * stride_ + 4 * j + side_margin;
    std::array<std::int32_t, hypotheses> offsets{};
    const int length = place(t, view, 4 * j, down, at, offsets.data());
    if (length < 32) // two pixels
      continue;
    std::array<std::uint8_t, 4> whole{};
    kernels::compare_cells(picture.row(4 * row) + 4 * j, picture.width, warped_.data() + at, stride_,
                           offsets.data(), sums + j, plane, whole.data());
    for (int c = 0; c < 4; ++c) {
      const bool judged = whole[c] && (ground_around[c] | ground_around[c + 1] | ground_around[c + 2]) != 0;
      seen[j + c] = judged;
      shift[j + c] = static_cast<std::uint16_t>(judged ? length : 0);
      if (!judged)
        for (int k = 0; k < hypotheses; ++k)
          sums[k * plane + j + c] = 0;
    }
  }
}

void Parallax::compare(const PassedView& picture, const PassedView& key, const PlaneMotion& motion,
                       const GroundCamera& view, const std::uint8_t* ground, const MotionZone& zone,
                       std::vector<CellParallax>& cells, std::vector<std::uint8_t>& judged) {
  const int first = zone.first, end = zone.end;
  if (first >= end)
    return;
  const Translation t = translation_of(motion);
  above_ = t.z >= 0 ? ahead_margin : behind_margin;
  warp(key, motion, view, first, end);
  for (int i = first; i < end; ++i)
    compare_row(picture, t, view, ground, i, zone);
  for (int i = first; i < end; ++i)
    weigh_row(ground + i * columns_, i - first, end - first, cells.data() + i * columns_,
              judged.data() + i * columns_);
}

void Parallax::weigh_row(const std::uint8_t* ground, int row, int rows, CellParallax* cells,
                         std::uint8_t* judged) {
  const std::uint16_t* shifts = shifts_.data() + row * columns_;
  const std::ptrdiff_t plane = columns_ + 2;
  // The last row of the sums is empty.
  const int above = row > 0 ? row - 1 : rows_, under = row + 1 < rows ? row + 1 : rows_;
  const auto part = [&](int k) { return costs_.data() + k * columns_; };
  const kernels::WindowCosts costs{part(0), part(1), part(2), part(3), part(4)};
  const auto sums_of = [&](int i) { return sums_.data() + i * hypotheses * plane; };
  const auto seen_of = [&](int i) { return seen_.data() + i * plane; };
  kernels::window_costs(sums_of(above), sums_of(row), sums_of(under), columns_, plane, order, costs, part(5));
  const std::uint16_t *up = seen_of(above), *here = seen_of(row), *down = seen_of(under);
  for (int j = 0; j < columns_; ++j) {
    const int length = shifts[j];
    if (ground[j] == 0 || length == 0)
      continue;
    int seen = 0;
    for (int k = j; k < j + 3; ++k)
      seen += up[k] + here[k] + down[k];
    const int pixels = 16 * seen, ground_cost = costs.ground[j], best = costs.standing[j];
    int gain = std::clamp(std::min<int>(ground_cost, costs.control[j]) - best, -6 * pixels, 20 * pixels);
    if (16 * best >
        most_left * costs.even_grey[j]) // no position matches better than another: the cell was occluded
      gain = std::min(gain, 0);
    cells[j].quality = static_cast<std::int16_t>(gain * 4096 / (ground_cost + 10 * pixels));
    cells[j].ratio = static_cast<std::int16_t>(std::min(standing[costs.which[j]] * 16 * 4096 / length, 8191));
    judged[j] = 1;
  }
}

} // namespace terrainseg
