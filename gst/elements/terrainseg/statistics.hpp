// SPDX-License-Identifier: LGPL-2.1-or-later
// What the read-only property `stats` tells.
#pragma once

#include <gst/gst.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "terrainseg/segmenter.hpp"

namespace terrainseg {

/// Times of the last frames and counts since the start. A plain value: copied under the owner's lock,
/// evaluated outside of it.
class Statistics {
 public:
  static constexpr int remembered = 512; ///< frames that median and percentile look at

  /// Stage times and the whole of the call, in nanoseconds.
  void add(const std::array<std::int64_t, stage_count>& stages, std::int64_t total, const Counters& counters,
           std::uint32_t generation) {
    auto& row = times_[recorded_++ % remembered];
    std::transform(stages.begin(), stages.end(), row.begin(), capped);
    row.back() = capped(total);
    counters_ = counters;
    generation_ = generation;
  }
  /// Fields: frames, learned, skipped-frozen, skipped-near, skipped-starved (uint64), generation (uint), and
  /// for each stage and `total` NAME-median-us and NAME-p99-us (double, microseconds).
  GstStructure* structure() const {
    GstStructure* stats = gst_structure_new(
        "terrainseg-stats", "frames", G_TYPE_UINT64, counters_.frames, "learned", G_TYPE_UINT64,
        counters_.learned, "skipped-frozen", G_TYPE_UINT64, counters_.skipped_frozen, "skipped-near",
        G_TYPE_UINT64, counters_.skipped_near, "skipped-starved", G_TYPE_UINT64, counters_.skipped_starved,
        "generation", G_TYPE_UINT, generation_, nullptr);
    const auto count = static_cast<int>(std::min<std::uint64_t>(recorded_, remembered));
    std::vector<std::int32_t> values(count);
    for (int column = 0; column < columns; ++column) {
      for (int i = 0; i < count; ++i)
        values[i] = times_[i][column];
      const std::string name = column < stage_count ? name_of(static_cast<Stage>(column)) : "total";
      gst_structure_set(stats, (name + "-median-us").c_str(), G_TYPE_DOUBLE, quantile_us(values, 0.5),
                        (name + "-p99-us").c_str(), G_TYPE_DOUBLE, quantile_us(values, 0.99), nullptr);
    }
    return stats;
  }

 private:
  static std::int32_t capped(std::int64_t nanoseconds) {
    return static_cast<std::int32_t>(
        std::clamp<std::int64_t>(nanoseconds, 0, std::numeric_limits<std::int32_t>::max()));
  }
  /// Nearest-rank quantile in microseconds. Sorts `values` partly.
  static double quantile_us(std::vector<std::int32_t>& values, double fraction) {
    if (values.empty())
      return 0;
    const auto rank = std::lround(fraction * static_cast<double>(values.size() - 1));
    std::nth_element(values.begin(), values.begin() + rank, values.end());
    return values[rank] / 1000.0;
  }

  static constexpr int columns = stage_count + 1;
  std::array<std::array<std::int32_t, columns>, remembered> times_{}; ///< nanoseconds, capped at 2 s
  std::uint64_t recorded_ = 0;
  Counters counters_;
  std::uint32_t generation_ = 0;
};

} // namespace terrainseg
