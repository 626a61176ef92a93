// SPDX-License-Identifier: LGPL-2.1-or-later
#include "freespace/curve/evidence.hpp"

#include <algorithm>
#include <array>

#include "terrainseg/estimate.hpp"

namespace terrainseg {
namespace {

/// Cells of one colour are wrong together: what a score (Q4) says counts for a third of it, a logistic
/// regression over 23 sets of pictures says. How often the sum is right is measured in docs/metadata.md.
constexpr int score_weight = 5, score_shift = 8, score_limit = 96 * 16;
/// A row of cells between a cell and the boundary, 32 = 1 nat, and the most rows that count.
constexpr int row_weight = 10, most_rows = 8;
/// A cell as odd as its surroundings often are (Q4 of a deviation) says nothing; 32 more are half a nat.
constexpr int usual_oddness = 24;
/// What stands: 16 of 256 are a nat, and this is the most.
constexpr int standing_weight = 2, most_standing = 8 * 32;
/// Of the whole picture: a label without any other evidence, and 255 of the mask's confidence.
constexpr int without_confidence = -45, full_confidence = 80;

/// 255 * tanh(x / 2) for x = 0, 1/2, 1 .. 6 nats.
constexpr int step_bits = 4;
constexpr std::array<std::uint8_t, 13> certainty{0,   62,  118, 162, 194, 216, 231,
                                                 240, 246, 249, 252, 253, 254};

} // namespace

std::uint8_t confidence_of(int evidence) {
  const int most = (static_cast<int>(certainty.size()) - 1) << step_bits,
            e = std::clamp(evidence, 0, most - 1);
  const auto step = static_cast<std::size_t>(e >> step_bits);
  const int part = e & ((1 << step_bits) - 1);
  return static_cast<std::uint8_t>(certainty[step] +
                                   (((certainty[step + 1] - certainty[step]) * part) >> step_bits));
}

void Evidence::start(const Grid& grid, const CellScores& score, const GridCurve& boundary,
                     const GroundBehind& behind) {
  level_ = grid.level;
  width_ = grid.width;
  height_ = grid.height;
  sums_.resize(grid.size());
  for (int i = 0; i < height_; ++i)
    for (int j = 0; j < width_; ++j) {
      const auto x = static_cast<std::size_t>(j);
      // Half a row, so that the rows next to a curve are equally far from it. Above 0: ground.
      int rows = 2 * (i - boundary[x]) + 1;
      if (behind.any && rows < 0 && i >= behind.first[x] && i < behind.end[x])
        rows = 2 * std::min(i - behind.first[x], behind.end[x] - 1 - i) + 1;
      const std::size_t cell = grid.at(i, j);
      const int appearance =
          std::clamp<int>(score[cell], -score_limit, score_limit) * score_weight >> score_shift;
      const int place = std::clamp(rows, -2 * most_rows, 2 * most_rows) * row_weight / 2;
      sums_[cell] = static_cast<std::int16_t>(appearance + place);
    }
}

// A cell of the grid has what the strongest one in it has.
template <typename Value, typename Strength>
void Evidence::subtract(const FinerCells<Value>& cells, Strength strength) {
  const int half = 1 << level_ >> 1;
  const auto cell_of = [&](int index, int count) {
    return std::min(((index << cells.level) + cells.middle + half) >> level_, count - 1);
  };
  strongest_.assign(sums_.size(), 0);
  for (int y = 0; y < cells.height; ++y) {
    const Value* const in =
        cells.values.data() + static_cast<std::size_t>(y) * static_cast<std::size_t>(cells.width);
    std::int16_t* const out =
        &strongest_[static_cast<std::size_t>(cell_of(y, height_)) * static_cast<std::size_t>(width_)];
    for (int x = 0; x < cells.width; ++x)
      if (in[x] != 0) {
        std::int16_t& most = out[cell_of(x, width_)];
        most = std::max(most, static_cast<std::int16_t>(strength(in[x])));
      }
  }
  for (std::size_t cell = 0; cell < sums_.size(); ++cell)
    sums_[cell] = static_cast<std::int16_t>(sums_[cell] - strongest_[cell]);
}

void Evidence::subtract_oddness(const FinerCells<std::uint8_t>& oddness) {
  subtract(oddness, [](int odd) { return std::max(odd - usual_oddness, 0) / 2; });
}

void Evidence::subtract_standing(const FinerCells<std::int16_t>& standing) {
  subtract(standing, [](int stands) { return std::clamp(stands * standing_weight, 0, most_standing); });
}

void Evidence::tell(const Grid& grid, const GrayView& mask, int mask_level, std::uint8_t frame_confidence,
                    const MutablePlane& confidence) const {
  const int whole = without_confidence + full_confidence * frame_confidence / 255;
  for (int i = 0; i < height_; ++i) {
    const std::uint8_t* const labels =
        mask.plane.row(std::min(subsampled(i << level_, mask_level), mask.height - 1));
    std::uint8_t* const out = confidence.row(i);
    for (int j = 0; j < width_; ++j) {
      const std::size_t cell = grid.at(i, j);
      const bool ground =
          labels[std::min(subsampled(j << level_, mask_level), mask.width - 1)] == mask_traversable;
      out[j] =
          grid.ignored[cell] ? std::uint8_t{0} : confidence_of((ground ? sums_[cell] : -sums_[cell]) + whole);
    }
  }
}

} // namespace terrainseg
