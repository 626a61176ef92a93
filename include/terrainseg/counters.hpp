// SPDX-License-Identifier: LGPL-2.1-or-later
// Counters of a Segmenter.
#pragma once

#include <cstdint>

namespace terrainseg {

/// Numbers of frames since the start. A frame that was not learned is counted under its reason.
struct Counters {
  std::uint64_t frames = 0;          ///< processed
  std::uint64_t learned = 0;         ///< learned from
  std::uint64_t skipped_frozen = 0;  ///< Settings::learning was false
  std::uint64_t skipped_near = 0;    ///< Settings::near_clear was false
  std::uint64_t skipped_starved = 0; ///< Estimate::flags had flag_starved
};

} // namespace terrainseg
