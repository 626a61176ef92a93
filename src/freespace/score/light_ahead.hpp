// SPDX-License-Identifier: LGPL-2.1-or-later
// Ground straight ahead of the window in another light: sunlit ground beyond shade, or shaded ground beyond
// sun.
#pragma once

#include "terrainseg/frame.hpp"
#include "terrainseg/terrain.hpp"

namespace terrainseg {

/// Columns of the grid, `end` exclusive; none when both are equal.
struct Columns {
  int first = 0, end = 0;
  bool operator==(const Columns&) const = default;
};

/// The columns straight ahead of a window (in cells of the grid), centred on it and at most a third of the
/// grid's width.
Columns columns_ahead(const Rectangle& window, int grid_width);

/// Converts a model of normalised colours to the other light (color_bins.hpp: chroma does not change with
/// brightness). A model brighter than the middle is moved into the shade: half as bright, and bluer, because
/// only the sky lights it. A darker one is moved into the sun: twice as bright and less blue. The variance of
/// luma is doubled.
TerrainModel in_other_light(const TerrainModel& model);

} // namespace terrainseg
