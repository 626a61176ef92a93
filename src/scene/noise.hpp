// SPDX-License-Identifier: LGPL-2.1-or-later
// Value noise from a table, and its attenuation for the size of a pixel.
#pragma once

#include <array>
#include <cstdint>

#include "scene/arithmetic.hpp"

namespace terrainseg::scene {

class Noise {
 public:
  static constexpr int period = 256; ///< period in cells

  explicit Noise(std::uint32_t seed) {
    for (std::uint32_t i = 0; i < table_.size(); ++i)
      table_[i] = static_cast<std::int8_t>(static_cast<int>(hash(seed, i) >> 24) - 128);
  }

  /// Noise in about -1..1 with one cell per unit.
  float at(float u, float v) const {
    const int iu = floor_of(u), iv = floor_of(v);
    const float fu = ease(u - static_cast<float>(iu)), fv = ease(v - static_cast<float>(iv));
    const std::int8_t* top = &table_[static_cast<std::size_t>(iv & (period - 1)) * period];
    const std::int8_t* bottom = &table_[static_cast<std::size_t>((iv + 1) & (period - 1)) * period];
    const int left = iu & (period - 1), right = (iu + 1) & (period - 1);
    const float a = mix(top[left], top[right], fu), b = mix(bottom[left], bottom[right], fu);
    return mix(a, b, fv) * (1.0F / 128);
  }

  /// Sum of three octaves.
  float cloudy(float u, float v) const {
    return at(u, v) * 0.57F + at(u * 2 + 17.3F, v * 2 + 5.1F) * 0.29F +
           at(u * 4 + 71.7F, v * 4 + 33.9F) * 0.14F;
  }

 private:
  static float ease(float f) { return f * f * (3 - 2 * f); }
  static float mix(int a, int b, float k) {
    return scene::mix(static_cast<float>(a), static_cast<float>(b), k);
  }
  static float mix(float a, float b, float k) { return scene::mix(a, b, k); }
  std::array<std::int8_t, period * period> table_;
};

} // namespace terrainseg::scene
