// SPDX-License-Identifier: LGPL-2.1-or-later
// The content of the world: the kind of place, its light, and its objects.
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
  Color ambient;   ///< light from the sky or the walls
  Color haze;      ///< colour of distant objects
  Color zenith;
  float haze_distance = 500; ///< distance in metres at which half of the light is haze
  float clouds = 0.4F;       ///< cloud cover, 0..1
  float cloud_shade = 0.14F; ///< maximum loss of light by the shadow of a thin cloud
  Color exposure{1, 1, 1};   ///< exposure and white balance
  float sensor_noise = 1.5F; ///< standard deviation in 8-bit steps
  bool clear = false;        ///< outdoors: hard shadows without sunlight
  Vec3 window_sun;           ///< corridor: unit vector towards the sun behind the windows
  Color window_light;        ///< corridor: light on a surface that faces that sun; black = no windows

  Color on(const Vec3& normal, float lit = 1) const {
    const float facing = std::max(dot(normal, sun), 0.0F) * lit;
    return ambient * (0.62F + 0.38F * normal.y) + sun_light * facing;
  }
  /// Share of its light that level ground keeps if the share `lit` of the sun reaches it.
  Color kept_in_shadow(float lit) const {
    const Color full = on({0, 1, 0}), dark = on({0, 1, 0}, lit);
    return {dark.r / full.r, dark.g / full.g, dark.b / full.b};
  }
};

Lighting lighting_of(const Settings& settings, double seconds);

/// The properties of a place that depend only on the seed.
struct Place {
  bool urban = false;      ///< road: parking strips, kerbs, pavement and houses
  float half_width = 3.6F; ///< half width of the road, path or corridor, metres
  float pavement = 0;      ///< outer edge of the pavement, metres from the middle; 0 = none
  Color surface;           ///< colour of the driven terrain
  Color beside;            ///< colour of grass and distant ground
  Color wall;              ///< corridor
  Color dado;              ///< corridor: the wall up to the rail
  Color door;              ///< corridor
  int flooring = 0;        ///< corridor: 0 linoleum, 1 tiles, 2 boards, 3 carpet
  float gloss = 0;         ///< corridor: share of reflected light
  float skyline = 0.08F;   ///< mean height of the skyline, tangent of its elevation
  float clearing = 80;     ///< distance of the skyline, metres
  Color skyline_color;
  float clumps = 1; ///< amplitude of the surface's variation
};

Place place_of(const Settings& settings);

/// A direction on the ground, as a rotation about the vertical axis.
struct Heading {
  float cos = 1, sin = 0;
};

/// An object in an upright box, which is rotated about its vertical axis.
struct Thing {
  enum class Kind : std::uint8_t { car, house, tree, bush, rock, pole, crate, cabinet, bin };
  Kind kind = Kind::rock;
  Vec3 base;           ///< centre of the footprint
  float half_x = 0.5F; ///< metres, before the rotation
  float half_z = 0.5F;
  float height = 1; ///< of the upper end above the ground, metres
  float low = 0;    ///< of the lower end
  Heading heading{};
  Color color;
  std::uint32_t key = 0; ///< seed of its details

  Vec3 side() const { return {heading.cos, 0, -heading.sin}; }
  Vec3 ahead() const { return {heading.sin, 0, heading.cos}; }
  Vec3 corner(float x, float y, float z) const { return base + side() * x + ahead() * z + Vec3{0, y, 0}; }
  /// The corners of the box at a height, moved outwards by `rim` metres.
  std::array<Vec3, 4> corners(float y, float rim = 0) const {
    const float x = half_x + rim, z = half_z + rim;
    return {corner(-x, y, -z), corner(x, y, -z), corner(x, y, z), corner(-x, y, z)};
  }
  /// Where the noise of its surface begins.
  float shift() const { return static_cast<float>(key & 255); }
  bool conifer() const { return (key >> 9 & 3) == 0; }
  /// Distance from the middle of a tree's crown, 1 = its mean edge. `u` across in metres, `y` up from -1
  /// to 1.
  float crown_radius(float u, float y) const {
    const float x = u / (conifer() ? half_x * 0.8F * clamp01(0.5F - 0.5F * y) + 0.02F : half_x);
    return conifer() ? std::max(std::abs(x), std::abs(y)) : std::sqrt(x * x + y * y);
  }
  /// The part between two heights.
  Thing part(float from, float to) const {
    Thing box = *this;
    box.low = from;
    box.height = to;
    return box;
  }
};

/// All that a frame shows.
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

/// The rover's body, mast and head: invisible to its camera, but they cast shadows.
std::vector<Thing> parts_of_the_rover(const Settings& settings, const Moment& moment);

/// Collects the objects that may be visible or cast a visible shadow, in no order. Clears `things` first.
void things_in_sight(const Stage& stage, std::vector<Thing>& things);

} // namespace terrainseg::scene
