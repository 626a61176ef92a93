// SPDX-License-Identifier: LGPL-2.1-or-later
// The renderer's arithmetic: only operations whose rounding IEEE 754 defines, so every machine renders the
// same picture. This folder is compiled without contraction to fused multiply-add.
#pragma once

#include <array>
#include <cfloat>
#include <cmath>
#include <cstdint>

namespace terrainseg::scene {

static_assert(FLT_EVAL_METHOD == 0, "the pictures would differ where floats are kept in wider registers");

struct Vec3 {
  float x = 0, y = 0, z = 0; ///< metres: right, up, forward
};
constexpr Vec3 operator+(const Vec3& a, const Vec3& b) {
  return {a.x + b.x, a.y + b.y, a.z + b.z};
}
constexpr Vec3 operator-(const Vec3& a, const Vec3& b) {
  return {a.x - b.x, a.y - b.y, a.z - b.z};
}
constexpr Vec3 operator*(const Vec3& a, float k) {
  return {a.x * k, a.y * k, a.z * k};
}
constexpr float dot(const Vec3& a, const Vec3& b) {
  return a.x * b.x + a.y * b.y + a.z * b.z;
}

/// Linear RGB.
struct Color {
  float r = 0, g = 0, b = 0;
};
constexpr Color operator+(const Color& a, const Color& b) {
  return {a.r + b.r, a.g + b.g, a.b + b.b};
}
constexpr Color operator*(const Color& a, float k) {
  return {a.r * k, a.g * k, a.b * k};
}
constexpr Color operator*(const Color& a, const Color& b) {
  return {a.r * b.r, a.g * b.g, a.b * b.b};
}
constexpr Color mix(const Color& a, const Color& b, float k) {
  return {a.r + (b.r - a.r) * k, a.g + (b.g - a.g) * k, a.b + (b.b - a.b) * k};
}

constexpr float mix(float a, float b, float k) {
  return a + (b - a) * k;
}
constexpr float clamp01(float v) {
  return v < 0 ? 0 : v > 1 ? 1 : v;
}
/// How much of a pixel of `size` lies beyond an edge, if its middle is `offset` beyond it.
constexpr float past_edge(float offset, float size) {
  return clamp01(offset / size + 0.5F);
}
/// 0 below a, 1 above b, a smooth cubic between.
constexpr float smooth(float a, float b, float v) {
  const float k = clamp01((v - a) / (b - a));
  return k * k * (3 - 2 * k);
}
constexpr int floor_of(float v) {
  const int i = static_cast<int>(v);
  return i - (v < static_cast<float>(i));
}
/// The number of a cell of length 1 as a key.
constexpr std::uint32_t cell_of(float v) {
  return static_cast<std::uint32_t>(floor_of(v));
}
constexpr float fraction(float v) {
  return v - static_cast<float>(floor_of(v));
}

/// Mixes bits: neighbouring keys give unrelated numbers.
constexpr std::uint32_t hash(std::uint32_t a) {
  a ^= a >> 16;
  a *= 0x7feb352dU;
  a ^= a >> 15;
  a *= 0x846ca68bU;
  return a ^ (a >> 16);
}
constexpr std::uint32_t hash(std::uint32_t a, std::uint32_t b, std::uint32_t c = 0) {
  return hash(hash(hash(a) + b * 0x9e3779b9U) + c * 0x85ebca6bU);
}
/// 0 <= v < 1.
constexpr float unit(std::uint32_t h) {
  return static_cast<float>(h >> 8) * (1.0F / 16777216.0F);
}

/// A random number generator with a key as seed.
class Dice {
 public:
  explicit constexpr Dice(std::uint32_t key) : key_(key) {}
  constexpr std::uint32_t next() { return hash(key_, ++count_); }
  constexpr float roll() { return unit(next()); }
  constexpr float roll(float low, float high) { return low + (high - low) * roll(); }
  constexpr bool chance(float probability) { return roll() < probability; }

 private:
  std::uint32_t key_, count_ = 0;
};

/// Sine of an angle in turns (1 = 360 degrees), to about 1e-7.
constexpr double sine(double turns) {
  double whole = static_cast<double>(static_cast<std::int64_t>(turns));
  if (whole > turns)
    whole -= 1;
  double t = turns - whole; // 0..1
  t = t > 0.75 ? t - 1 : t > 0.25 ? 0.5 - t : t;
  const double x = t * 6.283185307179586, q = x * x;
  return x * (1 + q * (-1.0 / 6 + q * (1.0 / 120 + q * (-1.0 / 5040 + q * (1.0 / 362880 - q / 39916800)))));
}
constexpr double cosine(double turns) {
  return sine(turns + 0.25);
}

/// Value noise from a table.
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
  std::array<std::int8_t, period * period> table_;
};

} // namespace terrainseg::scene
