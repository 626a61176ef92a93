// SPDX-License-Identifier: LGPL-2.1-or-later
// What there is: the kind of place, its light, and the things that stand in it.
#pragma once

#include <algorithm>
#include <vector>

#include "scene/arithmetic.hpp"
#include "scene/camera.hpp"
#include "scene/scene.hpp"

namespace terrainseg::scene {

struct Lighting {
  Vec3 sun;        ///< unit vector towards it
  Color sun_light; ///< on a surface that faces the sun
  Color ambient;   ///< from the sky or the walls
  Color haze;      ///< colour of far things
  Color zenith;
  float haze_distance = 500; ///< metres at which half is haze
  float clouds = 0.4F;       ///< cover, 0..1
  float cloud_shade = 0.14F; ///< what the shadow of a thin cloud takes at most
  Color exposure{1, 1, 1};   ///< exposure and white balance
  float sensor_noise = 1.5F; ///< standard deviation in 8-bit steps
  bool clear = false;        ///< outdoors: shadows have hard edges, and no sunlight in them
  Vec3 window_sun;           ///< corridor: unit vector towards the sun behind its windows
  Color window_light;        ///< corridor: on a surface that faces it; black = no windows

  Color on(const Vec3& normal, float lit = 1) const {
    const float facing = std::max(dot(normal, sun), 0.0F) * lit;
    return ambient * (0.62F + 0.38F * normal.y) + sun_light * facing;
  }
  /// What level ground keeps of its light where only the part `lit` of the sun reaches it.
  Color kept_in_shadow(float lit) const {
    const Color full = on({0, 1, 0}), dark = on({0, 1, 0}, lit);
    return {dark.r / full.r, dark.g / full.g, dark.b / full.b};
  }
};

Lighting lighting_of(const Settings& settings, double seconds);

/// What a seed decides once for the whole place.
struct Place {
  bool urban = false;      ///< road: parking strips, kerbs, pavement and houses
  float half_width = 3.6F; ///< of what is driven on: asphalt, path or corridor, metres
  float pavement = 0;      ///< outer edge of the pavement, metres from the middle; 0 = none
  Color surface;           ///< what is driven on
  Color beside;            ///< grass, far ground
  Color wall;              ///< corridor
  Color dado;              ///< corridor: the wall up to the rail
  Color door;              ///< corridor
  int flooring = 0;        ///< corridor: 0 linoleum, 1 tiles, 2 boards, 3 carpet
  float gloss = 0;         ///< corridor: share of mirrored light
  float skyline = 0.08F;   ///< mean height of what closes the view, tangent of its elevation
  float clearing = 80;     ///< metres at which it closes
  Color skyline_color;
  float clumps = 1; ///< how strongly the surface varies
};

Place place_of(const Settings& settings);

struct Thing {
  enum class Kind : std::uint8_t { car, house, tree, bush, rock, pole, crate, cabinet, bin };
  Kind kind = Kind::rock;
  Vec3 base;           ///< middle of the footprint
  float half_x = 0.5F; ///< metres, before turning
  float half_z = 0.5F;
  float height = 1;
  float low = 0; ///< where it begins above the ground
  float cos_yaw = 1, sin_yaw = 0;
  Color color;
  std::uint32_t key = 0; ///< of its own details
};

/// The rover's own body, mast and head: nothing that it sees, but they throw shadows.
void parts_of_the_rover(const Settings& settings, const Moment& moment, std::vector<Thing>& parts);

/// Things that may be in sight or throw a shadow that is, in no order. `things` is cleared first.
void things_in_sight(const Settings& settings, const Place& place, const Path& path, const Moment& moment,
                     std::vector<Thing>& things);

} // namespace terrainseg::scene
