// SPDX-License-Identifier: LGPL-2.1-or-later
// Mean and variance of colours from sums of z and z^2 over the samples (paper, equations (4), (5) and (9)).
// The paper's (3) and (9) also multiply by the histogram, which would count samples repeatedly.
#pragma once

#include <array>
#include <cstdint>

#include "base/fixed.hpp"
#include "coarse/grid.hpp"
#include "terrainseg/terrain.hpp"

namespace terrainseg {

class MomentSums {
 public:
  void add(const Color& color) {
    ++count_;
    for (int c = 0; c < 3; ++c) {
      sum_[c] += color[c];
      squares_[c] += static_cast<std::uint64_t>(color[c]) * color[c];
    }
  }

  std::uint32_t count() const { return count_; }

  /// All values are 0 without samples.
  Gaussian moments() const {
    Gaussian result;
    result.mass = std::uint64_t{count_} << 8;
    for (int c = 0; c < 3 && count_ > 0; ++c) {
      result.mean[c] = static_cast<std::uint16_t>(rounded_quotient(sum_[c] << 8, count_));
      // Relative to the rounded-down mean, so that products fit 64 bits for every frame size.
      const std::uint64_t base = sum_[c] / count_, rest = sum_[c] - base * count_;
      const std::uint64_t around = squares_[c] + base * base * count_ - 2 * base * sum_[c];
      const std::uint64_t offset = (rest << 16) / count_; // Q16, below one unit
      const std::uint64_t power = rounded_quotient(around << 8, count_), lost = (offset * offset) >> 24;
      result.variance[c] = static_cast<std::uint32_t>(power > lost ? power - lost : 0);
    }
    return result;
  }

 private:
  std::uint32_t count_ = 0;
  std::array<std::uint64_t, 3> sum_{}, squares_{};
};

} // namespace terrainseg
