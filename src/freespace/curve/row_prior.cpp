// SPDX-License-Identifier: LGPL-2.1-or-later
#include "freespace/curve/row_prior.hpp"

#include <algorithm>

#include "base/percentile.hpp"
#include "base/tuning.hpp"

namespace terrainseg {
namespace {

TERRAINSEG_TUNED(int, row_prior, strongest,
                 32); ///< 1 nat at the top and bottom of the picture; 24 and 40 give 0.1 points more error
TERRAINSEG_TUNED(int, row_prior, middle,
                 51); ///< offset of the neutral row below the horizon: Q8 of the height
TERRAINSEG_TUNED(int, row_prior, middle_per_row, 214); ///< slope of the neutral row over the horizon, Q8
TERRAINSEG_TUNED(int, row_prior, first_middle, 128);
/// Largest distance of the prior's horizon below the vanishing row, Q8 of the height. With 24 the error falls
/// from 5.43 to 5.16 % on 16 rendered trails, and from 17.3 to 13.3 % on six in low sun. With 16 these are
/// 5.10 and 13.0 %, but 11.1 % of 15 Hz are unsafe instead of 10.7 %. With 32 they are 5.26 and 14.0 %.
TERRAINSEG_TUNED(int, row_prior, most_below, 24);
TERRAINSEG_TUNED(int, row_prior, upper_end, 14); ///< percent of the columns
/// 8 nats per cell. With 2 nats a ridge of the ground's colour stays ground where there is no edge between
/// them.
TERRAINSEG_TUNED(int, row_prior, denied, 256);

} // namespace

void row_prior(int grid_height, std::uint32_t slow_horizon, bool enabled, int caution, RowPriors& prior) {
  const int neutral =
      slow_horizon == 0 ? first_middle : middle + ((middle_per_row * static_cast<int>(slow_horizon)) >> 8);
  prior.resize(static_cast<std::size_t>(grid_height));
  for (int i = 0; i < grid_height; ++i) {
    const int slope = std::clamp(2 * ((2 * i + 1) * 128 / grid_height - neutral), -128, 128);
    prior[static_cast<std::size_t>(i)] =
        static_cast<std::int16_t>((enabled ? (2 * strongest * slope) >> 8 : 0) - caution);
  }
}

std::uint32_t horizon_of_prior(std::uint32_t slow_horizon, int vanishing_row) {
  return vanishing_row < 0 ? slow_horizon
                           : std::min(slow_horizon, static_cast<std::uint32_t>(vanishing_row + most_below));
}

void deny_rows_before(int first, RowPriors& prior) {
  for (int i = 0; i < std::min(first, static_cast<int>(prior.size())); ++i)
    prior[static_cast<std::size_t>(i)] =
        static_cast<std::int16_t>(prior[static_cast<std::size_t>(i)] - denied);
}

std::uint32_t follow_horizon(std::uint32_t slow_horizon, const GridCurve& boundary, int grid_height,
                             std::vector<std::uint16_t>& scratch) {
  scratch.assign(boundary.begin(), boundary.end());
  const int now = std::clamp(256 * percentile(scratch, upper_end) / grid_height, 1, 255);
  if (slow_horizon == 0)
    return static_cast<std::uint32_t>(now);
  const int slow = static_cast<int>(slow_horizon);
  return static_cast<std::uint32_t>(std::max(slow + ((now - slow) >> 2), 1));
}

} // namespace terrainseg
