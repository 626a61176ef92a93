// SPDX-License-Identifier: LGPL-2.1-or-later
// Measures the duration of stages.
#pragma once

#include <array>
#include <chrono>
#include <cstdint>

#include "terrainseg/stage.hpp"

namespace terrainseg {

/// Accumulates nanoseconds per stage. All times start at zero.
class StageClock {
 public:
  explicit StageClock(std::array<std::int64_t, stage_count>& times) : times_(times) { times_.fill(0); }
  /// Adds the time since the last lap to `stage`.
  void lap(Stage stage) {
    const auto now = std::chrono::steady_clock::now();
    times_[static_cast<std::size_t>(stage)] +=
        std::chrono::duration_cast<std::chrono::nanoseconds>(now - last_).count();
    last_ = now;
  }

 private:
  std::array<std::int64_t, stage_count>& times_;
  std::chrono::steady_clock::time_point last_ = std::chrono::steady_clock::now();
};

} // namespace terrainseg
