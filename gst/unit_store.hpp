// SPDX-License-Identifier: LGPL-2.1-or-later
// KLV units that wait for their frames.
#pragma once

#include <gst/gst.h>

#include <algorithm>
#include <cstdint>
#include <limits>
#include <map>

#include "buffer_pool.hpp"

namespace terrainseg {

/// Running time, signed: units may lie before the segment.
using Time = std::int64_t;
inline constexpr Time never = std::numeric_limits<Time>::min();

/// Not locked: the owner does.
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
  void clear();

 private:
  std::multimap<Time, OwnedBuffer> units_;
  Time progress_ = never;
};

} // namespace terrainseg
