// SPDX-License-Identifier: LGPL-2.1-or-later
// KLV units that wait for their frames.
#pragma once

#include <gst/gst.h>

#include <algorithm>
#include <cstdint>
#include <limits>
#include <map>

#include "support/buffer_pool.hpp"

namespace terrainseg {

/// Running time, signed: units may lie before the segment.
using Time = std::int64_t;
inline constexpr Time never = std::numeric_limits<Time>::min();
/// Times beyond, of either sign, are never: 73 years, and no sum of three of them overflows.
inline constexpr Time most_time = std::numeric_limits<Time>::max() / 4;

/// Times lie within most_time, tolerances within 0..most_time. Not locked: the owner does.
class UnitStore {
 public:
  /// `progress`: no unit before this time is still to come. Going back by more than units are ever reordered
  /// means that the sender began anew; then what was kept is dropped. Returns how many units that were.
  std::uint64_t add(Time time, OwnedBuffer unit, Time progress);
  void advance(Time progress) { progress_ = std::max(progress_, progress); }
  /// The nearest unit not further than `tolerance` from `time`, taken out; nullptr = none is there.
  OwnedBuffer take(Time time, Time tolerance);
  /// True when a unit for a frame of this time cannot come any more.
  bool is_past(Time time, Time tolerance) const { return progress_ != never && progress_ > time + tolerance; }
  /// Drops units that no frame from `time` on can match; returns how many.
  std::uint64_t drop_before(Time time);
  std::uint64_t drop_oldest();
  std::size_t size() const { return units_.size(); }
  std::size_t bytes() const { return bytes_; } ///< of all buffers, with what follows a unit in its buffer
  void clear();

 private:
  void count_out(const OwnedBuffer& unit) { bytes_ -= gst_buffer_get_size(unit.get()); }

  std::multimap<Time, OwnedBuffer> units_;
  std::size_t bytes_ = 0;
  Time progress_ = never;
};

} // namespace terrainseg
