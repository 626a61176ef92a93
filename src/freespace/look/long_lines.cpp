// SPDX-License-Identifier: LGPL-2.1-or-later
#include "freespace/look/long_lines.hpp"

#include <algorithm>
#include <cstdlib>

#include "base/tuning.hpp"

namespace terrainseg {
namespace {

/// The finest level whose sides are at most this long is searched; 320 finds as many lines.
constexpr int longest_side = 256;
/// Four times the smallest step of an edge, in grey levels. 20 and 48 give the same error; 20 costs more
/// time.
TERRAINSEG_TUNED(int, long_lines, least_step, 32);
/// Slopes of edges: from 1 : 9 (6 degrees) to 11 : 4 (70). Flatter edges meet too far away, steeper ones may
/// be vertical.
constexpr int flattest = 9, steepest_up = 11, steepest_along = 4;
/// A pixel votes for the normals within 3.5 degrees of its gradient.
constexpr int normals = 128, neighbours = 2;
/// Inverse of the shortest length of a line, in widths of the picture.
TERRAINSEG_TUNED(int, long_lines, shortest, 14);
constexpr std::size_t most_lines = 40;
/// Largest angle (Q14 of its sine) between a line and the direction from its middle to the meeting point.
TERRAINSEG_TUNED(int, long_lines, widest_angle, 819);
/// Least distance of the meeting point from the middle of a line, in hundredths of its length, Q4: a line may
/// end there, but not cross it.
TERRAINSEG_TUNED(int, long_lines, beyond, 16 * 45);
/// Least share of all lines, and least length in widths, both per cent, of those that meet: twice the smaller
/// one of the lengths that come from the left and from the right. With 25 and 40 the edges of a cupboard that
/// is seen from above are 5 points of error; with 40 and 60 fewer lines are found.
TERRAINSEG_TUNED(int, long_lines, least_share, 35);
TERRAINSEG_TUNED(int, long_lines, least_length, 60);
/// Frames from one look to the next, but for the first frames, and those after a look that disagrees with the
/// one before. 8 to 14 give the same error, 16 has more in corridors.
TERRAINSEG_TUNED(std::uint32_t, long_lines, interval, 12);
/// Looks that may find nothing until the row is forgotten.
TERRAINSEG_TUNED(std::uint32_t, long_lines, most_misses, 4);
/// Inverse of the largest difference between rows that agree, in heights of the frame.
TERRAINSEG_TUNED(int, long_lines, same_row, 48);

using Short = std::int16_t;

struct Direction {
  std::int32_t c, s; ///< cosine and sine, Q14
};

/// Directions from 0 to 180 degrees in steps of 180 / (2 * normals): even ones are limits of the normals, odd
/// ones their middles. Each is the one before, turned.
constexpr auto directions = [] {
  constexpr std::int64_t cosine = 1073660973, sine = 13176464, one = 1 << 30; // Q30, of pi / 256
  std::array<Direction, 2 * normals + 1> table{};
  std::int64_t c = one, s = 0;
  for (Direction& direction : table) {
    direction = {static_cast<std::int32_t>((c + (1 << 15)) >> 16),
                 static_cast<std::int32_t>((s + (1 << 15)) >> 16)};
    const std::int64_t turned = (c * cosine - s * sine) / one;
    s = (s * cosine + c * sine) / one;
    c = turned;
  }
  return table;
}();

// Whether the direction (across, down) lies behind the lower limit of a normal.
constexpr bool is_behind(int normal, int across, int down) {
  const Direction& limit = directions[2 * normal];
  return limit.c * down >= limit.s * across;
}

// The way from (1, 0) by (0, 1) to (-1, 0) is divided into shares. Each is shorter than a normal and lies in
// the normal of the table, or in that and the next one.
constexpr int shares = 256;
constexpr auto normal_of_share = [] {
  std::array<std::uint8_t, shares + 1> table{};
  int normal = 0;
  for (int share = 0; share <= shares; ++share) {
    const int across = shares / 2 - share, down = shares / 2 - (across < 0 ? -across : across);
    while (normal < normals - 2 && is_behind(normal + 1, across, down))
      ++normal;
    table[share] = static_cast<std::uint8_t>(normal);
  }
  return table;
}();

// The normal whose limits enclose the direction (across, down); down > 0.
int normal_of(int across, int down) {
  const int whole = std::abs(across) + down;
  const int normal = normal_of_share[shares / 2 * (whole - across) / whole];
  return normal + static_cast<int>(is_behind(normal + 1, across, down));
}

const Direction& middle_of(int normal) {
  return directions[2 * normal + 1];
}

template <typename Number> Number magnitude(Number value) {
  return static_cast<Number>(value < 0 ? -value : value);
}

// Length of a vector with these magnitudes, 7 % too long at most.
template <typename Number> Number length_of(Number x, Number y) {
  const Number more = x > y ? x : y, less = x > y ? y : x;
  return static_cast<Number>(more + static_cast<Number>(static_cast<Number>(3 * less) >> 3));
}

constexpr std::size_t block = 64; ///< votes that are searched together

// Auto-vectorised.
Short largest(const Short* __restrict votes) {
  Short most = 0;
  for (std::size_t i = 0; i < block; ++i)
    most = std::max(most, votes[i]);
  return most;
}

// Sobel's gradients of a row, and where they may be those of an edge. Auto-vectorised, in 16 bits.
void compare(const std::uint8_t* __restrict a, const std::uint8_t* __restrict b,
             const std::uint8_t* __restrict c, int width, Short* __restrict across, Short* __restrict down,
             Short* __restrict lengths, std::uint8_t* __restrict steep) {
  for (int j = 1; j < width - 1; ++j) {
    const auto x = static_cast<Short>(a[j + 1] - a[j - 1] + 2 * (b[j + 1] - b[j - 1]) + c[j + 1] - c[j - 1]);
    const auto y = static_cast<Short>(c[j - 1] + 2 * c[j] + c[j + 1] - a[j - 1] - 2 * a[j] - a[j + 1]);
    const Short length_x = magnitude(x), length_y = magnitude(y);
    across[j] = x;
    down[j] = y;
    lengths[j] = length_of(length_x, length_y);
    const bool strong = static_cast<Short>(length_x + length_y) >= static_cast<Short>(least_step),
               steeper = static_cast<Short>(flattest * length_x) > length_y,
               flatter =
                   static_cast<Short>(steepest_along * length_x) < static_cast<Short>(steepest_up * length_y);
    steep[j] = strong & steeper & flatter;
  }
}

// Leaves the pixels of a row whose gradient is the longest across the edge. Auto-vectorised, in 16 bits.
void thin(const Short* __restrict across, const Short* __restrict down, const Short* __restrict above,
          const Short* __restrict here, const Short* __restrict below, int width,
          std::uint8_t* __restrict steep) {
  for (int j = 2; j < width - 2; ++j) {
    const Short x = across[j], y = down[j];
    const Short length_x = magnitude(x), length_y = magnitude(y);
    // The tangent of 21.8 degrees is 2 / 5.
    const bool sideways = static_cast<Short>(5 * length_y) < static_cast<Short>(2 * length_x),
               upwards = static_cast<Short>(5 * length_x) < static_cast<Short>(2 * length_y),
               falling = static_cast<Short>(x ^ y) >= 0;
    const Short a0 = above[j - 1], a1 = above[j], a2 = above[j + 1], b0 = here[j - 1], b1 = here[j],
                b2 = here[j + 1], c0 = below[j - 1], c1 = below[j], c2 = below[j + 1];
    Short next = falling ? c2 : c0, last = falling ? a0 : a2;
    next = upwards ? c1 : next;
    last = upwards ? a1 : last;
    next = sideways ? b2 : next;
    last = sideways ? b0 : last;
    steep[j] &= static_cast<std::uint8_t>((b1 >= next) & (b1 > last));
  }
}

} // namespace

void LongLines::prepare(const LumaLevels& luma, int grid_level) {
  const auto fits = [&](int level) {
    return std::max(luma.level(level).width, luma.level(level).height) <= longest_side;
  };
  level_ = grid_level;
  while (level_ > texture_level(grid_level) && fits(level_ - 1))
    --level_;
  constexpr int least_side = 16;
  const GrayView& view = luma.level(level_);
  const bool searched = fits(level_) && std::min(view.width, view.height) >= least_side;
  width_ = searched ? view.width : 0;
  height_ = searched ? view.height : 0;
  reach_ = (width_ + height_) / 2 + 1;
  const auto size = static_cast<std::size_t>(width_) * static_cast<std::size_t>(height_);
  across_.resize(size);
  down_.resize(size);
  steep_.resize(size);
  lengths_.resize(size);
  columns_.resize(static_cast<std::size_t>(width_));
  edges_.reserve(size);
  votes_.resize(static_cast<std::size_t>(2 * normals * (2 * reach_ + 1)));
  owner_.resize(votes_.size());
  peaks_.reserve(votes_.size());
  lines_.reserve(most_lines);
}

std::optional<std::int32_t> LongLines::meeting_row(const LumaLevels& luma) {
  if (width_ == 0)
    return std::nullopt;
  find_edges(luma.level(level_).plane);
  vote();
  pick_lines();
  const auto row = best_meeting_point();
  if (!row)
    return std::nullopt;
  return (*row + 8 * height_) * (16 << level_); // from the centre in Q4 to the frame's in Q8
}

void LongLines::find_edges(const Plane& luma) {
  for (int i = 1; i < height_ - 1; ++i) {
    const int at = i * width_;
    compare(luma.row(i - 1), luma.row(i), luma.row(i + 1), width_, &across_[at], &down_[at], &lengths_[at],
            &steep_[at]);
  }
  edges_.clear();
  for (int i = 2; i < height_ - 2; ++i) {
    const int at = i * width_;
    thin(&across_[at], &down_[at], &lengths_[at - width_], &lengths_[at], &lengths_[at + width_], width_,
         &steep_[at]);
    take_edges(i);
  }
}

void LongLines::take_edges(int i) {
  const std::size_t row = static_cast<std::size_t>(i) * width_;
  std::size_t count = 0; // without branches, which a processor would guess wrongly
  for (int j = 2; j < width_ - 2; ++j) {
    columns_[count] = static_cast<std::int16_t>(j);
    count += steep_[row + j];
  }
  for (std::size_t k = 0; k < count; ++k) {
    const int j = columns_[k], x = across_[row + j], y = down_[row + j];
    const bool falls = y < 0;
    edges_.push_back({static_cast<std::int16_t>(j - width_ / 2), static_cast<std::int16_t>(i - height_ / 2),
                      static_cast<std::uint8_t>(normal_of(falls ? -x : x, std::abs(y))), falls});
  }
}

// The element of votes_ for the line with that normal through a pixel.
std::size_t LongLines::cell(const EdgePixel& pixel, int normal) const {
  const Direction& direction = middle_of(normal);
  const int distance = (pixel.x * direction.c + pixel.y * direction.s + (1 << 13)) >> 14;
  return static_cast<std::size_t>((normal + (pixel.falls ? normals : 0)) * (2 * reach_ + 1) + distance +
                                  reach_);
}

void LongLines::vote() {
  std::fill(votes_.begin(), votes_.end(), Short{0});
  for (const EdgePixel& pixel : edges_)
    for (int normal = pixel.normal - neighbours; normal <= pixel.normal + neighbours; ++normal)
      ++votes_[cell(pixel, normal)];
}

// The lines with the most votes, each at some distance from those before it.
void LongLines::pick_lines() {
  constexpr int apart = 8, beside = 4; // normals, pixels
  constexpr std::uint8_t taken = 1, first_line = 2;
  const int least = width_ / shortest, row = 2 * reach_ + 1;
  peaks_.clear();
  const Short* const votes = votes_.data();
  for (std::size_t i = 0; i < votes_.size(); i += block) // a multiple of the block
    if (largest(votes + i) >= least)
      for (std::size_t j = i; j < i + block; ++j)
        if (votes[j] >= least)
          peaks_.push_back(static_cast<std::uint32_t>(j));
  std::sort(peaks_.begin(), peaks_.end(), [&](std::uint32_t a, std::uint32_t b) {
    return votes_[a] != votes_[b] ? votes_[a] > votes_[b] : a < b;
  });
  std::fill(owner_.begin(), owner_.end(), std::uint8_t{0});
  lines_.clear();
  for (const std::uint32_t peak : peaks_) {
    if (owner_[peak] != 0)
      continue;
    const int line = static_cast<int>(peak) / row, at = static_cast<int>(peak) % row;
    const int polarity = line / normals * normals, normal = line % normals;
    for (int n = std::max(normal - apart, 0); n <= std::min(normal + apart, normals - 1); ++n)
      std::fill(&owner_[(polarity + n) * row + std::max(at - beside, 0)],
                &owner_[(polarity + n) * row + std::min(at + beside, row - 1)] + 1, taken);
    owner_[peak] = static_cast<std::uint8_t>(first_line + lines_.size());
    const Direction& direction = middle_of(normal);
    lines_.push_back({0, 0, direction.c, direction.s, 0});
    if (lines_.size() == most_lines)
      break;
  }
  for (const EdgePixel& pixel : edges_)
    for (int normal = pixel.normal - neighbours; normal <= pixel.normal + neighbours; ++normal)
      if (const int owner = owner_[cell(pixel, normal)]; owner >= first_line) {
        Line& line = lines_[owner - first_line];
        line.x += pixel.x;
        line.y += pixel.y;
        ++line.length;
      }
  for (Line& line : lines_) {
    line.x = 16 * line.x / line.length;
    line.y = 16 * line.y / line.length;
    line.length = (line.length << 14) / std::max(line.s, std::abs(line.c)); // a pixel per column or row
  }
}

std::optional<std::int32_t> LongLines::best_meeting_point() const {
  std::int64_t most = 0, all = 0;
  std::int32_t row = 0;
  for (const Line& line : lines_)
    all += line.length;
  const auto offset = [](const Line& line) { // Q18
    return std::int64_t{line.c} * line.x + std::int64_t{line.s} * line.y;
  };
  for (const Line& left : lines_)
    for (const Line& right : lines_) {
      // An edge whose normal points to the right goes up to the right: it comes from the left.
      const std::int64_t turn = std::int64_t{left.c} * right.s - std::int64_t{right.c} * left.s; // Q28
      if (left.c <= 0 || right.c >= 0 || turn < 1 << 26)
        continue;
      const std::int64_t x = (offset(left) * right.s - offset(right) * left.s) / turn; // Q4
      const std::int64_t y = (left.c * offset(right) - right.c * offset(left)) / turn;
      if (std::abs(x) > 12 * width_ || 10 * y < -112 * height_ || 100 * y > 560 * height_)
        continue;
      std::array<std::int64_t, 2> lengths{};
      for (const Line& line : lines_) {
        const std::int64_t dx = x - line.x, dy = y - line.y,
                           away = length_of(magnitude(dx), magnitude(dy));                           // Q4
        const std::int64_t beside = std::abs(dx * line.c + dy * line.s), room = widest_angle * away; // Q18
        if (beside < room && 100 * away > beyond * line.length)
          lengths[line.c > 0 ? 0 : 1] += line.length * (room - beside) / room;
      }
      if (const std::int64_t length = 2 * std::min(lengths[0], lengths[1]); length > most) {
        most = length;
        row = static_cast<std::int32_t>(y);
      }
    }
  if (100 * most < least_share * all || 100 * most < least_length * width_ || most == 0)
    return std::nullopt;
  return row;
}

bool LineWatch::due(int frame_height) {
  constexpr std::uint32_t at_first = 4;
  if (height_ != frame_height)
    *this = {};
  height_ = frame_height;
  const std::uint32_t frame = frames_++, since = frame % interval;
  const bool disagrees = row_q8_ && !agreed_;
  return since == 0 || (since < at_first && (frame == since || disagrees));
}

void LineWatch::take(std::optional<std::int32_t> row_q8) {
  if (!row_q8) {
    if (++misses_ > most_misses) {
      row_q8_.reset();
      agreed_ = false;
    }
    return;
  }
  agreed_ = row_q8_ && std::abs(*row_q8 - *row_q8_) <= (height_ << 8) / same_row;
  row_q8_ = row_q8;
  misses_ = 0;
}

} // namespace terrainseg
