// SPDX-License-Identifier: LGPL-2.1-or-later
// Estimates for the tests of the ways out: from plausible to everything that a field can hold.
#pragma once

#include <algorithm>
#include <cstdint>
#include <random>
#include <vector>

#include "terrainseg/estimate.hpp"

namespace terrainseg::test {

/// An estimate with the memory that its views show.
struct OwnedEstimate {
  std::vector<std::uint8_t> pixels;
  std::vector<std::uint16_t> rows;
  Estimate estimate;
  OwnedEstimate() = default;
  OwnedEstimate(OwnedEstimate&&) = default; // a moved vector keeps its memory
  OwnedEstimate& operator=(OwnedEstimate&&) = default;

  std::uint8_t pixel(int x, int y) const { return estimate.mask.plane.row(y)[x]; }
};

inline OwnedEstimate blank(int frame_width, int frame_height, int mask_width, int mask_height,
                           int padding = 0) {
  OwnedEstimate o;
  const int stride = mask_width + padding;
  o.pixels.assign(static_cast<std::size_t>(stride) * static_cast<std::size_t>(mask_height), 0);
  o.rows.assign(static_cast<std::size_t>(mask_width), static_cast<std::uint16_t>(frame_height));
  Estimate& e = o.estimate;
  e.frame_width = frame_width;
  e.frame_height = frame_height;
  e.mask = {{o.pixels.data(), stride}, mask_width, mask_height};
  e.mask_region = {0, 0, frame_width, frame_height};
  e.boundary = o.rows;
  return o;
}

inline void fill_numbers(Estimate& e, std::mt19937& random) {
  e.frame = (std::uint64_t{random()} << 32) | random();
  e.horizon_row = random() % 4 == 0 ? -1 : static_cast<int>(random() % static_cast<unsigned>(e.frame_height));
  e.horizon_confidence = static_cast<std::uint8_t>(random());
  e.confidence = static_cast<std::uint8_t>(random());
  e.traversable_permille = static_cast<int>(random() % 1001);
  const int w = 1 + static_cast<int>(random() % static_cast<unsigned>(e.frame_width));
  const int h = 1 + static_cast<int>(random() % static_cast<unsigned>(e.frame_height));
  e.window = {static_cast<int>(random() % static_cast<unsigned>(e.frame_width - w + 1)),
              static_cast<int>(random() % static_cast<unsigned>(e.frame_height - h + 1)), w, h};
  e.model_generation = random();
  e.flags = random() % 64;
  e.model_count = static_cast<int>(random() % (max_models + 1));
  for (int i = 0; i < e.model_count; ++i) {
    ModelSummary& m = e.models[static_cast<std::size_t>(i)];
    for (auto& v : m.mean)
      v = static_cast<std::uint16_t>(random());
    for (auto& v : m.variance)
      v = static_cast<std::uint32_t>(random());
    m.mass = (std::uint64_t{random()} << 32) | random();
    for (auto& v : m.rgb)
      v = static_cast<std::uint8_t>(random());
  }
}

/// Noise: runs of random lengths and any rows. `calm` is the mean length of a run.
inline OwnedEstimate noisy(int frame_width, int frame_height, int mask_width, int mask_height, unsigned calm,
                           std::mt19937& random) {
  OwnedEstimate o = blank(frame_width, frame_height, mask_width, mask_height, static_cast<int>(random() % 4));
  constexpr std::uint8_t values[] = {0, 128, 255};
  std::uint8_t value = values[random() % 3];
  for (int y = 0; y < mask_height; ++y)
    for (int x = 0; x < mask_width; ++x) {
      if (random() % calm == 0)
        value = values[random() % 3];
      o.pixels[static_cast<std::size_t>(y * o.estimate.mask.plane.stride + x)] = value;
    }
  for (auto& row : o.rows)
    row = static_cast<std::uint16_t>(random() % static_cast<unsigned>(frame_height + 1));
  fill_numbers(o.estimate, random);
  return o;
}

/// What a rover sees: sky, a ragged edge of the free space, obstacles, and a doubtful seam along both.
inline OwnedEstimate ground(int frame_width, int frame_height, int mask_level, std::mt19937& random) {
  const int w = subsampled(frame_width, mask_level), h = subsampled(frame_height, mask_level);
  OwnedEstimate o = blank(frame_width, frame_height, w, h);
  std::vector<int> top(static_cast<std::size_t>(w));
  int edge = h * 2 / 5;
  for (int x = 0; x < w; ++x) {
    edge = std::clamp(edge + static_cast<int>(random() % 5) - 2, h / 4, h * 3 / 4);
    top[static_cast<std::size_t>(x)] = edge;
  }
  for (int y = 0; y < h; ++y)
    for (int x = 0; x < w; ++x) {
      const int above = y - top[static_cast<std::size_t>(x)];
      o.pixels[static_cast<std::size_t>(y * w + x)] = above < 0            ? mask_not_traversable
                                                      : above < h / 90 + 1 ? mask_doubtful
                                                                           : mask_traversable;
    }
  for (int i = 0; i < 12; ++i) {
    const int cx = static_cast<int>(random() % static_cast<unsigned>(w)), r = 1 + h / 40;
    const int cy = h / 2 + static_cast<int>(random() % static_cast<unsigned>(h / 2 + 1));
    for (int y = std::max(cy - r, 0); y < std::min(cy + r, h); ++y)
      for (int x = std::max(cx - r, 0); x < std::min(cx + r, w); ++x)
        o.pixels[static_cast<std::size_t>(y * w + x)] = mask_not_traversable;
  }
  fill_numbers(o.estimate, random);
  o.estimate.flags = flag_learned;
  o.estimate.horizon_row = frame_height * 2 / 5;
  std::uint64_t free = 0;
  for (const std::uint8_t p : o.pixels)
    free += p == mask_traversable;
  o.estimate.traversable_permille =
      static_cast<int>(free * 1000 / (static_cast<std::uint64_t>(w) * static_cast<std::uint64_t>(h)));
  for (int x = 0; x < w; ++x)
    o.rows[static_cast<std::size_t>(x)] =
        static_cast<std::uint16_t>(std::min(top[static_cast<std::size_t>(x)] << mask_level, frame_height));
  return o;
}

} // namespace terrainseg::test
