// SPDX-License-Identifier: LGPL-2.1-or-later
// What the read-only property `stats` tells of the frames, and GST_DEBUG=terrainseg:5 once a second.
#pragma once

#include <gst/gst.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "exchange/counted.hpp"
#include "terrainseg/estimate.hpp"
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

/// Gathers frames, and sums them up in a line: what is learned, from where, at what cost and why not.
class Summary {
 public:
  static constexpr std::int64_t every = 1'000'000'000; ///< nanoseconds between two lines

  /// `now` is of a steady clock and `took` this frame's cost, both in nanoseconds; `supplied`: training
  /// pixels came with the frame. A line with the first frame and then once a second.
  std::optional<std::string> add(const Estimate& estimate, const Counters& counters, bool supplied,
                                 std::int64_t now, std::int64_t took) {
    ++frames_;
    supplied_ += supplied;
    total_ += took;
    worst_ = std::max(worst_, took);
    if (last_ && now - *last_ < every)
      return std::nullopt;
    std::string line = text(estimate, counters);
    last_ = now;
    before_ = counters;
    frames_ = supplied_ = 0;
    total_ = worst_ = 0;
    return line;
  }

 private:
  std::string text(const Estimate& e, const Counters& now) const {
    std::string line = "learned " + std::to_string(now.learned - before_.learned) + " of " +
                       counted(frames_, "frame") + " from window " + std::to_string(e.window.width) + "x" +
                       std::to_string(e.window.height) + " at " + std::to_string(e.window.x) + "," +
                       std::to_string(e.window.y);
    if (supplied_)
      line += ", training pixels supplied with " + std::to_string(supplied_);
    add_reason(line, "learning off, GAP, CORRUPTED or backwards",
               now.skipped_frozen - before_.skipped_frozen);
    add_reason(line, "near-clear=false", now.skipped_near - before_.skipped_near);
    add_reason(line, "too few usable pixels or something in the window",
               now.skipped_starved - before_.skipped_starved);
    line += "; generation " + std::to_string(e.model_generation) + ", " + models(e);
    line += "; horizon " +
            (e.horizon_row < 0 ? std::string("none") : "row " + std::to_string(e.horizon_row)) +
            ", confidence " + std::to_string(e.confidence) + " of 255, traversable " +
            std::to_string(e.traversable_permille) + " permille" +
            (e.flags & flag_unknown   ? ", nothing is known"
             : e.flags & flag_blocked ? ", blocked"
                                      : "") +
            (e.flags & flag_window_still ? ", the training window is still" : "");
    return line + "; " + std::to_string(total_ / std::max<std::int64_t>(frames_, 1) / 1000) +
           " us a frame, " + std::to_string(worst_ / 1000) + " us at most";
  }
  static void add_reason(std::string& line, const char* reason, std::uint64_t count) {
    if (count > 0)
      line.append(", not ").append(std::to_string(count)).append(" (").append(reason).append(")");
  }
  /// Colour and share of each learned Gaussian, slot by slot.
  static std::string models(const Estimate& e) {
    std::uint64_t mass = 0;
    for (int i = 0; i < e.model_count; ++i)
      mass += e.models[i].mass;
    std::string text = counted(e.model_count, "model");
    for (int i = 0; i < e.model_count && mass > 0; ++i) {
      const ModelSummary& m = e.models[i];
      std::array<char, 40> part{};
      std::snprintf(part.data(), part.size(), " #%02x%02x%02x %d%%", m.rgb[0], m.rgb[1], m.rgb[2],
                    static_cast<int>(m.mass * 100 / mass));
      text += part.data();
    }
    return text;
  }

  std::optional<std::int64_t> last_; ///< when the last line was written
  Counters before_;
  std::int64_t frames_ = 0, supplied_ = 0, total_ = 0, worst_ = 0; ///< since then
};

} // namespace terrainseg
