// SPDX-License-Identifier: LGPL-2.1-or-later
#include "scene/scene.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "scene/draw.hpp"

namespace terrainseg::scene {
namespace {

// Q16 weights of R, G, B for each component.
struct Conversion {
  std::array<std::array<int, 3>, 3> weights;
  std::array<int, 3> offsets;
};

Conversion conversion_of(const Colorimetry& colorimetry) {
  constexpr double reds[] = {0.299, 0.2126, 0.2627}, blues[] = {0.114, 0.0722, 0.0593};
  const double kr = reds[static_cast<int>(colorimetry.matrix)],
               kb = blues[static_cast<int>(colorimetry.matrix)];
  const double kg = 1 - kr - kb;
  const bool limited = colorimetry.range == ColorRange::limited;
  const double luma = limited ? 219.0 / 255 : 1, chroma = limited ? 224.0 / 255 : 1;
  const double rows[3][3] = {{kr * luma, kg * luma, kb * luma},
                             {-kr * chroma / (2 - 2 * kb), -kg * chroma / (2 - 2 * kb), chroma / 2},
                             {chroma / 2, -kg * chroma / (2 - 2 * kr), -kb * chroma / (2 - 2 * kr)}};
  Conversion conversion;
  for (int c = 0; c < 3; ++c)
    for (int k = 0; k < 3; ++k)
      conversion.weights[c][k] = floor_of(static_cast<float>(rows[c][k] * 65536 + 0.5));
  conversion.offsets = {limited ? 16 : 0, 128, 128};
  return conversion;
}

} // namespace

/// Converts linear light to the pixels of a camera: exposure, tone curve, sensor noise, and the frame's
/// format.
class Developer {
 public:
  Developer();
  /// Writes `canvas` into `frame`. The noise depends only on `key`.
  void develop(const Canvas& canvas, const Lighting& light, std::uint32_t key, const MutableFrame& frame);

 private:
  void expose_row(const Canvas& canvas, int y, const Lighting& light, std::uint32_t key,
                  std::uint8_t* rgb) const;
  static constexpr int tone_steps = 4096;
  std::array<std::uint16_t, tone_steps + 1> tone_; ///< Q6: 64 = one 8-bit step
  std::array<std::int8_t, 4096> grain_;            ///< standard deviation 32
  std::vector<std::uint8_t> rows_;
};

Developer::Developer() {
  // Tone curve of a camera: a square root with a soft shoulder.
  for (int i = 0; i <= tone_steps; ++i) {
    const float v = static_cast<float>(i) / tone_steps * 2; // up to twice white
    const float shoulder = v * (1 + v * 0.16F) / (1 + v * 0.42F);
    const float bright = std::min(std::sqrt(shoulder), 1.0F);
    // Half an S-curve, for the higher contrast of typical cameras.
    const float crisp = mix(bright, bright * bright * (3 - 2 * bright), 0.55F);
    tone_[i] = static_cast<std::uint16_t>(crisp * (255 * 64));
  }
  // The sum of four uniform numbers is nearly normal.
  for (std::uint32_t i = 0; i < grain_.size(); ++i) {
    const std::uint32_t h = hash(i, 0x6e6f6973);
    const int sum = static_cast<int>((h & 255) + (h >> 8 & 255) + (h >> 16 & 255) + (h >> 24)) - 510;
    grain_[i] = static_cast<std::int8_t>(std::clamp(sum * 32 / 148, -127, 127));
  }
}

void Developer::expose_row(const Canvas& canvas, int y, const Lighting& light, std::uint32_t key,
                           std::uint8_t* rgb) const {
  const Color* source = canvas.light.data() + static_cast<std::size_t>(y) * canvas.width;
  const Color gain = light.exposure * (0.5F * tone_steps);
  // grain_ has a standard deviation of 32; multiplied by noise_q it is in Q6 steps.
  const int noise_q = static_cast<int>(light.sensor_noise * 64);
  const std::uint32_t row_key = hash(key, static_cast<std::uint32_t>(y));
  const auto step = [&](float v, std::uint32_t pick) {
    const int index = static_cast<int>(std::min(std::max(v, 0.0F), static_cast<float>(tone_steps)));
    const int value = tone_[index] + ((grain_[pick & 4095] * noise_q) >> 5) + 32;
    return static_cast<std::uint8_t>(std::clamp(value >> 6, 0, 255));
  };
  for (int x = 0; x < canvas.width; ++x) {
    const std::uint32_t h = hash(row_key + static_cast<std::uint32_t>(x) * 0x9e3779b9U);
    rgb[3 * x] = step(source[x].r * gain.r, h);
    rgb[3 * x + 1] = step(source[x].g * gain.g, h >> 10);
    rgb[3 * x + 2] = step(source[x].b * gain.b, h >> 20);
  }
}

void Developer::develop(const Canvas& canvas, const Lighting& light, std::uint32_t key,
                        const MutableFrame& frame) {
  const FormatLayout& layout = layout_of(frame.format);
  const int width = canvas.width, height = canvas.height;
  const int block_height = 1 << layout.components[1].y_shift, x_shift = layout.components[1].x_shift;
  rows_.resize(static_cast<std::size_t>(width) * 6);
  const Conversion conversion = conversion_of(frame.colorimetry);
  const bool narrow = frame.colorimetry.range == ColorRange::limited;
  const auto component = [&](int c, const std::uint8_t* rgb) {
    const auto& w = conversion.weights[c];
    return static_cast<std::uint8_t>(std::clamp(
        ((w[0] * rgb[0] + w[1] * rgb[1] + w[2] * rgb[2] + 32768) >> 16) + conversion.offsets[c], 0, 255));
  };
  // Writes the upper 8 bits of a sample; the lower ones are 0.
  const auto put = [&](std::uint8_t* at, std::uint8_t value) {
    if (layout.sample_bytes() == 1) {
      *at = value;
      return;
    }
    const unsigned word = unsigned{value} << layout.upper_shift();
    at[0] = static_cast<std::uint8_t>(word);
    at[1] = static_cast<std::uint8_t>(word >> 8);
  };
  for (int y = 0; y < height; y += block_height) {
    const int row_count = std::min(block_height, height - y);
    for (int i = 0; i < row_count; ++i) {
      std::uint8_t* rgb = rows_.data() + static_cast<std::size_t>(i) * width * 3;
      expose_row(canvas, y + i, light, key, rgb);
      for (int c = 0; c < layout.component_count; ++c) {
        const ComponentLayout& l = layout.components[c];
        if (l.x_shift)
          continue;
        std::uint8_t* out = frame.planes[l.plane].row(y + i) + l.offset;
        if (layout.rgb) {
          for (int x = 0; x < width; ++x)
            out[x * l.step] =
                narrow ? static_cast<std::uint8_t>(16 + (rgb[3 * x + c] * 219 + 127) / 255) : rgb[3 * x + c];
        } else {
          for (int x = 0; x < width; ++x)
            put(out + x * l.step, component(c, rgb + 3 * x));
        }
      }
      // Bytes that are unused or hold opacity.
      if (layout.rgb && layout.components[0].step == 4) {
        const int used =
            layout.components[0].offset + layout.components[1].offset + layout.components[2].offset;
        std::uint8_t* out = frame.planes[0].row(y + i) + (6 - used);
        for (int x = 0; x < width; ++x)
          out[x * 4] = 255;
      }
    }
    if (x_shift == 0)
      continue;
    for (int c = 1; c < 3; ++c) {
      const ComponentLayout& l = layout.components[c];
      std::uint8_t* out = frame.planes[l.plane].row(y >> l.y_shift) + l.offset;
      const auto& w = conversion.weights[c];
      const int samples = subsampled(width, 1);
      for (int x = 0; x < samples; ++x) {
        // At the right and bottom edge the last pixel replaces the missing one.
        const int next = std::min(2 * x + 1, width - 1);
        int sum = 0;
        for (int k = 0; k < 3; ++k) {
          const std::uint8_t* top = rows_.data() + k;
          const std::uint8_t* bottom = row_count == 2 ? top + static_cast<std::size_t>(width) * 3 : top;
          sum += w[k] * (top[6 * x] + top[3 * next] + bottom[6 * x] + bottom[3 * next]);
        }
        put(out + x * l.step, static_cast<std::uint8_t>(std::clamp(((sum + (1 << 17)) >> 18) + 128, 0, 255)));
      }
    }
  }
}

struct Renderer::State {
  State(const Settings& s, int width, int height)
      : settings(s), path(s), noise(hash(s.seed, 91)),
        place(place_of(s)), canvas{width, height}, mirror{s.wet ? width : 0, s.wet ? height : 0} {}

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

int Renderer::render(std::uint64_t number, const MutableFrame& frame, const MutablePlane& labels) {
  State& s = *state_;
  const int width = s.canvas.width, height = s.canvas.height;
  const Moment moment = moment_of(s.settings, s.path, number, width, height);
  const Lighting light = lighting_of(s.settings, moment.seconds);
  const Stage stage = {s.settings, s.place, s.path, s.noise, light, moment};
  s.canvas.clear();
  things_in_sight(stage, s.things);
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
  picture.horizon_row_ =
      render(number, picture.mutable_frame(), {picture.labels_.data(), picture.frame_.width});
  picture.frame_number_ = number;
}

Picture::Picture(PixelFormat format, int width, int height, Colorimetry colorimetry)
    : frame_{format, width, height, colorimetry, {}}, labels_(static_cast<std::size_t>(width) * height) {
  const FormatLayout& layout = layout_of(format);
  for (int p = 0; p < layout.planes; ++p) {
    frame_.planes[p].stride = row_bytes(layout, p, width);
    planes_[p].resize(static_cast<std::size_t>(frame_.planes[p].stride) * plane_rows(layout, p, height));
  }
}

Frame Picture::frame() const {
  Frame frame = {frame_.format, frame_.width, frame_.height, frame_.colorimetry, {}};
  for (int p = 0; p < 3; ++p)
    frame.planes[p] = {planes_[p].data(), frame_.planes[p].stride};
  frame.pts = static_cast<std::int64_t>(frame_number_) * 1'000'000'000 / frames_per_second;
  return frame;
}

MutableFrame Picture::mutable_frame() {
  MutableFrame frame = frame_;
  for (int p = 0; p < 3; ++p)
    frame.planes[p].data = planes_[p].data();
  return frame;
}

} // namespace terrainseg::scene
