// SPDX-License-Identifier: LGPL-2.1-or-later
// Hard shadows of a low sun in a clear sky, computed per pixel.
#pragma once

#include <vector>

#include "scene/backdrop.hpp"

namespace terrainseg::scene {

/// Multiplies the light of the canvas' ground by the shadows of `things` and of the rover. Overlapping
/// shadows are as dark as one.
void cast_hard_shadows(const Stage& stage, const std::vector<Thing>& things, Canvas& canvas);

} // namespace terrainseg::scene
