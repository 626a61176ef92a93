// SPDX-License-Identifier: LGPL-2.1-or-later
// What a Segmenter counts.
#pragma once

#include <cstdint>

namespace terrainseg {

/// Counts since the start; why a frame was not learned from.
struct Counters {
  std::uint64_t frames = 0;
  std::uint64_t learned = 0;
  std::uint64_t skipped_frozen = 0;  ///< learning = false
  std::uint64_t skipped_near = 0;    ///< near_clear = false
  std::uint64_t skipped_starved = 0; ///< flag_starved: too few usable window pixels, or a reason as good
};

} // namespace terrainseg
