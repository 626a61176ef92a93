// SPDX-License-Identifier: LGPL-2.1-or-later
// Draws the things that stand in the world, and the shadows that they throw on the ground.
#pragma once

#include <vector>

#include "scene/backdrop.hpp"

namespace terrainseg::scene {

/// Sorts `things` from near to far and draws them.
void draw_things(const Stage& stage, std::vector<Thing>& things, Canvas& canvas);

/// Leaves the shadows of `things` in the canvas for the backdrop.
void draw_shadows(const Stage& stage, const std::vector<Thing>& things, Canvas& canvas);

} // namespace terrainseg::scene
