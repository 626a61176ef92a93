// SPDX-License-Identifier: LGPL-2.1-or-later
// The shadows of a low sun in a clear sky: where a thing stands in the way of the light, to the pixel.
#pragma once

#include <vector>

#include "scene/backdrop.hpp"

namespace terrainseg::scene {

/// Leaves in the canvas what the shadows of `things` and of the rover itself keep of the ground's light.
/// Where several fall on one another it is no darker than in one.
void cast_hard_shadows(const Stage& stage, const std::vector<Thing>& things, Canvas& canvas);

} // namespace terrainseg::scene
