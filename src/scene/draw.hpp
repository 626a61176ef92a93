// SPDX-License-Identifier: LGPL-2.1-or-later
// Draws a picture: objects of the world, their shadows on the ground, and the background. The picture during
// drawing: linear light and labels; convex polygons with antialiased edges.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "scene/camera.hpp"
#include "scene/world.hpp"

namespace terrainseg::scene {

/// Pixels are drawn from front to back, so hidden ones are never computed: objects, their shadows, then the
/// background.
struct Canvas {
  static constexpr std::uint8_t unset = 254; ///< no label yet
  static constexpr float hidden = 0.015F;    ///< smaller shares of a pixel are not drawn

  int width = 0, height = 0;
  std::vector<Color> light{};
  std::vector<float> open{};  ///< share of each pixel that is not covered yet, 0..1
  std::vector<Color> shade{}; ///< share of the ground's light that shadows leave, 0..1
  std::vector<std::uint8_t> labels{};

  void clear() {
    const std::size_t pixels = at(0, height);
    light.assign(pixels, {});
    open.assign(pixels, 1);
    shade.assign(pixels, {1, 1, 1});
    labels.assign(pixels, unset);
  }
  /// Adds `color` behind the existing content of a pixel.
  void under(std::size_t pixel, const Color& color, float alpha, std::uint8_t label) {
    light[pixel] = light[pixel] + color * (alpha * open[pixel]);
    open[pixel] *= 1 - alpha;
    if (labels[pixel] == unset && open[pixel] <= 0.5F)
      labels[pixel] = label;
  }

  std::size_t at(int x, int y) const { return static_cast<std::size_t>(y) * width + x; }
};

/// The projection of a convex polygon, clipped to the space in front of the camera, as edges in pixels.
class Outline {
 public:
  static constexpr int max_corners = 20;

  Outline(const Camera& camera, std::span<const Vec3> corners) {
    constexpr float nearest = 0.08F; // near plane, metres
    std::array<Vec3, max_corners + 1> ahead;
    int count = 0;
    for (std::size_t i = 0; i < corners.size() && count < max_corners; ++i) {
      const Vec3& a = corners[i];
      const Vec3& b = corners[(i + 1) % corners.size()];
      const float da = camera.depth(a) - nearest, db = camera.depth(b) - nearest;
      if (da >= 0)
        ahead[count++] = a;
      if ((da >= 0) != (db >= 0) && count < max_corners)
        ahead[count++] = a + (b - a) * (da / (da - db));
    }
    if (count < 3)
      return;
    std::array<float, max_corners> xs, ys;
    float area = 0;
    for (int i = 0; i < count; ++i) {
      const Vec3 relative = ahead[i] - camera.position;
      const float depth = dot(relative, camera.forward);
      xs[i] = camera.center_x + camera.focal * dot(relative, camera.right) / depth;
      ys[i] = camera.center_y + camera.focal * dot(relative, camera.down) / depth;
    }
    for (int i = 0; i < count; ++i) {
      const int next = i + 1 < count ? i + 1 : 0;
      area += xs[i] * ys[next] - xs[next] * ys[i];
    }
    if (std::abs(area) < 1e-6F)
      return;
    const float turn = area > 0 ? 1.0F : -1.0F;
    columns_ = std::ranges::minmax(std::span(xs.data(), count));
    rows_ = std::ranges::minmax(std::span(ys.data(), count));
    for (int i = 0; i < count; ++i) {
      const int next = i + 1 < count ? i + 1 : 0;
      const float dx = xs[next] - xs[i], dy = ys[next] - ys[i];
      const float length = std::sqrt(dx * dx + dy * dy);
      if (length < 1e-4F)
        continue;
      const float a = -dy / length * turn, b = dx / length * turn;
      edges_[edge_count_++] = {a, b, -(a * xs[i] + b * ys[i])};
    }
  }

  /// Calls `visit(pixel, x, y, distance)` for the pixels of `canvas` that are not covered yet and whose
  /// distance to the nearest edge, positive inside, exceeds -margin. `deep` is reported for all larger
  /// distances.
  template <class Visit>
  void each_pixel(const Canvas& canvas, float margin, float deep, Visit&& visit) const {
    if (edge_count_ == 0)
      return;
    const int width = canvas.width, height = canvas.height;
    const auto visit_open = [&](int x, int y, float distance) {
      const std::size_t pixel = canvas.at(x, y);
      if (canvas.open[pixel] >= Canvas::hidden)
        visit(pixel, x, y, distance);
    };
    const auto bound = [](float v, int limit) {
      return static_cast<int>(std::clamp(v, -1.0F, static_cast<float>(limit)));
    };
    const int first_row = std::max(bound(rows_.min - margin, height), 0);
    const int last_row = std::min(bound(rows_.max + margin + 1, height), height - 1);
    for (int y = first_row; y <= last_row; ++y) {
      float low = columns_.min - margin, high = columns_.max + margin, deep_low = low, deep_high = high;
      for (int e = 0; e < edge_count_; ++e) {
        const Edge& edge = edges_[e];
        const float rest = edge.b * static_cast<float>(y) + edge.c;
        narrow(edge.a, rest + margin, low, high);
        narrow(edge.a, rest - deep, deep_low, deep_high);
      }
      const int first = std::max(bound(low, width), 0), last = std::min(bound(high + 1, width), width - 1);
      for (int x = first; x <= last; ++x) {
        const auto column = static_cast<float>(x);
        if (column > deep_low && column < deep_high) {
          visit_open(x, y, deep);
          continue;
        }
        float distance = 1e9F;
        for (int e = 0; e < edge_count_; ++e)
          distance =
              std::min(distance, edges_[e].a * column + edges_[e].b * static_cast<float>(y) + edges_[e].c);
        if (distance > -margin)
          visit_open(x, y, distance);
      }
    }
  }

 private:
  struct Edge {
    float a, b, c;
  };

  /// Restricts low..high to a x + rest > 0.
  static void narrow(float a, float rest, float& low, float& high) {
    if (a > 1e-6F)
      low = std::max(low, -rest / a);
    else if (a < -1e-6F)
      high = std::min(high, -rest / a);
    else if (rest <= 0)
      high = low - 1;
  }

  std::array<Edge, max_corners> edges_;
  int edge_count_ = 0;
  std::ranges::minmax_result<float> columns_{}, rows_{};
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
