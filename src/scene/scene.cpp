// SPDX-License-Identifier: LGPL-2.1-or-later
#include "scene/scene.hpp"

#include <algorithm>
#include <cmath>

#include "scene/backdrop.hpp"
#include "scene/develop.hpp"
#include "scene/things.hpp"

namespace terrainseg::scene {

struct Renderer::State {
  State(const Settings& s, int width, int height)
      : settings(s), path(s), noise(hash(s.seed, 91)), place(place_of(s)), canvas(width, height),
        mirror(s.wet ? width : 0, s.wet ? height : 0) {}

  Settings settings;
  Path path;
  Noise noise;
  Place place;
  Canvas canvas;
  Canvas mirror; ///< the reflections in still water
  Developer developer;
  std::vector<Thing> things;
};

Renderer::Renderer(const Settings& settings, int width, int height)
    : state_(std::make_unique<State>(settings, width, height)) {}
Renderer::~Renderer() = default;
Renderer::Renderer(Renderer&&) noexcept = default;
Renderer& Renderer::operator=(Renderer&&) noexcept = default;

int Renderer::render(std::uint64_t number, const MutableFrame& frame, const MutablePlane& labels) {
  State& s = *state_;
  const int width = s.canvas.width, height = s.canvas.height;
  const Moment moment = moment_of(s.settings, s.path, number, width, height);
  const Lighting light = lighting_of(s.settings, moment.seconds);
  const Stage stage = {s.settings, s.place, s.path, s.noise, light, moment};
  s.canvas.clear();
  things_in_sight(s.settings, s.place, s.path, moment, s.things);
  if (s.settings.wet) {
    const Moment below = {moment.seconds, moment.camera.mirrored()};
    s.mirror.clear();
    draw_things({s.settings, s.place, s.path, s.noise, light, below}, s.things, s.mirror);
  }
  draw_things(stage, s.things, s.canvas);
  draw_shadows(stage, s.things, s.canvas);
  draw_backdrop(stage, s.mirror, s.canvas);
  const auto key =
      hash(s.settings.seed, static_cast<std::uint32_t>(number), static_cast<std::uint32_t>(number >> 32));
  s.developer.develop(s.canvas, light, key, frame);
  if (labels.data)
    for (int y = 0; y < height; ++y)
      std::copy_n(s.canvas.labels.data() + s.canvas.at(0, y), width, labels.row(y));
  return moment.camera.horizon_row(height);
}

View Renderer::view_of(std::uint64_t number) const {
  const State& s = *state_;
  const Camera camera = moment_of(s.settings, s.path, number, s.canvas.width, s.canvas.height).camera;
  return {camera.position.y,
          camera.focal,
          std::asin(-static_cast<double>(camera.forward.y)),
          std::atan2(-static_cast<double>(camera.right.y), -static_cast<double>(camera.down.y)),
          camera.center_x,
          camera.center_y};
}

void Renderer::render(std::uint64_t number, Picture& picture) {
  picture.horizon_row_ = render(number, picture.mutable_frame(), {picture.labels_.data(), picture.width_});
  picture.frame_number_ = number;
}

Picture::Picture(PixelFormat format, int width, int height, Colorimetry colorimetry)
    : format_(format), width_(width), height_(height), colorimetry_(colorimetry),
      labels_(static_cast<std::size_t>(width) * height) {
  const FormatLayout& layout = layout_of(format);
  for (int p = 0; p < layout.planes; ++p) {
    strides_[p] = row_bytes(layout, p, width);
    planes_[p].resize(static_cast<std::size_t>(strides_[p]) * plane_rows(layout, p, height));
  }
}

Frame Picture::frame() const {
  Frame frame;
  frame.format = format_;
  frame.width = width_;
  frame.height = height_;
  frame.colorimetry = colorimetry_;
  for (int p = 0; p < layout_of(format_).planes; ++p)
    frame.planes[p] = {planes_[p].data(), strides_[p]};
  frame.pts = static_cast<std::int64_t>(frame_number_) * 1'000'000'000 / frames_per_second;
  return frame;
}

MutableFrame Picture::mutable_frame() {
  MutableFrame frame;
  frame.format = format_;
  frame.width = width_;
  frame.height = height_;
  frame.colorimetry = colorimetry_;
  for (int p = 0; p < layout_of(format_).planes; ++p)
    frame.planes[p] = {planes_[p].data(), strides_[p]};
  return frame;
}

} // namespace terrainseg::scene
