// SPDX-License-Identifier: LGPL-2.1-or-later
// What the read-only property `stats` tells.
#pragma once

#include <gst/gst.h>

#include <array>

#include "terrainseg/segmenter.hpp"

namespace terrainseg {

/// Times of the last frames and counts since the start. A plain value: copied under the owner's lock,
/// evaluated outside of it.
class Statistics {
 public:
  static constexpr int remembered = 512; ///< frames that median and percentile look at

  /// Stage times and the whole of the call, in nanoseconds.
  void add(const std::array<std::int64_t, stage_count>& stages, std::int64_t total, const Counters& counters,
           std::uint32_t generation);
  /// Fields: frames, learned, skipped-frozen, skipped-near, skipped-starved (uint64), generation (uint), and
  /// for each stage and `total` NAME-median-us and NAME-p99-us (double, microseconds).
  GstStructure* structure() const;

 private:
  static constexpr int columns = stage_count + 1;
  std::array<std::array<std::int32_t, columns>, remembered> times_{}; ///< nanoseconds, capped at 2 s
  std::uint64_t recorded_ = 0;
  Counters counters_;
  std::uint32_t generation_ = 0;
};

} // namespace terrainseg
