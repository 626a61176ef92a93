// SPDX-License-Identifier: LGPL-2.1-or-later
// What GST_DEBUG=terrainseg:5 tells once a second.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstdio>
#include <optional>
#include <string>

#include "exchange/counted.hpp"
#include "terrainseg/estimate.hpp"
#include "terrainseg/segmenter.hpp"

namespace terrainseg {

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
                       counted(frames_, "frame") + " from " + place(e.window);
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
  static std::string place(const Rectangle& r) {
    std::array<char, 80> text{};
    std::snprintf(text.data(), text.size(), "window %dx%d at %d,%d", r.width, r.height, r.x, r.y);
    return text.data();
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
