// SPDX-License-Identifier: LGPL-2.1-or-later
// Converts linear light to the pixels of a camera: exposure, tone curve, sensor noise, and the frame's
// format.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "scene/canvas.hpp"
#include "scene/world.hpp"
#include "terrainseg/frame.hpp"

namespace terrainseg::scene {

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

} // namespace terrainseg::scene
