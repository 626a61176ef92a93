// SPDX-License-Identifier: LGPL-2.1-or-later
// Draws a picture: objects of the world, their shadows on the ground, and the background.
#pragma once

#include <vector>

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

  /// Light that comes from a distance in metres.
  Color hazed(const Color& color, float distance) const {
    const float d = distance / light.haze_distance, far = settings.kind == Kind::corridor ? d * d : d;
    return mix(color, light.haze, far / (1 + far));
  }
};

/// Sorts `things` from near to far and draws them.
void draw_things(const Stage& stage, std::vector<Thing>& things, Canvas& canvas);

/// Multiplies the canvas' shade by the shadows of `things`, for the background.
void draw_shadows(const Stage& stage, const std::vector<Thing>& things, Canvas& canvas);

/// The hard shadows of a low sun in a clear sky, computed per pixel: those of `things` and of the rover.
/// Overlapping shadows are as dark as one.
void cast_hard_shadows(const Stage& stage, const std::vector<Thing>& things, Canvas& canvas);

/// Draws the ground with its texture, the sky, and the walls of a corridor: the pixels that no object covers.
/// `mirror` has the reflections of objects in water; may be empty.
void draw_backdrop(const Stage& stage, const Canvas& mirror, Canvas& canvas);

} // namespace terrainseg::scene
