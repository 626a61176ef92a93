// SPDX-License-Identifier: LGPL-2.1-or-later
// Frames made of integers only, in any format: the same bytes on every machine.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <vector>

#include "terrainseg/frame.hpp"

namespace terrainseg::test {

using Components = std::array<std::uint8_t, 3>;
using Painter = std::function<Components(int x, int y)>;

/// A frame that owns its planes. Subsampled components are those of the pixel at the upper left. Bits below
/// the upper 8 of a sample are noise. Padding holds 0xa5.
class OwnedFrame {
 public:
  OwnedFrame(PixelFormat format, int width, int height, const Painter& paint, int padding = 0);
  OwnedFrame(const OwnedFrame&) = delete;
  OwnedFrame& operator=(const OwnedFrame&) = delete;

  const Frame& frame() const { return frame_; }
  Frame& frame() { return frame_; }

 private:
  void put(const FormatLayout& layout, std::uint8_t* at, std::uint8_t value);

  Frame frame_;
  std::uint32_t noise_ = 1;
  std::array<std::vector<std::uint8_t>, 3> planes_;
};

/// 0..2^bits - 1 from a position: noise that needs no state.
constexpr int noise_at(int x, int y, int z, int bits) {
  std::uint32_t h = static_cast<std::uint32_t>(x) * 0x9e3779b1u ^
                    static_cast<std::uint32_t>(y) * 0x85ebca77u ^ static_cast<std::uint32_t>(z) * 0xc2b2ae3du;
  h = (h ^ (h >> 15)) * 0x2c1b3c6du;
  h = (h ^ (h >> 12)) * 0x297a2d39u;
  return static_cast<int>((h ^ (h >> 15)) >> (32 - bits));
}

/// A drive: sky above 40 % of the height, noisy ground under it, two obstacles that stand on the ground, and
/// a wandering light. The components serve as Y, U, V and as R, G, B alike.
Painter drive(int width, int height, int frame);

/// The same picture, painted once for many frames of that size.
Painter remembered(const Painter& paint, int width, int height);

} // namespace terrainseg::test
