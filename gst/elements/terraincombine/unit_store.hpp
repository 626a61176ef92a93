// SPDX-License-Identifier: LGPL-2.1-or-later
// KLV units that wait for their frames.
#pragma once

#include <gst/gst.h>

#include <algorithm>
#include <cstdint>
#include <limits>
#include <map>
#include <optional>
#include <tuple>

#include "support/buffer_pool.hpp"

namespace terrainseg {

/// Running time, signed: units may lie before the segment.
using Time = std::int64_t;
inline constexpr Time never = std::numeric_limits<Time>::min();
/// Times beyond, of either sign, are never: 73 years, and no sum of three of them overflows.
inline constexpr Time most_time = std::numeric_limits<Time>::max() / 4;

/// Microseconds of the sender's clock, which units carry, and frames with a stamp: their precision time.
using PrecisionTime = std::uint64_t;

/// Whether `time` is before `now` by more than units are ever reordered: the sender has restarted.
bool is_anew(PrecisionTime time, PrecisionTime now);

/// Where a unit stands, and what is known of those that are still to come.
struct UnitPlace {
  Time time;     ///< running time
  Time progress; ///< no unit before this running time is still to come
  PrecisionTime precision = 0, precision_progress = 0;
};

/// Times lie within most_time, tolerances within 0..most_time. Not locked: the owner does.
class UnitStore {
 public:
  /// Adds a unit. When its time is before the last one by more than units are ever reordered, the sender has
  /// restarted: all stored units are dropped. Returns their number. `stamped`: frames are matched by
  /// precision time. Then a restart begins another run, and the units of the previous run stay for frames
  /// that have not arrived yet.
  std::uint64_t add(const UnitPlace& place, OwnedBuffer unit, bool stamped = false);
  /// A gap of the units ends there.
  void advance(Time progress) {
    progress_ = std::max(progress_, progress);
    gaps_ = std::max(gaps_, progress);
  }
  /// The nearest unit not further than `tolerance` from `time`, taken out; nullptr = none is there.
  OwnedBuffer take(Time time, Time tolerance);
  /// The first unit of exactly this precision time in the frames' run, taken out; nullptr = none is there.
  OwnedBuffer take_precise(PrecisionTime time);
  /// True when a unit for a frame of this time cannot come any more.
  bool is_past(Time time, Time tolerance) const { return progress_ != never && progress_ > time + tolerance; }
  bool is_past_precisely(PrecisionTime time) const {
    return frames_run_ < run_ || (precision_progress_ && *precision_progress_ > time);
  }
  /// The units' gaps reach beyond a frame of this time.
  bool is_gap(Time time, Time tolerance) const { return gaps_ != never && gaps_ > time + tolerance; }
  std::optional<PrecisionTime> precision_progress() const { return precision_progress_; }
  /// The frames have stamps from now on: they are of the oldest run of which there are units.
  void begin_precisely();
  /// The units are in a later run than the frames.
  bool has_later_run() const { return frames_run_ < run_; }
  /// The frames are in the next run from now on, whether its units have begun or not: what is kept of before
  /// is dropped. Returns how many units that were.
  std::uint64_t leave_run();
  /// Drops units that no frame from `time` on can match; returns how many.
  std::uint64_t drop_before(Time time);
  std::uint64_t drop_before_precisely(PrecisionTime time);
  std::uint64_t drop_oldest();
  std::size_t size() const { return units_.size(); }
  std::size_t bytes() const { return bytes_; } ///< of all buffers, with what follows a unit in its buffer
  void clear();

 private:
  /// Run of the sender, precision time and order of arrival: a key that no two units share.
  struct Key {
    std::uint64_t run;
    PrecisionTime time;
    std::uint64_t arrived;
    bool operator<(const Key& other) const {
      return std::tie(run, time, arrived) < std::tie(other.run, other.time, other.arrived);
    }
  };
  struct Unit {
    OwnedBuffer buffer;
    Key key;
  };
  using Units = std::multimap<Time, Unit>;
  OwnedBuffer remove(Units::iterator unit);

  Units units_;
  std::map<Key, Units::iterator> precise_;
  std::uint64_t arrived_ = 0;
  std::uint64_t run_ = 0, frames_run_ = 0; ///< of the newest unit, and of the frames
  bool frames_lead_ = false;               ///< the frames' run began first, and has met no unit yet
  std::size_t bytes_ = 0;
  Time progress_ = never, gaps_ = never;
  std::optional<PrecisionTime> precision_progress_; ///< of the newest unit's run
};

} // namespace terrainseg
