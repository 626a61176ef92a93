// SPDX-License-Identifier: LGPL-2.1-or-later
// Draws the background: the ground with its texture, the sky, and the walls of a corridor.
#pragma once

#include "scene/camera.hpp"
#include "scene/canvas.hpp"
#include "scene/world.hpp"

namespace terrainseg::scene {

struct Stage {
  const Settings& settings;
  const Place& place;
  const Path& path;
  const Noise& noise;
  const Lighting& light;
  const Moment& moment;
};

/// Fills the pixels that no object covers. `mirror` has the reflections of objects in water; may be empty.
void draw_backdrop(const Stage& stage, const Canvas& mirror, Canvas& canvas);

} // namespace terrainseg::scene
