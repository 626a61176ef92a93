// SPDX-License-Identifier: LGPL-2.1-or-later
#include "scene/draw.hpp"

#include <algorithm>

namespace terrainseg::scene {
namespace {

constexpr int octave_count = 7;
constexpr std::array<float, octave_count> frequencies = {64,    16,      4,       1,
                                                         0.25F, 0.0625F, 0.03125F}; // cells per metre
constexpr int run_length = 16; // pixels that share one footprint

constexpr float corridor_height = 2.7F;

/// A point of the ground under a pixel.
struct Spot {
  float x, z;                              ///< world
  std::array<float, octave_count> octaves; ///< of the texture: fine ones, coarse ones, thin clouds
};

/// What a pixel shows.
struct Seen {
  Color light; ///< or the reflectance of the ground
  std::uint8_t label;
};

/// Remaining amplitude of each octave in a pixel that averages over its footprint: the mean of k independent
/// cells varies 1/sqrt(k) times as much. Distant ground is grainy because of this remainder, not because of
/// aliasing.
struct Footprint {
  float x = 0, z = 0; ///< metres that a pixel covers
  std::array<float, octave_count> amplitude{};
  /// Octaves that hardly change along the run are computed only at its ends.
  std::array<bool, octave_count> slow{};
  std::array<float, octave_count> first{}, step{};
  float position = 0; ///< pixels from the start of the run
};

/// Share of a pixel that a stripe covers; the pixel is `offset` away from the stripe's middle.
float stripe(float offset, float half_width, float size) {
  return past_edge(half_width - std::abs(offset), size) * std::min(1.0F, 2 * half_width / size);
}

/// Wetness of a point of the ground: damp ground is darker, a puddle reflects.
struct Water {
  float damp = 0, puddle = 0;
};

Water water_at(const Stage& stage, const Spot& spot, const Footprint& foot) {
  // Puddles are longer in the direction of driving. Those much smaller than a pixel are left out.
  const float scale = stage.settings.kind == Kind::corridor ? 3.0F : 1.0F;
  const float level = stage.noise.at(spot.x * 0.4F * scale + 57.1F, spot.z * 0.16F * scale + 23.7F) +
                      0.3F * stage.noise.at(spot.x * 1.6F * scale + 11.9F, spot.z * 0.8F * scale) +
                      0.08F * stage.noise.at(spot.x * 8, spot.z * 4);
  const float seen = clamp01(1.5F - 0.25F * foot.z * scale);
  return {seen * smooth(0.1F, 0.24F, level), seen * smooth(0.24F, 0.26F, level)};
}

/// Reflectance of water (Schlick's approximation). `slope`: cosine of the angle of incidence, 1 = straight
/// down.
float mirrored_share(float slope) {
  const float graze = 1 - slope, g2 = graze * graze;
  return 0.03F + 0.97F * g2 * g2 * graze;
}

/// A measure of the direction around the rover that grows with the angle, -2..2; 0 = forward. Cheaper than
/// atan2().
float bearing(const Vec3& ray) {
  const float a = ray.x / (std::abs(ray.x) + std::abs(ray.z) + 1e-9F);
  return ray.z >= 0 ? a : (a >= 0 ? 2 - a : -2 - a);
}

/// What all kinds of place have: the ground.
class Surroundings {
 public:
  Surroundings(const Stage& stage, const Canvas& mirror, const Canvas& canvas)
      : s_(stage), mirror_(mirror), canvas_(canvas) {}

  /// Values that are the same for a run of pixels that begins at x.
  Footprint measure(int x, int y) const {
    const Camera& c = s_.moment.camera;
    Footprint foot;
    // Derivatives of the point on the ground by the pixel's column and row.
    const Vec3 ray = c.ray(static_cast<float>(x) + 0.5F * (run_length - 1), static_cast<float>(y));
    const float drop = std::max(-ray.y, 1e-3F), t = c.position.y / drop, slope = t / drop;
    const float ax = (c.right.x * t + ray.x * c.right.y * slope) / c.focal,
                bx = (c.down.x * t + ray.x * c.down.y * slope) / c.focal;
    const float az = (c.right.z * t + ray.z * c.right.y * slope) / c.focal,
                bz = (c.down.z * t + ray.z * c.down.y * slope) / c.focal;
    foot.x = std::sqrt(ax * ax + bx * bx);
    foot.z = std::sqrt(az * az + bz * bz);
    for (int k = 0; k < octave_count; ++k) {
      const float cx = frequencies[k] * foot.x, cz = frequencies[k] * foot.z;
      const float a = 1 / std::sqrt((1 + cx * cx) * (1 + cz * cz));
      foot.amplitude[k] = a < 0.03F ? 0 : a;
    }
    const Vec3 left = c.ray(static_cast<float>(x), static_cast<float>(y));
    const Vec3 right = c.ray(static_cast<float>(x + run_length), static_cast<float>(y));
    if (std::max(left.y, right.y) > -1e-3F)
      return foot;
    const Vec3 a = c.on_ground(left), b = c.on_ground(right);
    const float length = std::max(std::abs(a.x - b.x), std::abs(a.z - b.z));
    for (int o = 0; o < octave_count; ++o) {
      foot.slow[o] = foot.amplitude[o] > 0 && length * frequencies[o] < 0.3F;
      if (!foot.slow[o])
        continue;
      foot.first[o] = foot.amplitude[o] * texture(o, a);
      foot.step[o] = (foot.amplitude[o] * texture(o, b) - foot.first[o]) * (1.0F / run_length);
    }
    return foot;
  }

 protected:
  Spot spot_under(const Vec3& ray, const Footprint& foot) const {
    const Vec3 point = s_.moment.camera.on_ground(ray);
    Spot spot{point.x, point.z, {}};
    for (int k = 0; k < octave_count; ++k)
      if (foot.slow[k])
        spot.octaves[k] = foot.first[k] + foot.step[k] * foot.position;
      else if (foot.amplitude[k] > 0)
        spot.octaves[k] = foot.amplitude[k] * texture(k, point);
    return spot;
  }

  /// Reflectance of the ground and its label.
  Seen ground(const Spot& spot, const Footprint& foot) const {
    switch (s_.settings.kind) {
    case Kind::road:
      return road(spot, foot);
    case Kind::trail:
      return trail(spot, foot);
    case Kind::plain:
      return {plain(spot, foot), driven_terrain};
    default:
      return {flooring(spot, foot), driven_terrain};
    }
  }

  const Stage& s_;
  const Canvas& mirror_;
  const Canvas& canvas_;

 private:
  // Octave k of the ground's texture, sheared as far as the world's period allows, so that its grid is not
  // visible.
  float texture(int k, const Vec3& spot) const {
    const float f = frequencies[k];
    if (k <= 3)
      return s_.noise.at((spot.x + 0.5F * spot.z) * f + 31.7F * static_cast<float>(k),
                         (spot.z - 0.5F * spot.x) * f);
    return s_.noise.at(spot.x * f + 31.7F * static_cast<float>(k), spot.z * f);
  }

  Color grass(const Spot& spot) const {
    const auto& [blades, tufts, clumps, patches, meadow, far, clouds] = spot.octaves;
    const float v = 1 + 1.0F * blades + 0.5F * tufts + 0.26F * clumps + 0.2F * patches + 0.18F * meadow;
    const Color dry =
        mix(s_.place.beside, Color{0.21F, 0.18F, 0.1F}, clamp01(0.35F + 0.5F * patches + 0.5F * meadow));
    return dry * std::max(v, 0.15F);
  }

  Seen road(const Spot& spot, const Footprint& foot) const {
    const Place& p = s_.place;
    const auto& [grain, stone, worn, patch, wide, far, clouds] = spot.octaves;
    const float s = spot.x - s_.path.at(spot.z), side = std::abs(s);
    const float rim = p.half_width;
    const float wobble = p.urban ? 0 : 0.12F * patch + 0.06F * worn;
    Color color;
    const float on_road = past_edge(rim + wobble - side, foot.x);
    if (on_road > 0) {
      float v = 1 + 0.34F * grain + 0.15F * stone +
                p.clumps * (0.06F * worn + 0.08F * patch + 0.13F * wide + 0.08F * far);
      // Tyres darken two tracks in each lane, 0.75 m from its middle.
      const float lane = std::abs(side - 1.8F), track = smooth(0.6F, 0.1F, std::abs(lane - 0.78F));
      v *= 1 - 0.1F * track;
      // Resurfaced strips and joints.
      const float repair = s_.noise.at(spot.z * 0.03125F, 9.5F + (s > 0 ? 3.0F : 0.0F));
      v *= repair > 0.35F ? 0.82F : 1;
      v *= 1 - 0.4F * stripe(s - 0.35F - 0.05F * worn, 0.02F, foot.x) * (repair > -0.1F ? 1.0F : 0.0F);
      color = p.surface * v;
      float paint = stripe(side - 3.45F, 0.06F, foot.x);
      const float dash = fraction(spot.z * 0.125F) * 8;
      const float dashed = stripe(dash - 4, 1.5F, std::min(foot.z, 8.0F));
      paint = std::max(paint, stripe(s, 0.06F, foot.x) * dashed);
      const float worn_paint = 0.72F + 0.35F * stone + 0.3F * patch;
      color = mix(color, Color{0.62F, 0.61F, 0.57F}, paint * clamp01(worn_paint));
    }
    std::uint8_t label = on_road < 0.5F ? other_traversable : driven_terrain;
    if (on_road < 1) {
      Color beyond;
      if (p.urban && side < p.pavement) {
        const float v = 1 + 0.2F * grain + 0.1F * stone + 0.1F * patch;
        const float joint = std::max(stripe(fraction(spot.z * 1.25F) - 0.5F, 0.012F, foot.z * 1.25F),
                                     stripe(fraction(s * 1.25F) - 0.5F, 0.012F, foot.x * 1.25F));
        const float tile = s_.noise.at(static_cast<float>(floor_of(spot.z * 1.25F)) * 0.5F,
                                       static_cast<float>(floor_of(s * 1.25F)) * 0.5F + 91);
        beyond =
            Color{0.25F, 0.235F, 0.21F} * (v * (1 - 0.35F * joint) * (1 + 0.1F * tile * foot.amplitude[3]));
        if (side < rim + 0.18F) { // the kerb stone
          beyond = Color{0.36F, 0.35F, 0.32F} * v;
          label = on_road < 0.5F ? not_labelled : driven_terrain;
        }
      } else {
        beyond = grass(spot);
        if (!p.urban && side < rim + 0.5F) // gravel shoulder
          beyond = mix(Color{0.2F, 0.185F, 0.16F} * (1 + 0.4F * stone), beyond,
                       smooth(rim, rim + 0.5F, side + 0.3F * worn));
      }
      color = mix(beyond, color, on_road);
    }
    return {color, label};
  }

  Seen trail(const Spot& spot, const Footprint& foot) const {
    const Place& p = s_.place;
    const auto& [grit, pebble, lumps, patch, wide, far, clouds] = spot.octaves;
    const float s = spot.x - s_.path.at(spot.z);
    const float ragged = 0.3F * patch + 0.16F * lumps + 0.1F * pebble;
    const float inward = p.half_width + ragged - std::abs(s);
    const float on_path = past_edge(inward, foot.x + 0.16F);
    Color color;
    if (on_path > 0) {
      float v = 1 + 0.45F * grit + 0.45F * pebble + p.clumps * (0.34F * lumps + 0.14F * patch + 0.12F * wide);
      const float rut = smooth(0.26F, 0.06F, std::abs(std::abs(s) - 0.55F));
      v *= 1 - 0.13F * rut;
      color = p.surface * v;
      // Leaves and a strip of grass between the ruts.
      const float litter = smooth(0.25F, 0.55F, pebble + 0.6F * lumps + 0.3F * patch + 0.15F);
      color = mix(color, Color{0.24F, 0.13F, 0.045F} * (1 + 0.5F * grit), 0.45F * litter * p.clumps);
      const float middle =
          smooth(0.3F, 0.05F, std::abs(s)) * smooth(0.0F, 0.5F, wide + 0.5F * patch + 0.4F * lumps);
      if (middle > 0)
        color = mix(color, grass(spot), 0.7F * middle);
    }
    if (on_path < 1)
      color = mix(grass(spot), color, on_path);
    return {color, on_path < 0.5F ? other_traversable : driven_terrain};
  }

  Color plain(const Spot& spot, const Footprint& foot) const {
    const Place& p = s_.place;
    const auto& [grit, stone, lumps, patch, wide, far, clouds] = spot.octaves;
    float v = 1 + 0.22F * grit + 0.2F * stone +
              p.clumps * (0.16F * lumps + 0.12F * patch + 0.12F * wide + 0.1F * far);
    // Wind ripples in deep sand.
    const float deep = smooth(-0.1F, 0.4F, wide + 0.4F * far);
    const float phase = fraction((spot.z + 0.35F * spot.x + 0.25F * lumps + 0.6F * patch) * 4);
    const float crest = std::abs(phase - 0.5F) * 4 - 1;
    v += 0.14F * deep * crest * clamp01(1.2F - 6 * foot.z);
    // Pebbles, too small to be obstacles.
    const float pebble = smooth(0.45F, 0.7F, stone + 0.3F * lumps) * foot.amplitude[1];
    const Color dust = mix(p.surface, p.surface * Color{0.8F, 0.9F, 1.05F}, clamp01(0.5F + 0.8F * wide));
    return mix(dust * v, p.surface * (0.6F * (1 + 0.6F * grit)), 0.75F * pebble);
  }

  Color flooring(const Spot& spot, const Footprint& foot) const {
    const Place& p = s_.place;
    const auto& [grain, speck, wear, wide, far, farther, farthest] = spot.octaves;
    switch (p.flooring) {
    case 0: // linoleum, speckled
      return p.surface * (1 + 0.11F * grain + 0.06F * speck + 0.04F * wear + 0.05F * wide);
    case 1: { // tiles of 0.5 m
      const float u = spot.x * 2, v = spot.z * 2;
      const float joint = std::max(stripe(fraction(u) - 0.5F, 0.012F, foot.x * 2),
                                   stripe(fraction(v) - 0.5F, 0.012F, foot.z * 2));
      const float tile = unit(hash(s_.settings.seed, cell_of(u + 0.5F), cell_of(v + 0.5F))) - 0.5F;
      return p.surface *
             ((1 + 0.12F * tile * foot.amplitude[2] + 0.07F * grain + 0.05F * speck + 0.05F * wide) *
              (1 - 0.45F * joint));
    }
    case 2: { // boards of 12 cm along the corridor
      const float u = spot.x * 8;
      const int board = floor_of(u);
      const auto key = static_cast<std::uint32_t>(board);
      const float along = spot.z * 0.5F + unit(hash(key, 3)), end = fraction(along);
      const float tone = unit(hash(key, cell_of(along))) - 0.5F;
      const float fibre =
          s_.noise.at(spot.x * 96, spot.z * 4 + static_cast<float>(board)) * foot.amplitude[0];
      const float gap =
          std::max(stripe(fraction(u) - 0.5F, 0.02F, foot.x * 8), stripe(end - 0.5F, 0.002F, foot.z * 0.5F));
      const float seen = foot.amplitude[1];
      return p.surface *
             ((1 + 0.36F * tone * std::sqrt(seen) + 0.3F * fibre + 0.08F * wide) * (1 - 0.5F * gap));
    }
    default: // carpet
      return p.surface * (1 + 0.5F * grain + 0.2F * speck + 0.07F * wear + 0.07F * wide);
    }
  }
};

/// Where::pixel(ray, footprint, at) computes the pixels that no object covers. `at` is the pixel's index.
template <class Where> void draw_open_pixels(const Stage& stage, const Canvas& mirror, Canvas& canvas) {
  const Where where(stage, mirror, canvas);
  const Camera& c = stage.moment.camera;
  for (int y = 0; y < canvas.height; ++y)
    for (int x0 = 0; x0 < canvas.width; x0 += run_length) {
      const int count = std::min(run_length, canvas.width - x0);
      const float* open = canvas.open.data() + canvas.at(x0, y);
      if (std::all_of(open, open + count, [](float share) { return share < Canvas::hidden; }))
        continue;
      Footprint foot = where.measure(x0, y);
      for (int i = 0; i < count; ++i) {
        if (open[i] < Canvas::hidden)
          continue;
        const std::size_t at = canvas.at(x0 + i, y);
        foot.position = static_cast<float>(i);
        const Seen seen = where.pixel(c.ray(static_cast<float>(x0 + i), static_cast<float>(y)), foot, at);
        canvas.under(at, seen.light, 1, seen.label);
      }
    }
}

class Outdoors : public Surroundings {
 public:
  using Surroundings::Surroundings;

  Seen pixel(const Vec3& ray, const Footprint& foot, std::size_t at) const {
    const Camera& c = s_.moment.camera;
    const float level = std::sqrt(ray.x * ray.x + ray.z * ray.z);
    const float elevation = ray.y / level;
    if (elevation < -c.position.y / 600) {
      const float distance = c.position.y / -ray.y * level;
      if (distance < 0.6F * s_.place.clearing || distance < clearing(ray)) {
        const Spot spot = spot_under(ray, foot);
        auto [surface, label] = ground(spot, foot);
        if (!s_.settings.wet || label != driven_terrain) {
          const float shade = 1 - s_.light.cloud_shade * smooth(0.1F, 0.5F, spot.octaves.back());
          return {s_.hazed(surface * horizontal_light_ * canvas_.shade[at] * shade, distance), label};
        }
        const Water water = water_at(s_, spot, foot);
        surface = mix(surface * (1 - 0.45F * water.damp), s_.place.surface * 0.5F, 0.75F * water.puddle);
        const float share = mirrored_share(-ray.y / std::sqrt(dot(ray, ray))) * water.puddle;
        Color light = s_.hazed(surface * horizontal_light_ * canvas_.shade[at] * (1 - share), distance);
        if (share > 0)
          light = light + mirrored(ray, elevation, at) * share;
        return {light, label};
      }
    }
    return far_away(ray, elevation);
  }

 private:
  Color mirrored(const Vec3& ray, float elevation, std::size_t at) const {
    if (mirror_.open[at] < Canvas::hidden)
      return mirror_.light[at];
    return mirror_.light[at] + far_away({ray.x, -ray.y, ray.z}, -elevation).light * mirror_.open[at];
  }

  // Distance up to which open ground is visible: shorter to the sides than along the path.
  float clearing(const Vec3& ray) const {
    if (s_.settings.kind == Kind::plain)
      return 1e9F;
    const float b = bearing(ray);
    const float open = smooth(0.13F, 0.02F, std::abs(b));
    return s_.place.clearing * (1 + 0.4F * s_.noise.at(b * 40, 3.5F)) * (1 + 5 * open);
  }

  Seen far_away(const Vec3& ray, float elevation) const {
    const Place& p = s_.place;
    if (elevation > 2.3F * p.skyline) // above the highest part of the skyline
      return {sky_at(ray, elevation), sky};
    const float b = bearing(ray), pixel = 1 / s_.moment.camera.focal;
    const float swell = s_.noise.cloudy(b * 9 + 40, 11.5F);
    float top = p.skyline * (1 + 0.75F * swell);
    if (s_.settings.kind != Kind::plain) {
      top += p.skyline * (0.3F * s_.noise.at(b * 90, 1.5F) + 0.16F * s_.noise.at(b * 260, 2.5F));
      const float open = smooth(0.16F, 0.01F, std::abs(b));
      top *= 1 - (s_.settings.kind == Kind::trail ? 0.55F : 0.8F) * open;
    } else {
      top = std::max(top, 0.012F) + 0.006F * s_.noise.at(b * 60, 4.5F);
    }
    const float cover = past_edge(top - elevation, pixel);
    Color light;
    if (cover < 1)
      light = sky_at(ray, elevation);
    if (cover > 0) {
      Color body = p.skyline_color;
      if (s_.settings.kind == Kind::plain) {
        const float ridge = s_.noise.cloudy(b * 70, elevation * 160);
        body = body * std::max(1 + 0.8F * ridge + 0.35F * s_.noise.at(b * 300, elevation * 500), 0.2F);
        body = mix(body * s_.light.on({0, 0.7F, 0}), s_.light.haze * Color{0.82F, 0.9F, 1.05F}, 0.5F);
      } else {
        const float leaves =
            s_.noise.at(b * 420, elevation * 210) * 0.6F + s_.noise.at(b * 110, elevation * 60) * 0.5F;
        const float trunk =
            0.35F * smooth(0.35F, 0.55F, s_.noise.at(b * 330, 8.5F)) * smooth(0.6F, 0.1F, elevation / top);
        const float lit = 0.55F + 0.45F * clamp01(elevation / (top + 1e-4F));
        body = mix(body * std::max(1 + 1.9F * leaves, 0.12F) * lit, Color{0.06F, 0.045F, 0.035F}, trunk);
        body = s_.hazed(body * s_.light.on({0, 0.6F, 0}, 0.8F), p.clearing * 1.4F);
      }
      light = mix(light, body, cover);
    }
    return {light, cover >= 0.5F ? not_traversable : sky};
  }

  Color sky_at(const Vec3& ray, float elevation) const {
    const Lighting& l = s_.light;
    const float up = std::max(elevation, 0.0F);
    Color color = mix(l.haze, l.zenith, 1 - 1 / (1 + 2.6F * up));
    const float length = std::sqrt(dot(ray, ray));
    const float toward = std::max(dot(ray, l.sun) / length, 0.0F);
    const float t2 = toward * toward, t8 = t2 * t2 * t2 * t2, t64 = t8 * t8 * t8 * t8 * t8 * t8 * t8 * t8;
    color = color + l.sun_light * (0.22F * t8 + 0.5F * t64);
    const float k = 1 / (up + 0.12F);
    const auto drift = static_cast<float>(std::min(s_.moment.seconds, 1e5)) * 0.012F;
    const float u = ray.x / (length + 1e-6F) * k * 1.7F, v = ray.z / (length + 1e-6F) * k * 1.7F;
    const float body = s_.noise.cloudy(u + drift, v + 50) * 0.9F + 0.12F * s_.noise.at(u * 9 + drift, v * 9);
    const float cover = smooth(0.45F - l.clouds, 0.95F - l.clouds, body) * smooth(0.0F, 0.1F, up);
    const Color bright = l.haze * 0.45F + l.sun_light * 0.42F + l.ambient * 0.2F;
    const Color cloud = bright * (1 - 0.35F * smooth(0.6F - l.clouds, 1.3F - l.clouds, body));
    return mix(color, cloud, 0.85F * cover);
  }

  const Color horizontal_light_ = s_.light.on({0, 1, 0});
};

/// Straight and endless: floor, ceiling with lamps, and two walls with doors or sunny windows.
class Indoors : public Surroundings {
 public:
  using Surroundings::Surroundings;

  Seen pixel(const Vec3& ray, const Footprint& foot, std::size_t at) const {
    const Camera& c = s_.moment.camera;
    const float half = s_.place.half_width;
    const float to_floor = ray.y < -1e-5F ? c.position.y / -ray.y : 1e9F;
    const float to_ceiling = ray.y > 1e-5F ? (corridor_height - c.position.y) / ray.y : 1e9F;
    const float to_wall =
        std::abs(ray.x) > 1e-5F ? ((ray.x > 0 ? half : -half) - c.position.x) / ray.x : 1e9F;
    // Distance of the pixel's floor point from the nearer wall, in pixels. Floor and wall are both drawn
    // where they meet.
    float on_floor = 0;
    if (to_floor < 1e8F && to_floor <= to_ceiling) {
      const float inside = half - std::abs(c.position.x + to_floor * ray.x);
      on_floor = past_edge(inside, foot.x);
    }
    Color wall_light, floor_light;
    if (on_floor < 1)
      wall_light = s_.hazed(beside(ray, to_wall, to_ceiling, c.position.y), std::min(to_wall, to_ceiling));
    if (on_floor > 0)
      floor_light = floor(ray, to_floor, to_wall, foot, at);
    return {mix(wall_light, floor_light, on_floor), on_floor >= 0.5F ? driven_terrain : not_traversable};
  }

 private:
  // A lamp every 4 m, with a pool of light below it.
  float pool(float z) const {
    const float phase = std::abs(fraction(z * 0.25F) - 0.5F) * 2; // 0 under a lamp
    return 1 - 0.42F * phase * phase * (3 - 2 * phase);
  }

  // Sunlight through the windows, 1.3 m wide in each stretch of 4 m.
  float window(float z, float height, float along, float size) const {
    const float u = std::abs(fraction(z * 0.25F) - 0.5F) * 4;
    return past_edge(0.65F - u, along) * past_edge(0.5F - std::abs(height - 1.5F), size) *
           (1 - past_edge(0.03F - u, along));
  }
  bool has_windows(float ray_x) const { return sunny_ && (ray_x > 0) == (s_.light.window_sun.x > 0); }

  Color sun_on(const Vec3& point, const Vec3& normal, float size) const {
    const Vec3& sun = s_.light.window_sun;
    const float way = ((sun.x > 0 ? s_.place.half_width : -s_.place.half_width) - point.x) / sun.x;
    const float pane = window(point.z + way * sun.z, point.y + way * sun.y, size, size);
    return s_.light.window_light * (pane * std::max(dot(normal, sun), 0.0F));
  }

  Color floor(const Vec3& ray, float t, float to_wall, const Footprint& foot, std::size_t at) const {
    const Camera& c = s_.moment.camera;
    const Spot spot = spot_under(ray, foot);
    const float inside = std::max(s_.place.half_width - std::abs(spot.x), 0.0F);
    const float corner = 1 - 0.35F / (1 + 12 * inside); // light that the wall blocks
    Color surface = ground(spot, foot).light;
    Water water;
    if (s_.settings.wet) {
      water = water_at(s_, spot, foot);
      surface = mix(surface * (1 - 0.3F * water.damp), s_.place.surface * 0.6F, 0.75F * water.puddle);
    }
    Color color = surface * s_.light.on({0, 1, 0}) * canvas_.shade[at] * (pool(spot.z) * corner);
    if (sunny_)
      color = color + surface * sun_on({spot.x, 0, spot.z}, {0, 1, 0}, foot.z);
    if (s_.place.gloss > 0 || water.puddle > 0) {
      // The light that the floor reflects; flatter rays are reflected more.
      const Vec3 mirrored = {ray.x, -ray.y, ray.z};
      const float slope = -ray.y / std::sqrt(dot(ray, ray)), graze = 1 - slope;
      const float gloss = s_.place.gloss * (0.06F + 0.94F * graze * graze * graze);
      const float strength = water.puddle > 0 ? mix(gloss, mirrored_share(slope), water.puddle) : gloss;
      const float rough = 1 + 0.25F * s_.noise.at(spot.x * 16, spot.z * 4) * foot.amplitude[1];
      const float to_ceiling =
          (c.position.y + corridor_height) / -ray.y; // from the mirrored camera below the floor
      const Color seen = beside(mirrored, to_wall, to_ceiling, -c.position.y);
      if (water.puddle > 0)
        color = color + mix(seen, mirror_.light[at] + seen * mirror_.open[at], water.puddle) * strength;
      else
        color = color + seen * (strength * rough);
    }
    return s_.hazed(color, t);
  }

  /// The nearer one of the wall and the ceiling, without haze, from a camera at the height `eye`.
  Color beside(const Vec3& ray, float to_wall, float to_ceiling, float eye) const {
    return to_wall < to_ceiling ? wall(ray, to_wall, eye) : ceiling(ray, to_ceiling);
  }

  Color wall(const Vec3& ray, float t, float eye) const {
    const Place& p = s_.place;
    const Camera& c = s_.moment.camera;
    const float z = c.position.z + t * ray.z, height = eye + t * ray.y;
    const float size = t / c.focal, along = size * (1 + std::abs(ray.z) / (std::abs(ray.x) + 1e-3F));
    const std::uint32_t side = ray.x > 0 ? 1 : 0;
    const float detail = 1 / (1 + 30 * along);
    const float low = past_edge(0.92F - height, size);
    Color color = mix(p.wall, p.dado, low) *
                  (1 + 0.06F * s_.noise.at(z * 2 + 100.0F * static_cast<float>(side), height * 2) +
                   0.1F * detail * s_.noise.at(z * 32, height * 32));
    const float rail =
        past_edge(0.05F - std::abs(height - 0.92F), size); // protects the wall from carts and beds
    color = mix(color, p.wall * 0.55F, 0.8F * rail);
    // A framed door, 0.95 m wide, in most stretches of 4 m. Its position varies.
    const int stretch = floor_of(z * 0.25F);
    const std::uint32_t key = hash(s_.settings.seed, side + 61, static_cast<std::uint32_t>(stretch & 511));
    Color glow; // light of the windows, and of the sun through the opposite ones
    if (has_windows(ray.x)) {
      const float frame = window(z, height, along + 0.12F, size + 0.12F),
                  pane = window(z, height, along, size);
      color = mix(mix(color, p.wall * 0.6F, frame), Color{}, pane);
      glow = Color{1.3F, 1.5F, 1.8F} * pane;
    } else if (unit(key) < 0.6F) {
      const float middle = 1.2F + 1.6F * unit(hash(key, 1));
      const float u = std::abs(z - 4 * static_cast<float>(stretch) - middle);
      const float frame = past_edge(0.55F - u, along) * past_edge(2.12F - height, size);
      const float leaf = past_edge(0.475F - u, along) * past_edge(2.05F - height, size);
      color = mix(color, p.wall * 0.6F, frame);
      const float fibre = 1 + 0.18F * detail * s_.noise.at(z * 48, height * 3);
      Color panel = p.door * fibre;
      const float handle =
          past_edge(0.07F - std::abs(u - 0.36F), along) * past_edge(0.02F - std::abs(height - 1.02F), size);
      panel = mix(panel, Color{0.6F, 0.6F, 0.6F}, handle);
      const float pane = past_edge(0.16F - u, along) * past_edge(0.42F - std::abs(height - 1.45F), size);
      const float behind = 0.25F + 0.6F * clamp01(s_.noise.at(z * 7, height * 5));
      panel = mix(panel, p.wall * behind, pane * (unit(hash(key, 2)) < 0.6F ? 1.0F : 0.0F));
      color = mix(color, panel, leaf);
    } else if (unit(key) < 0.85F) { // a notice board with papers
      const float middle = 1 + 2 * unit(hash(key, 1)), u = z - 4 * static_cast<float>(stretch) - middle;
      const float board =
          past_edge(0.62F - std::abs(u), along) * past_edge(0.42F - std::abs(height - 1.5F), size);
      if (board > 0) {
        const std::uint32_t sheet = hash(key, cell_of((u + 1) * 4), cell_of(height * 3));
        const float writing = detail * s_.noise.at(z * 40, height * 90);
        const float tint = 0.25F * unit(hash(sheet, 3));
        const Color paper = Color{0.65F, 0.63F - 0.6F * tint, 0.6F - 2 * tint} *
                            ((0.6F + 0.4F * unit(sheet)) * (1 + 0.8F * writing));
        color = mix(color, unit(hash(sheet, 5)) < 0.7F ? paper : Color{0.2F, 0.12F, 0.06F}, board);
      }
    }
    const float skirting = past_edge(0.09F - height, size);
    color = mix(color, p.wall * 0.25F, skirting);
    const float corner = 1 - 0.3F / (1 + 8 * std::max(std::min(height, corridor_height - height), 0.0F));
    if (sunny_ && !has_windows(ray.x)) {
      const Vec3 normal = {ray.x > 0 ? -1.0F : 1.0F, 0, 0};
      glow = color * sun_on({-normal.x * p.half_width, height, z}, normal, along);
    }
    const Color lamps = color * s_.light.on({0, 0.35F, 0}, 0.0F) * (pool(z) * corner * 1.25F);
    return sunny_ ? lamps + glow : lamps;
  }

  Color ceiling(const Vec3& ray, float t) const {
    const Camera& c = s_.moment.camera;
    const float x = c.position.x + t * ray.x, z = c.position.z + t * ray.z;
    const float size = t / c.focal;
    const float u = std::abs(fraction(z * 0.25F) - 0.5F) * 4; // metres from the lamp's centre
    const float lamp = past_edge(0.6F - u, size * 3) * past_edge(0.15F - std::abs(x), size);
    const Color panel =
        Color{0.7F, 0.7F, 0.68F} * s_.light.ambient * (0.85F + 0.1F * s_.noise.at(x * 1.5F, z * 1.5F));
    return mix(panel, s_.light.sun_light * 3.2F + s_.light.ambient, lamp);
  }

  const bool sunny_ = s_.light.window_light.g > 0;
};

} // namespace

void draw_backdrop(const Stage& stage, const Canvas& mirror, Canvas& canvas) {
  if (stage.settings.kind == Kind::corridor)
    draw_open_pixels<Indoors>(stage, mirror, canvas);
  else
    draw_open_pixels<Outdoors>(stage, mirror, canvas);
}

} // namespace terrainseg::scene
