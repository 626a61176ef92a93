// SPDX-License-Identifier: LGPL-2.1-or-later
#include <algorithm>
#include <utility>

#include "scene/draw.hpp"

namespace terrainseg::scene {
namespace {

/// Returns the convex hull of ground points. Reorders the points.
std::vector<Vec3> hull_of(std::span<Vec3> points) {
  std::ranges::sort(points, {}, [](const Vec3& point) { return std::pair(point.x, point.z); });
  const auto turn = [](const Vec3& o, const Vec3& a, const Vec3& b) {
    return (a.x - o.x) * (b.z - o.z) - (a.z - o.z) * (b.x - o.x);
  };
  std::vector<Vec3> corners;
  for (int pass = 0; pass < 2; ++pass) {
    const std::size_t start = corners.size();
    for (const Vec3& point : points) {
      while (corners.size() >= start + 2 && turn(corners.end()[-2], corners.back(), point) <= 0)
        corners.pop_back();
      corners.push_back(point);
    }
    corners.pop_back(); // the next pass begins with the last point
    std::ranges::reverse(points);
  }
  return corners;
}

class Shadows {
 public:
  /// `hard`: the sun is low in a clear sky.
  Shadows(const Stage& stage, Canvas& canvas, bool hard)
      : s_(stage), canvas_(canvas), camera_(stage.moment.camera),
        kept_(stage.light.kept_in_shadow(hard ? 0 : 0.06F)) {
    const Vec3& sun = stage.light.sun;
    const float reach = std::min(1 / sun.y, 14.0F);
    along_ = hard ? Vec3{-sun.x / sun.y, 0, -sun.z / sun.y} : Vec3{-sun.x * reach, 0, -sun.z * reach};
    stretch_ = std::sqrt(along_.x * along_.x + along_.z * along_.z);
    ahead_ = along_ * (1 / stretch_);
    across_ = {ahead_.z, 0, -ahead_.x};
  }

  void soft(const Thing& thing) {
    if (s_.settings.kind == Kind::corridor || s_.light.sun.y <= 0.01F)
      return;
    if (thing.kind == Thing::Kind::tree) {
      const Vec3 middle = thing.base + along_ * (thing.height * 0.62F);
      const float stretch = stretch_ * 0.36F * thing.height + thing.half_x;
      darken(ellipse(middle, along_, stretch, thing.half_x), kept_, 0.35F, true);
      const Vec3 trunk = {0.012F * thing.height, 0, 0}, end = thing.base + along_ * (thing.height * 0.4F);
      const std::array<Vec3, 4> corners = {thing.base - trunk, thing.base + trunk, end + trunk, end - trunk};
      darken(corners, kept_, 0.03F, false);
    } else if (thing.kind == Thing::Kind::bush || thing.kind == Thing::Kind::rock) {
      const float length = stretch_ * 0.5F * thing.height;
      const Vec3 middle = thing.base + along_ * (0.5F * thing.height);
      darken(ellipse(middle, along_, length + 0.6F * thing.half_x, thing.half_x), kept_,
             0.04F * thing.half_x + 0.01F, false);
    } else {
      darken(cast_hull(thing), kept_, 0.05F, false);
    }
  }

  /// The ground under an object gets little light.
  void contact(const Thing& thing) {
    const float rim = thing.kind == Thing::Kind::car ? 0.12F : 0.06F;
    if (thing.kind == Thing::Kind::tree || thing.kind == Thing::Kind::bush ||
        thing.kind == Thing::Kind::rock) {
      const float radius = thing.kind == Thing::Kind::tree ? 0.03F * thing.height : thing.half_x;
      return darken(ellipse(thing.base, {0, 0, 1}, 0.7F * radius + rim, radius + rim), {0.5F, 0.5F, 0.5F},
                    2 * rim, false);
    }
    darken(thing.corners(0, rim), {0.42F, 0.42F, 0.42F}, 2 * rim, false);
  }

  void hard(const Thing& thing) {
    switch (thing.kind) {
    case Thing::Kind::tree:
      return grown(thing, 1.25F, 1.05F);
    case Thing::Kind::bush:
    case Thing::Kind::rock:
      return grown(thing, 1.3F, 1.3F);
    case Thing::Kind::house:
      solid(thing);
      return roof(thing);
    case Thing::Kind::car: {
      solid(thing.part(0.2F, 0.58F * thing.height));
      Thing cabin = thing.part(0.5F * thing.height, thing.height);
      cabin.base = cabin.corner(0, 0, -0.12F * thing.half_z);
      cabin.half_x *= 0.8F;
      cabin.half_z *= 0.47F;
      return solid(cabin);
    }
    default:
      return solid(thing);
    }
  }

 private:
  static std::array<Vec3, 14> ellipse(const Vec3& middle, const Vec3& along, float length, float width) {
    const float norm = std::sqrt(along.x * along.x + along.z * along.z) + 1e-6F;
    const Vec3 a = {along.x / norm, 0, along.z / norm}, b = {a.z, 0, -a.x};
    std::array<Vec3, 14> corners;
    for (std::size_t i = 0; i < corners.size(); ++i) {
      const double turns = static_cast<double>(i) / static_cast<double>(corners.size());
      corners[i] = middle + a * (length * static_cast<float>(cosine(turns))) +
                   b * (width * static_cast<float>(sine(turns)));
    }
    return corners;
  }

  void darken(std::span<const Vec3> corners, const Color& kept, float softness, bool dappled) {
    Vec3 middle;
    for (const Vec3& corner : corners)
      middle = middle + corner * (1.0F / static_cast<float>(corners.size()));
    const float depth = std::max(camera_.depth(middle), 1.0F);
    const float soft = std::max(softness * camera_.focal / depth, 1.0F);
    const Outline outline(camera_, corners);
    outline.each_pixel(
        canvas_, soft * 0.5F, soft * (dappled ? 4.0F : 0.5F),
        [&](std::size_t pixel, int x, int y, float distance) {
          if (canvas_.shade[pixel].g < kept.g * 0.8F)
            return; // already dark from several shadows
          float k = past_edge(distance, soft);
          if (dappled) {
            const Vec3 ray = camera_.ray(static_cast<float>(x), static_cast<float>(y));
            if (ray.y >= -1e-4F)
              return;
            const Vec3 spot = camera_.on_ground(ray);
            const float u = spot.x, v = spot.z;
            const float gaps =
                0.66F * s_.noise.at(u * 2.3F, v * 2.3F) + 0.34F * s_.noise.at(u * 5.1F, v * 5.1F);
            k *= 1 - 0.85F * smooth(0.05F, 0.3F, gaps);
            // The edge of a crown is ragged.
            if (distance < 3 * soft)
              k *= smooth(-0.1F, 0.35F,
                          distance / soft * 0.25F + 0.4F * s_.noise.at(u * 1.7F + 9, v * 1.7F) + 0.1F);
          }
          canvas_.shade[pixel] = canvas_.shade[pixel] * mix(Color{1, 1, 1}, kept, k);
        });
  }

  /// Where light that passes a point meets the ground.
  Vec3 cast(const Vec3& point) const { return Vec3{point.x, 0, point.z} + along_ * point.y; }

  /// The outline of a box's shadow on the ground.
  std::vector<Vec3> cast_hull(const Thing& box) const {
    std::array<Vec3, 8> points;
    for (int i = 0; i < 8; ++i)
      points[i] = cast(box.corner(i & 1 ? box.half_x : -box.half_x, i & 4 ? box.height : box.low,
                                  i & 2 ? box.half_z : -box.half_z));
    return hull_of(points);
  }

  void solid(const Thing& box) { fill(cast_hull(box)); }

  void roof(const Thing& thing) {
    const float hx = thing.half_x + 0.4F, hz = thing.half_z + 0.4F;
    std::array<Vec3, 6> points;
    for (int i = 0; i < 6; ++i)
      points[i] = cast(thing.corner(hx * static_cast<float>(i % 3 - 1),
                                    i % 3 == 1 ? thing.height + 0.7F * thing.half_x : thing.height - 0.2F,
                                    i < 3 ? -hz : hz));
    fill(hull_of(points));
  }

  void fill(std::span<const Vec3> corners) {
    const Outline outline(camera_, corners);
    outline.each_pixel(canvas_, 0.5F, 0.5F, [&](std::size_t pixel, int, int, float distance) {
      shade(pixel, clamp01(distance + 0.5F));
    });
  }

  // Objects without flat faces cast the shadow of a picture that faces the sun.
  void grown(const Thing& thing, float wide, float high) {
    const Vec3 side = across_ * (thing.half_x * wide), tip = along_ * (thing.height * high);
    const std::array<Vec3, 4> corners = {thing.base - side, thing.base + side, thing.base + side + tip,
                                         thing.base - side + tip};
    const Outline outline(camera_, corners);
    outline.each_pixel(canvas_, 0.5F, 0.5F, [&](std::size_t pixel, int x, int y, float) {
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
    const float shift = thing.shift(), rx = thing.half_x;
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
    float crown = 0.88F - thing.crown_radius(u, y) + 0.3F * rough(1.4F) + 0.2F * rough(5);
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
  const Color kept_;
  Vec3 along_, ahead_, across_; ///< shadow on the ground per metre of height, metres; unit vectors
  float stretch_ = 1;           ///< length of along_
};

} // namespace

void cast_hard_shadows(const Stage& stage, const std::vector<Thing>& things, Canvas& canvas) {
  Shadows shadows(stage, canvas, true);
  for (const Thing& thing : things)
    shadows.hard(thing);
  for (const Thing& part : parts_of_the_rover(stage.settings, stage.moment))
    shadows.hard(part);
}

void draw_shadows(const Stage& stage, const std::vector<Thing>& things, Canvas& canvas) {
  if (stage.light.clear)
    cast_hard_shadows(stage, things, canvas);
  Shadows shadows(stage, canvas, false);
  for (const Thing& thing : things) {
    if (stage.moment.camera.depth(thing.base) > (thing.kind == Thing::Kind::tree ? 45.0F : 90.0F))
      continue; // too far to be seen
    if (!stage.light.clear)
      shadows.soft(thing);
    shadows.contact(thing);
  }
}

} // namespace terrainseg::scene
