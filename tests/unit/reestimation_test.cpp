// SPDX-License-Identifier: LGPL-2.1-or-later
#include "freespace/curve/reestimation.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <random>

#include <gtest/gtest.h>

#include "freespace/look/color_bins.hpp"
#include "support/grids.hpp"

namespace terrainseg {
namespace {

// Along each axis 1-2-1 with the ends repeated, by the definition.
std::vector<double> blurred(std::vector<double> h, const std::vector<int>& axes) {
  for (const int slice : axes) {
    const int count = slice == 256 ? 8
                      : slice == 0 ? static_cast<int>(h.size())
                                   : 16,
              step = std::max(slice, 1);
    std::vector<double> out(h.size());
    for (int i = 0; i < static_cast<int>(h.size()); ++i) {
      const int k = i / step % count;
      out[i] = (h[k > 0 ? i - step : i] + 2 * h[i] + h[k + 1 < count ? i + step : i]) / 4;
    }
    h = out;
  }
  return h;
}

TEST(ColorHistogram, BlursAlongEveryAxis) {
  std::mt19937 dice(3);
  std::vector<std::uint32_t> in(color_bins), between(color_bins), out(color_bins);
  for (auto& bin : in)
    bin = dice() % 3 ? 0 : 64 * (dice() % 1000);
  blur_colors(in, {}, between, out);
  const std::vector<double> expected = blurred(std::vector<double>(in.begin(), in.end()), {256, 16, 1});
  for (std::size_t i = 0; i < out.size(); ++i)
    ASSERT_EQ(out[i], expected[i]) << i; // multiples of 64 lose nothing
  for (const BinRange u : {BinRange{0, 1}, BinRange{3, 7}, BinRange{15, 16}}) {
    std::vector<std::uint32_t> part(color_bins, 0);
    blur_colors(in, u, between, part);
    for (std::size_t i = 0; i < part.size(); ++i)
      if (const int bin = static_cast<int>(i) / 16 % 16; bin >= u.first && bin < u.end) {
        ASSERT_EQ(part[i], out[i]) << i;
      }
  }
  in.assign(color_bins, 0);
  in[color_bins - 1] = 0xffffffffu / 3; // as much as there may be, where ends are repeated
  blur_colors(in, {}, between, out);
  EXPECT_NEAR(out[color_bins - 1], in[color_bins - 1] * 27.0 / 64, 3);
}

// A place with its boundary in the middle: bins by cell, all scores 0.
struct Place {
  test::OwnedGrid grid = test::gray_grid(24, 20);
  CellBins cells;
  GridCurve boundary = GridCurve(24, 10);
  CellPenalties penalty = CellPenalties(480, 0);
  CellScores score = CellScores(480, 0), revised;
  Reestimation look;

  Place() {
    cells.color.assign(480, 700);
    cells.texture.assign(480, 12);
  }
  bool revise() { return look.revise(grid, cells, boundary, penalty, score, revised); }
};

TEST(Reestimation, IsTheWeightedRatioOfBothSides) {
  std::mt19937 dice(9);
  for (int round = 0; round < 30; ++round) {
    Place p;
    for (auto& row : p.boundary)
      row = static_cast<std::uint16_t>(4 + dice() % 12);
    for (int i = 0; i < 20; ++i)
      for (int j = 0; j < 24; ++j) {
        const std::size_t cell = p.grid.at(i, j);
        const bool ground = i >= p.boundary[static_cast<std::size_t>(j)];
        p.cells.color[cell] =
            static_cast<std::uint16_t>((ground ? 300 : 1200) + dice() % (round % 2 ? 800 : 60));
        p.cells.texture[cell] = static_cast<std::uint8_t>((ground ? 4 : 9) + dice() % 12);
        p.grid.ignored[cell] = dice() % 15 == 0;
        p.penalty[cell] = static_cast<std::int8_t>(dice() % 3 ? 0 : dice() % 44);
        p.score[cell] = static_cast<std::int16_t>(static_cast<int>(dice() % 1400) - 700);
      }
    ASSERT_TRUE(p.revise());

    std::array<std::vector<double>, 2> color, texture;
    std::array<double, 2> total{}, count{};
    for (int side = 0; side < 2; ++side) {
      color[side].assign(2048, 0);
      texture[side].assign(24, 0);
      for (int i = 0; i < 20; ++i)
        for (int j = 0; j < 24; ++j) {
          const std::size_t cell = p.grid.at(i, j);
          if (p.grid.ignored[cell] || (i >= p.boundary[static_cast<std::size_t>(j)]) != (side == 0))
            continue;
          ++color[side][p.cells.color[cell]];
          ++texture[side][p.cells.texture[cell]];
          ++count[side];
        }
      color[side] = blurred(color[side], {256, 16, 1});
      texture[side] = blurred(texture[side], {0});
      for (const double c : color[side])
        total[side] += c;
    }
    GridCurve sorted = p.boundary;
    std::sort(sorted.begin(), sorted.end());
    const int first = sorted[2]; // a tenth of 24 columns lie above it
    for (int i = 0; i < 20; ++i)
      for (int j = 0; j < 24; ++j) {
        const std::size_t cell = p.grid.at(i, j);
        const int c = p.cells.color[cell], t = p.cells.texture[cell];
        double says = 0;
        if (!p.grid.ignored[cell]) {
          const double of_color = 0.25 * 32 *
                                  std::log((color[0][c] + 1) / (total[0] + 50) * (total[1] + 50) /
                                           (color[1][c] + 1)),
                       of_texture = 0.125 * 32 *
                                    std::log((texture[0][t] + 1) / (count[0] + 24) * (count[1] + 24) /
                                             (texture[1][t] + 1));
          const double most = i < first ? 0 : std::max(0, 12 - 2 * p.penalty[cell]);
          says = std::min(std::clamp(of_color, -12.0, 12.0), most) +
                 std::min(std::clamp(of_texture, -12.0, 12.0), i < first ? 0.0 : 12.0);
        }
        ASSERT_NEAR(p.revised[cell], p.score[cell] + 16 * says, 6) << i << ' ' << j;
      }
  }
}

TEST(Reestimation, GroundThatTheWindowNeverSawIsToldByTheRestOfTheGround) {
  Place p;
  for (int i = 0; i < 20; ++i)
    for (int j = 0; j < 24; ++j) {
      const std::size_t cell = p.grid.at(i, j);
      const bool shade = j >= 12;
      p.cells.color[cell] = i < 10 ? 40 : shade ? 500 : 1100;
      p.score[cell] = i < 10 ? -400 : shade ? -60 : 400;
    }
  ASSERT_TRUE(p.revise());
  EXPECT_GT(p.revised[p.grid.at(15, 20)], 60);
  EXPECT_LE(p.revised[p.grid.at(3, 20)], -500);
}

TEST(Reestimation, OneSideAloneTellsNothing) {
  Place p;
  p.boundary.assign(24, 0);
  EXPECT_FALSE(p.revise());
  p.boundary.assign(24, 20);
  EXPECT_FALSE(p.revise());
  EXPECT_TRUE(p.revised.empty());
}

} // namespace
} // namespace terrainseg
