// SPDX-License-Identifier: LGPL-2.1-or-later
// What fills the view behind all things: the ground with its texture, the sky, and a corridor's walls.
#pragma once

#include "scene/camera.hpp"
#include "scene/canvas.hpp"
#include "scene/noise.hpp"
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

/// Fills what is still open. `mirror` holds what water on the ground shows of things, where there is any.
void draw_backdrop(const Stage& stage, const Canvas& mirror, Canvas& canvas);

} // namespace terrainseg::scene
