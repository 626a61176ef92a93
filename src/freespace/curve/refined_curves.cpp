// SPDX-License-Identifier: LGPL-2.1-or-later
#include "freespace/curve/refined_curves.hpp"

#include <algorithm>

#include "freespace/curve/ground.hpp"
#include "freespace/look/view.hpp"

namespace terrainseg {

void RefinedCurves::refine(const View& view, const Ground& ground) {
  refine(view, ground, view.task.settings.mask_level, of_mask_);
}

const FreeSpaceCurves& RefinedCurves::at(const View& view, const Ground& ground, int level) {
  if (level == view.task.settings.mask_level)
    return of_mask_;
  refine(view, ground, level, finer_);
  return finer_;
}

void RefinedCurves::refine(const View& view, const Ground& ground, int level, FreeSpaceCurves& curves) {
  const auto bring = [&](const GridCurve& curve, FrameCurve& rows) {
    refinement_.refine(view.pyramid, view.grid, view.transform, curve, view.task.settings.refine, level,
                       view.task.frame.width, view.task.frame.height, rows);
  };
  bring(ground.boundary, curves.boundary);
  bring(ground.safe, curves.safe);
  for (std::size_t x = 0; x < curves.safe.size(); ++x)
    curves.safe[x] = std::max(curves.safe[x], curves.boundary[x]);
  curves.ground_behind = ground.behind.any;
  for (FrameCurve* rows : {&curves.behind_first, &curves.behind_end})
    rows->reserve(curves.safe.size()); // reserved early, so that the first frame with ground behind an
                                       // obstacle does not allocate
  if (!ground.behind.any)
    return;
  bring(ground.behind.first, curves.behind_first);
  bring(ground.behind.end, curves.behind_end);
  for (std::size_t x = 0; x < curves.safe.size(); ++x)
    curves.behind_end[x] =
        std::min(curves.behind_end[x], static_cast<std::uint16_t>(std::max(curves.boundary[x] - 1, 0)));
}

} // namespace terrainseg
