// SPDX-License-Identifier: LGPL-2.1-or-later
// Prints a hash of what the core makes of generated frames, one line a format and setting: two machines agree
// when their outputs are equal.
#include <algorithm>
#include <cinttypes>
#include <cstdio>
#include <cstdlib>

#include "coarse/pyramid.hpp"
#include "terrainseg/segmenter.hpp"

namespace {

using namespace terrainseg;

class Hash {
 public:
  void add(std::uint64_t value) {
    for (int i = 0; i < 8; ++i)
      state_ = (state_ ^ (value >> (8 * i) & 255)) * 0x100000001b3;
  }
  void add(const Plane& plane, int width, int height) {
    for (int y = 0; y < height; ++y)
      for (int x = 0; x < width; ++x)
        state_ = (state_ ^ plane.row(y)[x]) * 0x100000001b3;
  }
  std::uint64_t value() const { return state_; }

 private:
  std::uint64_t state_ = 0xcbf29ce484222325;
};

// Sky, ground that brightens towards the rover, a block on it; grain from a small generator.
struct Scene {
  std::array<std::vector<std::uint8_t>, 3> memory;
  Frame frame;

  Scene(PixelFormat format, int width, int height, int number) {
    frame.format = format;
    frame.width = width;
    frame.height = height;
    frame.pts = std::int64_t{40000000} * number;
    const FormatLayout& layout = layout_of(format);
    for (int p = 0; p < layout.planes; ++p) {
      const int stride = (row_bytes(layout, p, width) + 3) / 4 * 4;
      memory[p].resize(static_cast<std::size_t>(stride) * plane_rows(layout, p, height));
      frame.planes[p] = {memory[p].data(), stride};
    }
    std::uint32_t state = 12345U + static_cast<std::uint32_t>(number);
    for (int c = 0; c < layout.component_count; ++c) {
      const ComponentLayout& l = layout.components[c];
      for (int y = 0; y < subsampled(height, l.y_shift); ++y)
        for (int x = 0; x < subsampled(width, l.x_shift); ++x) {
          state = state * 1664525U + 1013904223U;
          const int py = y << l.y_shift, px = x << l.x_shift;
          const bool block =
              py > height / 2 && py < height * 3 / 4 && px > width / 5 + 3 * number && px < width / 3;
          const bool sky = py < height / 3 + px * 8 / width;
          const int base = sky ? 190 - 20 * c : block ? 60 + 40 * c : 100 + 30 * py / height + 9 * c;
          const unsigned value = static_cast<std::uint8_t>(base + static_cast<int>(state >> 29));
          std::uint8_t* at = &memory[l.plane][static_cast<std::size_t>(y * frame.planes[l.plane].stride +
                                                                       l.offset + x * l.step)];
          const unsigned word = value << layout.upper_shift();
          at[0] = static_cast<std::uint8_t>(word);
          if (layout.sample_bytes() == 2)
            at[1] = static_cast<std::uint8_t>(word >> 8);
        }
    }
  }
};

void print_pyramid(PixelFormat format, int width, int height) {
  const Scene scene(format, width, height, 1);
  Pyramid pyramid;
  pyramid.build(scene.frame, {4, 1, 1});
  Hash hash;
  for (int level = 1; level <= 4; ++level)
    for (int c = 0; c < 3; ++c)
      hash.add(pyramid.plane(level, c), pyramid.width(level), pyramid.height(level));
  std::printf("pyramid format %d %dx%d %016" PRIx64 "\n", static_cast<int>(format), width, height,
              hash.value());
}

void print_masks(PixelFormat format, Preset preset, int width, int height, int mask_level, int threads) {
  Settings settings = Settings::of(preset);
  settings.mask_level = mask_level;
  settings.n_threads = threads;
  Segmenter segmenter(settings);
  Hash hash;
  for (int number = 0; number < 4; ++number) {
    const Scene scene(format, width, height, number);
    if (const Status status = segmenter.process(scene.frame); !status.ok()) {
      std::fprintf(stderr, "%s\n", status.message().c_str());
      std::exit(1);
    }
    const Estimate& e = segmenter.estimate();
    hash.add(e.mask.plane, e.mask.width, e.mask.height);
    for (const std::uint16_t row : e.boundary)
      hash.add(row);
    hash.add(static_cast<std::uint64_t>(e.horizon_row));
    hash.add(e.confidence);
    hash.add(static_cast<std::uint64_t>(e.traversable_permille));
  }
  std::printf("masks format %d preset %d %dx%d level %d threads %d %016" PRIx64 "\n",
              static_cast<int>(format), static_cast<int>(preset), width, height, mask_level, threads,
              hash.value());
}

} // namespace

int main() {
  for (int f = 0; f < pixel_format_count; ++f) {
    const auto format = static_cast<PixelFormat>(f);
    print_pyramid(format, 323, 181);
    for (const Preset preset : {Preset::standard, Preset::paper}) {
      print_masks(format, preset, 640, 360, 0, 1);
      print_masks(format, preset, 417, 301, 2, 2);
    }
  }
}
