// SPDX-License-Identifier: LGPL-2.1-or-later
#include <algorithm>

#include "scene/draw.hpp"

namespace terrainseg::scene {
namespace {

/// Colour of a point of a surface; alpha 0 = transparent.
struct Sample {
  Color light;
  float alpha = 1;
};

enum class Face : std::uint8_t { side, end, top };

struct Plane3 {
  Vec3 origin, u, v, normal;
};

class Painter {
 public:
  Painter(const Stage& stage, Canvas& canvas) : s_(stage), canvas_(canvas), camera_(stage.moment.camera) {}

  void thing(const Thing& thing) {
    switch (thing.kind) {
    case Thing::Kind::car:
      return car(thing);
    case Thing::Kind::house:
      return house(thing);
    case Thing::Kind::tree:
      return tree(thing);
    case Thing::Kind::bush:
      return bush(thing);
    case Thing::Kind::rock:
      return rock(thing);
    case Thing::Kind::cabinet:
      return cabinet(thing);
    default:
      return crate(thing);
    }
  }

 private:
  // In a corridor light comes from above and slightly from the rover's side.
  Color lit(const Vec3& normal) const {
    const bool indoors = s_.settings.kind == Kind::corridor;
    const float aside = indoors ? 0.12F * std::abs(normal.z) - 0.1F * std::abs(normal.x) : 0;
    return s_.light.on(normal) + s_.light.ambient * aside;
  }

  /// Draws a flat convex face. `shade(u, v, size)`: u and v in metres along the plane's axes, size = metres
  /// per pixel.
  template <class Shade> void face(std::span<const Vec3> corners, const Plane3& plane, Shade&& shade) {
    const float offset = dot(plane.normal, plane.origin - camera_.position);
    const Outline outline(camera_, corners);
    // Extends the face by half a pixel, so that neighbouring faces leave no gap.
    outline.each_pixel(canvas_, 1, 0, [&](std::size_t pixel, int x, int y, float distance) {
      const Vec3 ray = camera_.ray(static_cast<float>(x), static_cast<float>(y));
      const float toward = dot(plane.normal, ray);
      if (std::abs(toward) < 1e-6F)
        return;
      const float t = offset / toward;
      if (t <= 0)
        return;
      const Vec3 hit = camera_.position + ray * t - plane.origin;
      const Sample sample = shade(dot(hit, plane.u), dot(hit, plane.v), t / camera_.focal);
      const float alpha = sample.alpha * clamp01(distance + 1);
      if (alpha > 0)
        canvas_.under(pixel, s_.hazed(sample.light, t), alpha, not_traversable);
    });
  }

  /// Draws the visible faces of a box. `shade(face, normal, u, v, size)`: u from the middle of the face, v up
  /// from the ground (top face: u across, v along), metres.
  template <class Shade> void box(const Thing& b, Shade&& shade) {
    const Vec3 to_eye = camera_.position - b.base;
    for (const float sign : {-1.0F, 1.0F})
      for (const Face f : {Face::side, Face::end}) {
        const bool is_side = f == Face::side;
        const Vec3 normal = (is_side ? b.side() : b.ahead()) * sign, along = is_side ? b.ahead() : b.side();
        const float away = is_side ? b.half_x : b.half_z, half = is_side ? b.half_z : b.half_x;
        if (dot(to_eye, normal) <= away)
          continue;
        const auto at = [&](float u, float height) {
          return is_side ? b.corner(sign * away, height, u) : b.corner(u, height, sign * away);
        };
        const std::array<Vec3, 4> corners = {at(-half, b.low), at(half, b.low), at(half, b.height),
                                             at(-half, b.height)};
        face(corners, {at(0, 0), along, {0, 1, 0}, normal},
             [&](float u, float v, float size) { return shade(f, normal, is_side ? u : u * sign, v, size); });
      }
    if (camera_.position.y > b.height) {
      face(b.corners(b.height), {b.corner(0, b.height, 0), b.side(), b.ahead(), {0, 1, 0}},
           [&](float u, float v, float size) {
             return shade(Face::top, Vec3{0, 1, 0}, u, v, size);
           });
    }
  }

  void car(const Thing& thing) {
    const Color paint = thing.color, tyre = {0.012F, 0.012F, 0.013F};
    const float waist = 0.58F * thing.height, length = thing.half_z;
    const Color glint = s_.light.haze * 0.3F + s_.light.zenith * 0.1F;
    const bool dusk = s_.settings.light == Light::dusk;
    const Thing body = thing.part(0.03F, waist);
    box(body, [&](Face f, const Vec3& normal, float u, float v, float size) -> Sample {
      Color color = paint;
      if (f == Face::side) {
        // Wheels, and the gap between them.
        const float wheel = std::abs(u) - 0.62F * length,
                    r = std::sqrt(wheel * wheel + (v - 0.31F) * (v - 0.31F));
        const float on_wheel = past_edge(0.31F - r, size), hub = past_edge(0.17F - r, size);
        const float on_body = past_edge(v - 0.22F, size) * past_edge(length - 0.02F - std::abs(u), size);
        const float arch = past_edge(0.37F - r, size);
        color = mix(color * (v > waist * 0.7F ? 1.0F : 0.85F), tyre, arch);
        color = mix(color, mix(tyre, Color{0.2F, 0.2F, 0.21F}, hub), on_wheel);
        const float seam = 0.5F * past_edge(0.012F - std::abs(u - 0.1F), size);
        color = color * (1 - seam);
        return {color * lit(normal) + glint * (0.25F * (v / waist)), std::max(on_body, on_wheel)};
      }
      if (f == Face::end) {
        const float across = std::abs(u) / thing.half_x;
        const float bumper = past_edge(0.14F - std::abs(v - 0.42F), size);
        color = mix(color, mix(color, Color{0.03F, 0.03F, 0.03F}, 0.6F), bumper);
        const float lamp = past_edge(across - 0.66F, size / thing.half_x) *
                           past_edge(0.075F - std::abs(v - waist + 0.14F), size);
        const bool rear = dot(normal, body.ahead()) < 0;
        const float plate =
            past_edge(0.26F - std::abs(u), size) * past_edge(0.055F - std::abs(v - 0.5F), size);
        color = mix(color, Color{0.6F, 0.58F, 0.45F}, plate);
        const float low = past_edge(v - 0.2F, size);
        const float tyres =
            past_edge(across - 0.72F, size / thing.half_x) * past_edge(0.95F - across, size / thing.half_x);
        Color light =
            mix(color * lit(normal) + glint * (0.25F * (v / waist)), Color{}, 0.25F * (1 - v / waist));
        const Color lamp_light = rear ? Color{0.35F, 0.01F, 0.01F} * (dusk ? 2.2F : 1.0F)
                                      : Color{0.6F, 0.6F, 0.55F} * (dusk ? 2.5F : 1.0F);
        light = mix(light, lamp_light, lamp);
        return {mix(mix(Color{0.006F, 0.006F, 0.006F}, tyre * lit(normal), tyres), light, low),
                std::max({low, tyres, 0.85F})};
      }
      return {color * lit(normal) + glint * 0.8F, 1};
    });
    Thing cabin = thing.part(waist, thing.height);
    cabin.half_x *= 0.86F;
    cabin.half_z *= 0.55F;
    cabin.base = body.corner(0, 0, -0.12F * length);
    box(cabin, [&](Face f, const Vec3& normal, float u, float v, float size) -> Sample {
      const float rise = (v - waist) / (thing.height - waist);
      const Color light = paint * lit(normal);
      if (f == Face::top)
        return {light + glint * 0.8F, 1};
      const float half = f == Face::side ? cabin.half_z : cabin.half_x;
      // The cabin is narrower at the roof.
      const float edge = half * (1 - (f == Face::side ? 0.34F : 0.12F) * rise) - std::abs(u);
      const float alpha = past_edge(edge, size);
      float glass = past_edge(edge - 0.07F, size) * past_edge(0.86F - rise, size / 0.6F);
      if (f == Face::side)
        glass *= past_edge(std::abs(u) - 0.04F, size);
      const Color pane = Color{0.012F, 0.014F, 0.016F} + glint * (0.15F + 0.6F * rise);
      return {mix(light, pane, glass), alpha};
    });
  }

  void house(const Thing& thing) {
    const float storey = 2.9F;
    // A gable roof with its ridge along the road; the eaves hide a part of the walls.
    const float eave = 0.4F, rise = 0.7F * thing.half_x;
    const auto at = [&](float x, float y, float z) { return thing.corner(x, y, z); };
    const Color tile = mix(Color{0.22F, 0.09F, 0.06F}, Color{0.1F, 0.1F, 0.11F}, unit(hash(thing.key, 5)));
    const float hx = thing.half_x + eave, hz = thing.half_z + eave, low = thing.height - 0.2F,
                high = thing.height + rise;
    const float slope = std::sqrt(hx * hx + (high - low) * (high - low));
    for (const float sign : {-1.0F, 1.0F}) {
      const std::array<Vec3, 3> gable = {at(-hx + eave, thing.height, sign * thing.half_z),
                                         at(hx - eave, thing.height, sign * thing.half_z),
                                         at(0, high, sign * thing.half_z)};
      const Vec3 end = thing.ahead() * sign;
      if (dot(camera_.position - gable[0], end) > 0)
        face(gable, {gable[0], thing.side(), {0, 1, 0}, end}, [&](float, float, float) -> Sample {
          return {thing.color * lit(end), 1};
        });
    }
    for (const float sign : {-1.0F, 1.0F}) {
      const std::array<Vec3, 4> roof = {at(sign * hx, low, -hz), at(sign * hx, low, hz), at(0, high, hz),
                                        at(0, high, -hz)};
      const Vec3 normal = thing.side() * (sign * (high - low) / slope) + Vec3{0, hx / slope, 0};
      const Vec3 up = thing.side() * (-sign * hx / slope) + Vec3{0, (high - low) / slope, 0};
      if (dot(camera_.position - roof[0], normal) > 0)
        face(roof, {roof[0], thing.ahead(), up, normal}, [&](float u, float v, float size) -> Sample {
          const float row = fraction(v * 3) < 0.2F ? 0.75F : 1.0F;
          return {tile * (mix(1.0F, row, 1 / (1 + 20 * size)) * (1 + 0.2F * s_.noise.at(u * 2, v * 2))) *
                      lit(normal),
                  1};
        });
    }
    const float phase = unit(thing.key) * 20;
    box(thing, [&](Face f, const Vec3& normal, float u, float v, float size) -> Sample {
      const float fine = 1 / (1 + 12 * size);
      const float coarse = 1 / (1 + 3 * size);
      Color color = thing.color * (1 + 0.16F * s_.noise.at(u * 0.7F + phase, v * 0.7F) +
                                   0.16F * coarse * s_.noise.at(u * 3 + phase, v * 3) +
                                   0.4F * fine * s_.noise.at(u * 12 + phase, v * 24));
      if (f == Face::top)
        return {color * lit(normal), 1};
      const float wu = std::abs(fraction((u + phase) * 0.4F) - 0.5F) * 2.5F,
                  wv = fraction(v / storey) * storey;
      const float frame = past_edge(0.6F - wu, size) * past_edge(0.8F - std::abs(wv - 1.7F), size);
      const float glass = past_edge(0.52F - wu, size) * past_edge(0.72F - std::abs(wv - 1.7F), size) *
                          past_edge(std::abs(wu) - 0.025F, size);
      color = mix(color, Color{0.5F, 0.49F, 0.46F}, frame);
      const std::uint32_t pane_key = hash(thing.key, cell_of((u + phase) * 0.4F), cell_of(v / storey));
      const float curtain =
          unit(hash(pane_key, 2)) < 0.6F ? 0.7F * smooth(0.12F, 0.2F, wu - 0.25F * unit(pane_key)) : 0;
      const bool lamp = s_.settings.light == Light::dusk && unit(pane_key) < 0.3F;
      const Color pane =
          lamp ? Color{0.6F, 0.42F, 0.2F}
               : Color{0.012F, 0.014F, 0.018F} +
                     s_.light.haze * (0.02F + 0.2F * unit(pane_key) *
                                                  clamp01(0.5F + s_.noise.at(u * 1.3F + phase, v * 1.3F))) +
                     Color{0.4F, 0.38F, 0.34F} * curtain;
      const float pipe = past_edge(0.06F - std::abs(fraction((u + phase) / 7.5F) - 0.5F) * 7.5F, size);
      color = mix(color, color * 0.35F, pipe);
      const float plinth = past_edge(0.5F - v, size);
      return {mix(mix(color, color * 0.6F, plinth) * lit(normal), pane, glass), 1};
    });
  }

  /// An upright picture that faces the camera. `shade(u, v, size)`: u across, v up, metres.
  template <class Shade> void cutout(const Vec3& base, float half_width, float height, Shade&& shade) {
    const Vec3 toward = {camera_.position.x - base.x, 0, camera_.position.z - base.z};
    const float length = std::sqrt(toward.x * toward.x + toward.z * toward.z);
    if (length < 0.05F)
      return;
    toward_ = toward * (1 / length);
    across_ = {-toward_.z, 0, toward_.x};
    const Vec3 side = across_ * half_width, rise = {0, height, 0};
    const std::array<Vec3, 4> corners = {base - side, base + side, base + side + rise, base - side + rise};
    face(corners, {base, across_, {0, 1, 0}, toward_}, shade);
  }

  // Crowns are bright on the sun's side and dark inside.
  Color foliage(const Thing& thing, float u, float v, float size) const {
    const float shift = thing.shift(), radius = thing.half_x;
    const float fine = clamp01(1.1F - 4 * size), finer = clamp01(0.9F - 12 * size);
    const float clump = s_.noise.at(u * 2.2F / radius + shift, v * 2.2F / radius);
    const float leaves = fine > 0 ? s_.noise.at(u * 6 + shift, v * 6) : 0;
    const float twigs = finer > 0 ? s_.noise.at(u * 24 + shift, v * 24) : 0;
    const float bright = 1 + 0.6F * clump + 1.0F * fine * leaves + 1.2F * finer * twigs;
    const float sunny = 0.5F + 0.5F * (dot(s_.light.sun, Vec3{0, v / radius, 0}) +
                                       0.6F * u / radius * dot(s_.light.sun, across_));
    const Color light =
        s_.light.ambient * 0.55F + s_.light.sun_light * (0.85F * clamp01(sunny) * clamp01(bright - 0.5F));
    return thing.color * light * std::max(bright, 0.12F);
  }

  void tree(const Thing& thing) {
    const float trunk = 0.014F * thing.height, crown_low = 0.2F * thing.height;
    const float ry = 0.5F * (thing.height - crown_low), cy = crown_low + ry, rx = thing.half_x;
    const float shift = thing.shift();
    cutout(thing.base, rx * 1.25F, thing.height * 1.05F, [&](float u, float v, float size) -> Sample {
      const float y = (v - cy) / ry;
      const float wood = v < cy ? past_edge(trunk * (1.2F - v / thing.height) - std::abs(u), size) : 0;
      const float rim = std::max(size * 1.5F, 0.16F);
      // Low frequencies first: most pixels are far from the outline.
      float body = 0.88F - thing.crown_radius(u, y);
      if (body < -0.62F - 0.5F * rim && wood <= 0)
        return {{}, 0};
      body += 0.3F * s_.noise.at(u * 1.4F + shift, v * 1.4F);
      if (body < -0.32F - 0.5F * rim && wood <= 0)
        return {{}, 0};
      if (std::abs(body) < 0.33F + 0.5F * rim) {
        body += 0.2F * s_.noise.at(u * 5 + shift, v * 5);
        if (size < 0.05F)
          body += 0.12F * s_.noise.at(u * 15, v * 15);
      }
      // Gaps through which the sky is visible.
      if (size < 0.05F)
        body -= 0.9F * smooth(0.3F, 0.6F, s_.noise.at(u * 3.3F + shift, v * 3.3F)) * clamp01(0.8F + y);
      const float alpha = past_edge(body, rim);
      if (wood <= 0)
        return {alpha > 0 ? foliage(thing, u, v - cy, size) : Color{}, alpha};
      const Color bark = Color{0.09F, 0.065F, 0.045F} * (1 + 0.5F * s_.noise.at(u * 30 + shift, v * 5)) *
                         s_.light.on({0, 0.4F, 0}, 0.6F);
      if (alpha <= 0)
        return {bark, wood};
      return {mix(bark, foliage(thing, u, v - cy, size), alpha), std::max(alpha, wood)};
    });
  }

  void bush(const Thing& thing) {
    const float rx = thing.half_x, ry = thing.height;
    const float shift = thing.shift();
    cutout(thing.base, rx * 1.3F, ry * 1.3F, [&](float u, float v, float size) -> Sample {
      const float x = u / rx, y = v / ry;
      float body = 0.9F - std::sqrt(x * x + y * y);
      const float rim = std::max(size / rx * 1.5F, 0.12F);
      if (std::abs(body) < 0.43F + 0.5F * rim)
        body += 0.22F * s_.noise.at(u * 3 + shift, v * 3) + 0.2F * s_.noise.at(u * 11 + shift, v * 11);
      const float alpha = past_edge(body, rim);
      if (alpha <= 0)
        return {{}, 0};
      const Color leaves = foliage(thing, u, v - 0.35F * ry, size);
      return {leaves * (0.55F + 0.45F * clamp01(y * 1.6F)), alpha};
    });
  }

  void rock(const Thing& thing) {
    const float rx = thing.half_x, ry = thing.height;
    const float shift = thing.shift();
    const Vec3 base = thing.base - Vec3{0, 0.12F * ry, 0};
    cutout(base, rx * 1.25F, ry * 1.25F, [&](float u, float v, float size) -> Sample {
      const float x = u / rx, y = (v - 0.3F * ry) / (0.75F * ry);
      const float lumps = s_.noise.at(u / rx * 1.1F + shift, v / ry * 1.1F),
                  chips = s_.noise.at(u / rx * 3.5F + shift, v / ry * 3.5F);
      const float r2 = x * x + y * y, body = 1 - std::sqrt(r2) + 0.22F * lumps + 0.1F * chips;
      const float ground = past_edge(v - 0.12F * ry, size);
      const float alpha = past_edge(body * rx, size) * ground;
      if (alpha <= 0)
        return {{}, 0};
      // The side of a rough ellipsoid.
      const float facing = std::sqrt(std::max(1 - r2, 0.05F));
      const float nx = x + 0.8F * lumps, ny = y + 0.9F * chips + 0.5F * lumps;
      const Vec3 normal = across_ * nx + Vec3{0, ny, 0} + toward_ * facing;
      const float length = std::sqrt(dot(normal, normal)) + 1e-3F;
      const float fine = 1 / (1 + 20 * size);
      const Color color =
          thing.color *
          std::max(1 + 0.4F * fine * s_.noise.at((u + 0.4F * v) * 31 + shift, (v - 0.4F * u) * 31) +
                       0.4F * fine * s_.noise.at(u * 11 + shift, v * 11) + 0.35F * chips,
                   0.1F);
      return {color * s_.light.on(normal * (1 / length)) * (0.55F + 0.45F * clamp01(v / (0.6F * ry))), alpha};
    });
  }

  void crate(const Thing& thing) {
    const float phase = unit(thing.key) * 30;
    const bool pole = thing.kind == Thing::Kind::pole;
    box(thing, [&](Face f, const Vec3& normal, float u, float v, float size) -> Sample {
      const float fine = 1 / (1 + 20 * size);
      float shade =
          1 + 0.08F * s_.noise.at(u * 3 + phase, v * 3) + 0.14F * fine * s_.noise.at(u * 30 + phase, v * 30);
      if (f != Face::top && !pole) {
        const float tape = past_edge(0.03F - std::abs(u), size);
        shade *= 1 - 0.18F * tape;
        shade *= 0.8F + 0.2F * clamp01(v * 3);
      }
      return {thing.color * shade * lit(normal), 1};
    });
  }

  void cabinet(const Thing& thing) {
    const float phase = unit(thing.key) * 30;
    box(thing, [&](Face f, const Vec3& normal, float u, float v, float size) -> Sample {
      const float fine = 1 / (1 + 20 * size);
      float shade =
          1 + 0.1F * fine * s_.noise.at(u * 4 + phase, v * 40) + 0.05F * s_.noise.at(u * 2 + phase, v * 2);
      if (f == Face::side) {
        const float drawer = std::abs(fraction(v * 2.6F) - 0.5F) / 2.6F, middle = std::abs(u);
        shade *= 1 - 0.5F * std::max(past_edge(0.008F - drawer, size), past_edge(0.006F - middle, size));
      }
      if (f != Face::top && v < 0.07F)
        shade *= 0.35F; // the recessed plinth
      return {thing.color * shade * lit(normal), 1};
    });
  }

  const Stage& s_;
  Canvas& canvas_;
  const Camera& camera_;
  Vec3 across_{1, 0, 0}, toward_{0, 0, -1};
};

} // namespace

void draw_things(const Stage& stage, std::vector<Thing>& things, Canvas& canvas) {
  const Camera& camera = stage.moment.camera;
  if (!stage.light.clear)
    std::erase_if(things, [&](const Thing& thing) {
      return camera.depth(thing.base) < -(thing.half_x + thing.half_z + thing.height) - 3;
    });
  // Equal distances are ordered by key, so that the order does not depend on the sort algorithm.
  std::sort(things.begin(), things.end(), [&](const Thing& a, const Thing& b) {
    const float da = camera.depth(a.base), db = camera.depth(b.base);
    return da != db ? da < db : a.key < b.key;
  });
  Painter painter(stage, canvas);
  for (const Thing& thing : things)
    painter.thing(thing);
}

} // namespace terrainseg::scene
