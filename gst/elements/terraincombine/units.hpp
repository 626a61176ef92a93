// SPDX-License-Identifier: LGPL-2.1-or-later
// KLV units that wait for their frames, and the times of those that come without a time stamp.
#pragma once

#include <gst/gst.h>

#include <algorithm>
#include <compare>
#include <cstdint>
#include <limits>
#include <list>
#include <map>
#include <optional>

#include "support/buffers.hpp"

namespace terrainseg {

/// Running time, signed: units may lie before the segment.
using Time = std::int64_t;
inline constexpr Time never = std::numeric_limits<Time>::min();
/// Limit of times, positive or negative, so that a sum of three does not overflow: 73 years.
inline constexpr Time most_time = std::numeric_limits<Time>::max() / 4;

/// Microseconds of the sender's clock, which units carry, and frames with a stamp: their precision time.
using PrecisionTime = std::uint64_t;

/// Whether `time` is before `now` by more than units are ever reordered: the sender has restarted.
bool is_anew(PrecisionTime time, PrecisionTime now);

/// The time of a unit, and the earliest time of later units.
struct UnitPlace {
  Time time;     ///< running time
  Time progress; ///< later units are not before this running time
  PrecisionTime precision = 0, precision_progress = 0;
};

/// Times are within most_time, tolerances within 0..most_time. The owner does the locking.
class UnitStore {
 public:
  /// Adds a unit. When its time is before the last one by more than units are ever reordered, the sender has
  /// restarted: all stored units are dropped. Returns their number. `stamped`: frames are matched by
  /// precision time. Then a restart begins another run, and the units of the previous run stay for frames
  /// that have not arrived yet.
  std::uint64_t add(const UnitPlace& place, OwnedBuffer unit, bool stamped = false);
  /// A gap of the units ends at that time.
  void advance(Time progress) {
    progress_ = std::max(progress_, progress);
    gaps_ = std::max(gaps_, progress);
  }
  /// Removes and returns the nearest unit at most `tolerance` from `time`; nullptr when there is none.
  OwnedBuffer take(Time time, Time tolerance);
  /// Removes and returns the first unit of this precision time in the frames' run; nullptr when there is
  /// none.
  OwnedBuffer take_precise(PrecisionTime time);
  /// True when no unit can arrive any more for a frame of this time.
  bool is_past(Time time, Time tolerance) const { return progress_ != never && progress_ > time + tolerance; }
  bool is_past_precisely(PrecisionTime time) const {
    return frames_run_ < run_ || (precision_progress_ && *precision_progress_ > time);
  }
  /// True when the units' gaps extend beyond a frame of this time.
  bool is_gap(Time time, Time tolerance) const { return gaps_ != never && gaps_ > time + tolerance; }
  std::optional<PrecisionTime> precision_progress() const { return precision_progress_; }
  /// From now on frames have stamps: they belong to the oldest run that has units.
  void begin_precisely();
  /// True when the units are in a later run than the frames.
  bool has_later_run() const { return frames_run_ < run_; }
  /// From now on frames belong to the next run, whether it has units yet or not. Drops the units of earlier
  /// runs and returns their number.
  std::uint64_t leave_run();
  /// Drops units that no frame from `time` on can match. Returns their number.
  std::uint64_t drop_before(Time time);
  std::uint64_t drop_before_precisely(PrecisionTime time);
  void drop_oldest(); ///< there is one
  std::size_t size() const { return units_.size(); }
  std::size_t bytes() const { return bytes_; } ///< size of all buffers, including bytes after a unit
  void clear();

 private:
  /// Run of the sender, precision time and order of arrival: a key that no two units share.
  struct Key {
    std::uint64_t run;
    PrecisionTime time;
    std::uint64_t arrived;
    auto operator<=>(const Key&) const = default;
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
  std::uint64_t run_ = 0, frames_run_ = 0; ///< run of the newest unit, and of the frames
  bool frames_lead_ = false;               ///< the frames' run has no unit yet
  std::size_t bytes_ = 0;
  Time progress_ = never, gaps_ = never;
  std::optional<PrecisionTime> precision_progress_; ///< progress in the newest unit's run
};

/// Computes running times for units without a PTS. The first unit since the start belongs to the first frame.
/// The time of a later unit follows from its precision time stamp; when that does not advance, from its frame
/// number; when that does not advance either, from its position in the stream. The result depends only on the
/// units and frames. The owner does the locking.
class UnitClock {
 public:
  /// What a unit says of its time.
  struct Stamp {
    std::uint64_t time_us, frame;
  };
  struct Unit {
    Stamp stamp;
    OwnedBuffer buffer;
    Time time = never;
  };

  /// Every frame, in order; `duration` 0 = unknown. True when it is the first that units can be placed by.
  bool see_frame(Time time, Time duration);
  void add(Stamp stamp, OwnedBuffer unit);
  /// The units that have a time by now, in order of arrival; none before the first frame. With `all` also
  /// those that have none and get none, with never: frames with stamps do without.
  std::list<Unit> place(bool all = false);

  std::size_t waiting() const { return waiting_.size(); }
  std::size_t waiting_bytes() const { return bytes_; }
  void drop_oldest(); ///< of those that wait for the first frame; there is one
  void forget_units();

 private:
  Time time_of(const Stamp& stamp);

  std::list<Unit> waiting_;
  std::size_t bytes_ = 0;
  Time first_frame_ = never, duration_ = 0;
  std::optional<Stamp> first_; ///< of the units
  std::uint64_t count_ = 0;    ///< units since the first
};

} // namespace terrainseg
