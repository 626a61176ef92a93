// SPDX-License-Identifier: LGPL-2.1-or-later
// Holes where motion says that something stands: a rendered drive through the whole core, and a board in it.
#include "freespace/holes/standing_things.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <optional>
#include <utility>

#include "terrainseg/segmenter.hpp"

namespace terrainseg {
namespace {

constexpr int width = 640, height = 360;

double hash(int x, int y) {
  auto h = static_cast<std::uint32_t>(x) * 374761393u + static_cast<std::uint32_t>(y) * 668265263u;
  h = (h ^ (h >> 13)) * 1274126177u;
  return static_cast<double>((h ^ (h >> 16)) & 65535) / 65536;
}

double noise(double x, double y) {
  const int ix = static_cast<int>(std::floor(x)), iy = static_cast<int>(std::floor(y));
  const double a = x - ix, b = y - iy;
  return (hash(ix, iy) * (1 - a) + hash(ix + 1, iy) * a) * (1 - b) +
         (hash(ix, iy + 1) * (1 - a) + hash(ix + 1, iy + 1) * a) * b;
}

/// A board of the ground's own grey and grain, 0.6 x 0.35 camera heights, 6 ahead of the start; whether a
/// pixel is it.
bool board_at(double x, double y, double ahead) {
  return ahead > 0.3 && std::abs(x * ahead) < 0.3 && y * ahead < 1 && y * ahead > 0.65;
}

struct Picture {
  std::vector<std::uint8_t> luma, chroma, board;
  Frame frame(std::int64_t pts) const {
    Frame f;
    f.format = PixelFormat::I420;
    f.width = width;
    f.height = height;
    f.planes = {Plane{luma.data(), width}, Plane{chroma.data(), width / 2}, Plane{chroma.data(), width / 2}};
    f.pts = pts;
    return f;
  }
};

Picture drawn(double z) {
  Picture p{std::vector<std::uint8_t>(width * height), std::vector<std::uint8_t>(width * height / 4, 128),
            std::vector<std::uint8_t>(width * height)};
  std::uint8_t *luma = p.luma.data(), *is_board = p.board.data();
  for (int v = 0; v < height; ++v)
    for (int u = 0; u < width; ++u) {
      const double x = (u - 319.5) / 525, y = (v - 150) / 525.0;
      const bool board = board_at(x, y, 6 - z);
      double grey = 230;
      if (board)
        grey = 85 + 70 * noise(x * (6 - z) * 9 + 90, y * (6 - z) * 9);
      else if (y > 0.01)
        grey = 75 + 50 * noise(x / y * 2.1, (1 / y + z) * 2.1) +
               40 / (1 + 0.17 / y) * noise(x / y * 7, (1 / y + z) * 7);
      *luma++ = static_cast<std::uint8_t>(grey);
      *is_board++ = board;
    }
  return p;
}

constexpr int frames = 60;

/// Of a camera that has driven 0.055 camera heights a frame. Every drive sees the same: drawn once.
const Picture& picture(int n) {
  static std::array<Picture, frames> pictures;
  Picture& p = pictures.at(static_cast<std::size_t>(n));
  if (p.luma.empty())
    p = drawn(n * 0.055);
  return p;
}

/// Share of the board that is called traversable, of the ground around it that is not, and the boundary's row
/// above it.
struct Seen {
  double board = 0, lost = 0;
  int boundary = 0, bottom = 0;
  std::int32_t vanishing_row = -1, speed = 0;
};

Seen drive(Motion motion, int mask_level, bool ignored = false) {
  Settings settings;
  settings.motion = motion;
  settings.mask_level = mask_level;
  if (ignored)
    settings.ignore_regions = {{0, 160, width, 200}};
  Segmenter segmenter(settings);
  for (int n = 0; n < frames; ++n)
    EXPECT_TRUE(segmenter.process(picture(n).frame(n * 50'000'000ll)).ok());
  const Picture& last = picture(frames - 1);
  Seen seen;
  const Estimate& e = segmenter.estimate();
  int board = 0, kept = 0, ground = 0, lost = 0;
  for (int v = 170; v < height; ++v)
    for (int u = 0; u < width; ++u) {
      const std::uint8_t mask = e.mask.plane.row(v >> mask_level)[u >> mask_level];
      if (last.board[static_cast<std::size_t>(v * width + u)]) {
        seen.bottom = v + 1;
        ++board;
        kept += mask == mask_traversable;
      } else if (v > 320 || std::abs(u - 320) > 150) {
        ++ground;
        lost += mask != mask_traversable;
      }
    }
  seen.board = static_cast<double>(kept) / board;
  seen.lost = static_cast<double>(lost) / ground;
  seen.boundary = e.boundary[static_cast<std::size_t>(320 >> mask_level)];
  seen.vanishing_row = e.vanishing_row;
  seen.speed = e.speed_over_height;
  return seen;
}

TEST(StandingThings, AreHolesWhateverTheirColour) {
  const Seen without = drive(Motion::off, 0);
  EXPECT_GT(without.board, 0.9) << "appearance tells nothing here";
  EXPECT_EQ(without.vanishing_row, -1);
  EXPECT_EQ(without.speed, 0);
  for (const int mask_level : {0, 1, 3}) {
    const Seen with = drive(Motion::automatic, mask_level);
    EXPECT_LT(with.board, 0.5) << mask_level; // its foot moves as the ground does
    EXPECT_LT(with.lost, without.lost + 0.01) << mask_level;
    EXPECT_GE(with.boundary, with.bottom - 8) << "the boundary begins below it, mask-level " << mask_level;
    EXPECT_LT(with.boundary, height) << mask_level;
    EXPECT_NEAR(with.vanishing_row / 65536.0, 150, 4);
    EXPECT_NEAR(with.speed / 65536.0, 1.1, 0.08); // 0.055 of the height in 50 ms
  }
}

// Moss on the ground is as odd as a stone in one frame. Two seconds later it has moved as the ground does.
TEST(StandingThings, APatchThatMovesAsTheGroundIsNoHole) {
  Settings off;
  off.motion = Motion::off;
  Segmenter with({}), without(off);
  long moss = 0, lost_with = 0, lost_without = 0;
  for (int n = 0; n < frames; ++n) {
    const double z = n * 0.055;
    Picture p = picture(n);
    std::vector<std::uint8_t> patch(p.luma.size());
    for (int v = 160; v < height; ++v)
      for (int u = 0; u < width; ++u) {
        const double x = (u - 319.5) / 525, y = (v - 150) / 525.0;
        const auto at = static_cast<std::size_t>(v * width + u);
        patch[at] = std::hypot((x / y + 1.1) / 0.25, (1 / y + z - 7) / 0.4) < 1;
        p.luma[at] = static_cast<std::uint8_t>(std::clamp(3 * (p.luma[at] - 75), 0, 255)); // more to be seen
        if (patch[at])
          p.chroma[static_cast<std::size_t>(v / 2 * (width / 2) + u / 2)] = 145;
      }
    ASSERT_TRUE(with.process(p.frame(n * 50'000'000ll)).ok());
    ASSERT_TRUE(without.process(p.frame(n * 50'000'000ll)).ok());
    if (n < 20 || n > 45)
      continue;
    for (int v = 160; v < height; ++v)
      for (int u = 0; u < width; ++u) {
        if (!patch[static_cast<std::size_t>(v * width + u)])
          continue;
        ++moss;
        lost_with += with.estimate().mask.plane.row(v)[u] != mask_traversable;
        lost_without += without.estimate().mask.plane.row(v)[u] != mask_traversable;
      }
  }
  EXPECT_GT(moss, 10000);
  EXPECT_GT(lost_without * 2, moss) << "the patch is odd";
  EXPECT_LT(lost_with * 20, moss);
}

// The line that is found lies at 150. What somebody knows is told from the first frame, and ground ends
// there.
TEST(StandingThings, ALineThatIsKnownEndsTheGround) {
  const auto told = [](int set, std::optional<std::int32_t> posed, Motion motion) {
    Settings settings;
    settings.vanishing_row = set;
    settings.motion = motion;
    Segmenter segmenter(settings);
    Frame frame = picture(0).frame(0);
    frame.vanishing_row = posed;
    EXPECT_TRUE(segmenter.process(frame).ok());
    const Estimate& e = segmenter.estimate();
    int first = height;
    for (int v = height - 1; v >= 0; --v)
      for (int u = 0; u < width; ++u)
        if (e.mask.plane.row(v)[u] == mask_traversable)
          first = v;
    return std::pair{e.vanishing_row, first};
  };
  for (const Motion motion : {Motion::automatic, Motion::off}) {
    EXPECT_EQ(told(-1, {}, motion).first, -1);
    for (const int row : {0, 150, 230, 359}) {
      EXPECT_EQ(told(row, {}, motion).first, row << 16);
      EXPECT_EQ(told(-1, row << 8, motion).first, row << 16);
      EXPECT_GE(told(row, {}, motion).second, row - height / 32 - 8) << "a 32nd above it, and a cell";
      EXPECT_GE(told(-1, row << 8, motion).second, row - height / 32 - 8);
    }
    EXPECT_EQ(told(230, 150 << 8, motion).first, 230 << 16) << "what is set stands above a pose";
    EXPECT_EQ(told(-100, {}, motion).first, -1) << "above the picture";
    EXPECT_EQ(told(-1, -(100 << 8), motion).first, -1);
    // Below the picture a setting is none, for there would be no ground; a pose may look at the sky.
    EXPECT_EQ(told(height, {}, motion), told(-1, {}, motion));
    const auto [line, first] = told(-1, (height + 40) << 8, motion);
    EXPECT_EQ(line, -1);
    EXPECT_GE(first, height - height / 32 - 8);
    for (const std::int32_t wild : {INT32_MIN, INT32_MAX})
      EXPECT_EQ(told(-1, wild, motion).first, -1);
  }
}

TEST(StandingThings, SayNothingOfWhatIsIgnored) {
  const Seen seen = drive(Motion::automatic, 0, true);
  EXPECT_EQ(seen.vanishing_row, -1);
  EXPECT_EQ(seen.speed, 0);
}

} // namespace
} // namespace terrainseg
