// SPDX-License-Identifier: LGPL-2.1-or-later
#include "scene/hard_shadows.hpp"

#include <algorithm>

#include "scene/box.hpp"

namespace terrainseg::scene {
namespace {

class Caster {
 public:
  Caster(const Stage& stage, Canvas& canvas) : s_(stage), canvas_(canvas), camera_(stage.moment.camera) {
    const Vec3& sun = stage.light.sun;
    along_ = {-sun.x / sun.y, 0, -sun.z / sun.y};
    stretch_ = std::sqrt(along_.x * along_.x + along_.z * along_.z);
    ahead_ = along_ * (1 / stretch_);
    across_ = {ahead_.z, 0, -ahead_.x};
    kept_ = stage.light.kept_in_shadow(0);
  }

  void cast(const Thing& thing) {
    switch (thing.kind) {
    case Thing::Kind::tree:
      return grown(thing, 1.25F, 1.05F);
    case Thing::Kind::bush:
    case Thing::Kind::rock:
      return grown(thing, 1.3F, 1.3F);
    case Thing::Kind::house:
      solid(box_of(thing, thing.low, thing.height));
      return roof(thing);
    case Thing::Kind::car: {
      solid(box_of(thing, 0.2F, 0.58F * thing.height));
      Box cabin = box_of(thing, 0.5F * thing.height, thing.height);
      cabin.base = cabin.corner(0, 0, -0.12F * thing.half_z);
      cabin.half_x *= 0.8F;
      cabin.half_z *= 0.47F;
      return solid(cabin);
    }
    default:
      return solid(box_of(thing, thing.low, thing.height));
    }
  }

 private:
  void solid(const Box& box) {
    std::array<Vec3, 16> corners;
    const int count = cast_hull(box, along_, corners);
    fill({corners.data(), static_cast<std::size_t>(count)});
  }

  void roof(const Thing& thing) {
    const Box walls = box_of(thing, 0, thing.height);
    const float hx = thing.half_x + 0.4F, hz = thing.half_z + 0.4F;
    std::array<Vec3, 6> points;
    for (int i = 0; i < 6; ++i)
      points[i] = cast_of(walls.corner(hx * static_cast<float>(i % 3 - 1),
                                       i % 3 == 1 ? thing.height + 0.7F * thing.half_x : thing.height - 0.2F,
                                       i < 3 ? -hz : hz),
                          along_);
    std::array<Vec3, 16> corners;
    const int count = hull_of(points, corners);
    fill({corners.data(), static_cast<std::size_t>(count)});
  }

  void fill(std::span<const Vec3> corners) {
    const Outline outline(camera_, corners);
    outline.each_pixel(canvas_.width, canvas_.height, 0.5F, 0.5F, [&](int x, int y, float distance) {
      const std::size_t pixel = canvas_.at(x, y);
      if (canvas_.open[pixel] >= Canvas::hidden)
        shade(pixel, clamp01(distance + 0.5F));
    });
  }

  // Objects without flat faces cast the shadow of a picture that faces the sun.
  void grown(const Thing& thing, float wide, float high) {
    const Vec3 side = across_ * (thing.half_x * wide), tip = along_ * (thing.height * high);
    const std::array<Vec3, 4> corners = {thing.base - side, thing.base + side, thing.base + side + tip,
                                         thing.base - side + tip};
    const Outline outline(camera_, corners);
    outline.each_pixel(canvas_.width, canvas_.height, 0.5F, 0.5F, [&](int x, int y, float) {
      const std::size_t pixel = canvas_.at(x, y);
      if (canvas_.open[pixel] < Canvas::hidden)
        return;
      const Vec3 ray = camera_.ray(static_cast<float>(x), static_cast<float>(y));
      if (ray.y >= -1e-4F)
        return;
      const float t = camera_.position.y / -ray.y;
      const Vec3 from = camera_.position + ray * t - thing.base;
      const float u = dot(from, across_), v = dot(from, ahead_) / stretch_;
      // A pixel is t / focal wide; on the ground it is longer by the inverse of the ray's slope.
      const float size = t / camera_.focal,
                  length =
                      size * std::max(t / camera_.position.y * std::abs(dot(ray, ahead_)), 1.0F) / stretch_;
      shade(pixel, past_edge(inside(thing, u, v), std::max(size, 0.5F * length)));
    });
  }

  /// Approximate distance inside the outline, metres; u across, v up from the ground.
  float inside(const Thing& thing, float u, float v) const {
    const auto shift = static_cast<float>(thing.key & 255);
    const float rx = thing.half_x;
    const auto rough = [&](float scale) { return s_.noise.at(u * scale + shift, v * scale); };
    if (thing.kind == Thing::Kind::bush) {
      const float x = u / rx, y = v / thing.height;
      return rx * (0.9F - std::sqrt(x * x + y * y) + 0.22F * rough(3) + 0.2F * rough(11));
    }
    if (thing.kind == Thing::Kind::rock) {
      const float x = u / rx, y = (v - 0.18F * thing.height) / (0.75F * thing.height);
      return rx * (1 - std::sqrt(x * x + y * y) + 0.22F * rough(1.1F / rx) + 0.1F * rough(3.5F / rx));
    }
    const float middle = 0.6F * thing.height, y = (v - middle) / (0.4F * thing.height);
    const float wood = v < middle ? 0.014F * thing.height * (1.2F - v / thing.height) - std::abs(u) : -1;
    const bool conifer = (thing.key >> 9 & 3) == 0;
    const float x = u / (conifer ? rx * 0.8F * clamp01(0.5F - 0.5F * y) + 0.02F : rx);
    const float radius = conifer ? std::max(std::abs(x), std::abs(y)) : std::sqrt(x * x + y * y);
    float crown = 0.88F - radius + 0.3F * rough(1.4F) + 0.2F * rough(5);
    crown -= 0.9F * smooth(0.3F, 0.6F, rough(3.3F)) * clamp01(0.8F + y); // gaps
    return std::max(rx * crown, wood);
  }

  void shade(std::size_t pixel, float covered) {
    const Color left = mix(Color{1, 1, 1}, kept_, covered);
    Color& at = canvas_.shade[pixel];
    at = {std::min(at.r, left.r), std::min(at.g, left.g), std::min(at.b, left.b)};
  }

  const Stage& s_;
  Canvas& canvas_;
  const Camera& camera_;
  Vec3 along_, ahead_, across_; ///< shadow on the ground per metre of height, metres; unit vectors
  float stretch_ = 1;           ///< length of along_
  Color kept_;
};

} // namespace

void cast_hard_shadows(const Stage& stage, const std::vector<Thing>& things, Canvas& canvas) {
  Caster caster(stage, canvas);
  for (const Thing& thing : things)
    caster.cast(thing);
  std::vector<Thing> rover;
  parts_of_the_rover(stage.settings, stage.moment, rover);
  for (const Thing& part : rover)
    caster.cast(part);
}

} // namespace terrainseg::scene
