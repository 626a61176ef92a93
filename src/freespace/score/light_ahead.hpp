// SPDX-License-Identifier: LGPL-2.1-or-later
// The ground straight ahead of the window may lie in another light: sun beyond shade, shade beyond sun.
#pragma once

#include "terrainseg/frame.hpp"
#include "terrainseg/terrain.hpp"

namespace terrainseg {

/// Columns of the grid, the last one left out; none where both are equal.
struct Columns {
  int first = 0, end = 0;
  bool operator==(const Columns&) const = default;
};

/// The columns straight ahead of a window (in cells of the grid), a third of the grid's width at most, around
/// the window's middle.
Columns columns_ahead(const Rectangle& window, int grid_width);

/// A model of normalised colours (color_bins.hpp: chroma does not change with brightness) in the other light:
/// one that is brighter than the middle in the shade, half as bright and bluer, for only the sky lights it; a
/// darker one in the sun, twice as bright and less blue. Luma varies twice as much there.
TerrainModel in_other_light(const TerrainModel& model);

} // namespace terrainseg
