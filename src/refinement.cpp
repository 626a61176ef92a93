// SPDX-License-Identifier: LGPL-2.1-or-later
#include "refinement.hpp"

#include <algorithm>
#include <array>
#include <cstdlib>

#include "terrainseg/settings.hpp"

namespace terrainseg {
namespace {

constexpr int reach = 3; ///< rows of the refinement's level
constexpr int median_reach = 2;

// The median of five without a loop.
int median5(int a, int b, int c, int d, int e) {
  const int low = std::max(std::min(a, b), std::min(c, d)), high = std::min(std::max(a, b), std::max(c, d));
  return std::max(std::min(low, high), std::min(std::max(low, high), e));
}

} // namespace

void Refinement::refine(const Pyramid& pyramid, const CoarseGrid& grid, const ColorTransform& transform,
                        const std::vector<std::uint16_t>& curve, bool snap, int mask_level, int frame_width,
                        int frame_height, std::vector<std::uint16_t>& rows) {
  const int level = refinement_level(grid.level), ratio = 1 << (grid.level - level);
  const int width = pyramid.width(level), height = pyramid.height(level);
  const int all = -1, none = 2 * height - 1; // every row is ground; no row is
  const auto is_open = [&](int edge) { return edge <= all || edge >= none; };
  // Cell i of the grid is row i * ratio here; the edge before it lies half a cell higher.
  const auto edge_of = [&](int j) {
    const int row = curve[static_cast<std::size_t>(j)];
    return row == 0 ? all : row >= grid.height ? none : (2 * row - 1) * ratio;
  };
  fine_.resize(static_cast<std::size_t>(width));
  for (int x = 0; x < width; ++x) {
    const int j = std::min(x / ratio, grid.width - 1), part = x % ratio;
    const int here = edge_of(j), next = edge_of(std::min(j + 1, grid.width - 1));
    int& edge = fine_[static_cast<std::size_t>(x)];
    if (is_open(here) || is_open(next)) {
      edge = 2 * part < ratio ? here : next;
      continue;
    }
    edge = (here * (ratio - part) + next * part) / ratio;
    if (snap)
      edge = snapped(pyramid, transform, level, x, edge);
  }
  if (snap && width > 2 * median_reach) {
    median_.assign(fine_.begin(), fine_.end());
    for (int x = median_reach; x < width - median_reach; ++x) {
      const int* f = &median_[static_cast<std::size_t>(x - median_reach)];
      fine_[static_cast<std::size_t>(x)] = median5(f[0], f[1], f[2], f[3], f[4]);
    }
  }
  // Doubled row e of this level is row e * 2^level / 2 of the frame, between two columns on their line.
  rows.resize(static_cast<std::size_t>(subsampled(frame_width, mask_level)));
  for (int x = 0; x < static_cast<int>(rows.size()); ++x) {
    const int pixel = x << mask_level, f = std::min(pixel >> level, width - 1), part = pixel - (f << level);
    const int a = fine_[static_cast<std::size_t>(f)],
              b = fine_[static_cast<std::size_t>(std::min(f + 1, width - 1))];
    int row = 0;
    if (a >= none)
      row = frame_height;
    else if (a > all)
      row = ((a << level) + (is_open(b) ? 0 : (b - a) * part) + 1) >> 1;
    rows[static_cast<std::size_t>(x)] = static_cast<std::uint16_t>(std::clamp(row, 0, frame_height));
  }
}

// The strongest edge near `edge` (doubled rows) in one column.
int Refinement::snapped(const Pyramid& pyramid, const ColorTransform& transform, int level, int column,
                        int edge) const {
  const int centre = (edge + 1) / 2; // between rows centre - 1 and centre
  const int first = std::max(centre - reach, 1), last = std::min(centre + reach, pyramid.height(level) - 1);
  std::array<Plane, 3> planes;
  std::array<int, 3> above{};
  for (int c = 0; c < 3; ++c) {
    planes[c] = pyramid.plane(level, c);
    above[c] = planes[c].row(std::max(first - 1, 0))[column];
  }
  int strongest = -1, best = edge;
  for (int row = first; row <= last; ++row) {
    std::array<int, 3> step{};
    for (int c = 0; c < 3; ++c) {
      const int here = planes[c].row(row)[column];
      step[c] = here - above[c];
      above[c] = here;
    }
    int strength = 0;
    for (int c = 0; c < 3; ++c) {
      const auto& m = transform.matrix[c];
      const int difference = (m[0] * step[0] + m[1] * step[1] + m[2] * step[2]) >> 8;
      strength += (c == 0 ? 1 : 2) * std::abs(difference);
    }
    if (strength > strongest) {
      strongest = strength;
      best = 2 * row - 1;
    }
  }
  return best;
}

} // namespace terrainseg
