// SPDX-License-Identifier: LGPL-2.1-or-later
#include "freespace/holes/candidate_cells.hpp"

#include <random>
#include <utility>

#include <gtest/gtest.h>

namespace terrainseg {
namespace {

/// The piece of each marked cell by flooding from its first cell; -1 where there is no mark.
std::vector<int> flooded(const std::vector<std::uint8_t>& marks, int width, int first, int height) {
  std::vector<int> pieces(marks.size(), -1);
  int count = 0;
  for (int start = first * width; start < width * height; ++start) {
    if (!marks[static_cast<std::size_t>(start)] || pieces[static_cast<std::size_t>(start)] >= 0)
      continue;
    std::vector<int> waiting{start};
    while (!waiting.empty()) {
      const int cell = waiting.back();
      waiting.pop_back();
      pieces[static_cast<std::size_t>(cell)] = count;
      for (int y = cell / width - 1; y <= cell / width + 1; ++y)
        for (int x = cell % width - 1; x <= cell % width + 1; ++x) {
          const auto other = static_cast<std::size_t>(y * width + x);
          if (y >= first && y < height && x >= 0 && x < width && marks[other] && pieces[other] < 0)
            waiting.push_back(static_cast<int>(other));
        }
    }
    ++count;
  }
  return pieces;
}

TEST(Pieces, AreThoseOfAFlood) {
  std::mt19937 random(1);
  Pieces pieces; // one for all sizes
  for (int round = 0; round < 400; ++round) {
    const int width = 1 + static_cast<int>(random() % 40), height = 1 + static_cast<int>(random() % 30),
              first = static_cast<int>(random() % static_cast<unsigned>(height + 1));
    std::vector<std::uint8_t> marks(static_cast<std::size_t>(width * height));
    for (auto& mark : marks)
      mark = random() % 100 < static_cast<unsigned>(round % 10 + 1) * 10;
    const std::vector<int> truth = flooded(marks, width, first, height);
    pieces.reserve(width, height);
    pieces.find(marks.data(), width, first, height);
    std::vector<int> found(marks.size(), -1);
    for (const Pieces::Run& run : pieces.runs())
      for (int x = run.from; x < run.to; ++x)
        found[static_cast<std::size_t>(run.row * width + x)] = static_cast<int>(run.piece);
    ASSERT_EQ(found, truth) << round;
    std::size_t visited = 0;
    for (std::uint32_t piece = 0; piece < pieces.count(); ++piece) {
      std::pair before(-1, -1);
      pieces.each_run(piece, [&](const Pieces::Run& run) {
        ASSERT_EQ(run.piece, piece);
        ASSERT_LT(before, std::pair(run.row, run.from)) << "row by row";
        if (before.first < 0) {
          ASSERT_EQ(&run, &pieces.first_run(piece));
        }
        before = {run.row, run.from};
        ++visited;
      });
    }
    ASSERT_EQ(visited, pieces.runs().size()) << round;
  }
}

TEST(Pieces, AreNoneWithoutMarks) {
  Pieces pieces;
  const std::vector<std::uint8_t> marks(12, 0), all(12, 1);
  pieces.reserve(4, 3);
  pieces.find(marks.data(), 4, 0, 3);
  EXPECT_EQ(pieces.count(), 0u);
  pieces.find(all.data(), 4, 3, 3);
  EXPECT_EQ(pieces.count(), 0u) << "no rows";
  pieces.find(all.data(), 4, 0, 3);
  EXPECT_EQ(pieces.count(), 1u);
  EXPECT_EQ(pieces.runs().size(), 3u) << "a run does not continue in the next row";
}

} // namespace
} // namespace terrainseg
