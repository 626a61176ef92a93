// SPDX-License-Identifier: LGPL-2.1-or-later
#include "freespace/answer/horizon_row.hpp"

#include <algorithm>

#include "base/percentile.hpp"
#include "base/tuning.hpp"
#include "coarse/grid.hpp"
#include "freespace/answer/confidence.hpp"

namespace terrainseg {
namespace {

TERRAINSEG_TUNED(int, horizon_row, horizon_percent, 5);   ///< percent of the columns that are higher and
                                                          ///< count as outliers
TERRAINSEG_TUNED(int, horizon_row, least_confidence, 48); ///< smallest confidence of the mask for a valid
                                                          ///< horizon

} // namespace

HorizonRow horizon_of(const FrameCurve& boundary, int grid_level, int mask_level, int frame_height,
                      std::uint8_t mask_confidence, std::vector<std::uint16_t>& scratch) {
  // The curve is linear between the refinement's columns, so these are sufficient.
  const int step = std::max(1 << refinement_level(grid_level) >> mask_level, 1);
  scratch.clear();
  for (std::size_t x = 0; x < boundary.size(); x += static_cast<std::size_t>(step))
    scratch.push_back(boundary[x]);
  const int row = percentile(scratch, horizon_percent),
            spread = percentile(scratch, 10) - percentile(scratch, 2);
  if (row <= 0 || row >= frame_height || mask_confidence < least_confidence)
    return {};
  return {row, horizon_confidence(mask_confidence, spread, frame_height)};
}

HorizonRow HorizonHold::follow(const HorizonRow& seen, bool continued) {
  if (seen.row >= 0 || !continued)
    return last_ = seen;
  last_.confidence /= 2;
  last_.held = true;
  if (last_.row < 0 || last_.confidence == 0)
    last_ = {};
  return last_;
}

} // namespace terrainseg
