// SPDX-License-Identifier: LGPL-2.1-or-later
// Draws the objects of the world and their soft shadows on the ground.
#pragma once

#include <vector>

#include "scene/backdrop.hpp"

namespace terrainseg::scene {

/// Sorts `things` from near to far and draws them.
void draw_things(const Stage& stage, std::vector<Thing>& things, Canvas& canvas);

/// Multiplies the canvas' shade by the shadows of `things`, for the background.
void draw_shadows(const Stage& stage, const std::vector<Thing>& things, Canvas& canvas);

} // namespace terrainseg::scene
