// SPDX-License-Identifier: LGPL-2.1-or-later
// The loops over points of the ground that are tracked from one picture to another.
//
// All vector variants and the plain one give the same bits: sums are 64-bit integers, so their order does not
// matter.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>

namespace terrainseg::kernels {

/// The lists below have room for a multiple of this number. Elements after their count are read but have no
/// effect.
inline constexpr int points_together = 16;

/// The difference of a point outside the picture.
inline constexpr std::int32_t no_difference = 1 << 24;

/// A picture without padding between its rows.
struct Picture {
  const std::uint8_t* pixels = nullptr;
  int width = 0, height = 0;
  const std::uint8_t* row(int y) const { return pixels + static_cast<std::ptrdiff_t>(y) * width; }
};

struct PointPosition {
  std::int32_t u, v; ///< Q8; far outside for points behind the camera
};

/// Maps points of the later picture into the earlier one. For a point (a, b) with x = (g0 a << 7) + g1 b +
/// x_offset, y = (g3 a << 7) + g4 b + y_offset, w = (across_w a + below_w b + w_offset) >> 16, r = 2^48 / w:
/// u = middle + ((x >> 12) r >> 36) and v = line + ((y >> 12) r >> 36), both Q8. |x >> 12| and |y >> 12| are
/// limited to 2^32, |u| and |v| to `outside`; with w below 2^18 both are -outside. |g| <= 2^30.
struct PointMap {
  std::int64_t g0, g1, g3, g4, x_offset, y_offset, across_w, below_w, w_offset;
  std::int32_t middle, line, outside;

  PointPosition at(std::int64_t a, std::int64_t b) const {
    const std::int64_t w = (across_w * a + below_w * b + w_offset) >> 16; // Q24
    if (w < 1 << 18)
      return {-outside, -outside};
    const std::int64_t reciprocal = (std::int64_t{1} << 48) / w; // Q24
    const auto placed = [&](std::int64_t position, std::int64_t from) {
      constexpr std::int64_t limit = std::int64_t{1} << 32;
      // Q20 from Q32, limited: beyond 2^20 pixels the point is outside.
      const std::int64_t near = std::clamp(position >> 12, -limit, limit);
      return static_cast<std::int32_t>(
          std::clamp<std::int64_t>(from + (near * reciprocal >> 36), -outside, outside));
    };
    return {placed(((g0 * a) << 7) + g1 * b + x_offset, middle),
            placed(((g3 * a) << 7) + g4 * b + y_offset, line)};
  }
};

/// map.at(across[i], below): u and v of each point in turn.
extern void (*const map_row)(const PointMap& map, const std::int32_t* across, std::int32_t below, int count,
                             std::int32_t* positions);

/// The points to compare: lists of `count` numbers.
struct PointLists {
  const std::int32_t *across, *below, *values; ///< values: Q8 of a grey level
  int count;
};

/// differences[i] = the picture at the position of point i, bilinear, Q8, minus values[i]; no_difference
/// where the four pixels around it are not all in the picture. Returns the number of points for which they
/// are.
extern int (*const point_differences)(const Picture& picture, const PointMap& map, const PointLists& points,
                                      std::int32_t* differences);

/// The number of differences with |difference| < limit.
extern int (*const count_below)(const std::int32_t* differences, int count, std::int32_t limit);

/// weights[i] = table[min(|differences[i]| * per_index / 2^16, 64)], table[64] = 0 for no_difference and up
/// to the next multiple of points_together. |differences| <= 2^16, 0 <= per_index <= 2^14.
extern void (*const fit_weights)(const std::int32_t* differences, int count, std::int32_t per_index,
                                 const std::int32_t* table, std::int32_t* weights);

/// Lists of points: derivatives by each unknown, weights, and differences.
struct FitLists {
  const std::int32_t* derivatives; ///< those by unknown k start at k * stride
  std::ptrdiff_t stride;
  const std::int32_t *weights, *differences; ///< weights after `count` are 0
  int count;
};

/// left = the lower triangle of sum w J J' row by row, right = sum w J e; `unknowns` is 6 or 7. |w J| < 2^31.
extern void (*const fit_sums)(const FitLists& lists, int unknowns, std::int64_t* left, std::int64_t* right);

} // namespace terrainseg::kernels
