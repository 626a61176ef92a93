// SPDX-License-Identifier: LGPL-2.1-or-later
// KLV units that wait for their frames, and the times of those that come without a time stamp.
#pragma once

#include <gst/gst.h>

#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <iterator>
#include <limits>
#include <list>
#include <map>
#include <optional>
#include <tuple>
#include <utility>

#include "support/buffers.hpp"

namespace terrainseg {

/// Running time, signed: units may lie before the segment.
using Time = std::int64_t;
inline constexpr Time never = std::numeric_limits<Time>::min();
/// Limit of times, positive or negative, so that a sum of three does not overflow: 73 years.
inline constexpr Time most_time = std::numeric_limits<Time>::max() / 4;

/// Microseconds of the sender's clock, which units carry, and frames with a stamp: their precision time.
using PrecisionTime = std::uint64_t;

/// Units are never reordered further.
inline constexpr Time longest_reordering = GST_SECOND;

/// Whether `time` is before `now` by more than units are ever reordered: the sender has restarted.
inline bool is_anew(PrecisionTime time, PrecisionTime now) {
  return now > time && now - time > longest_reordering / GST_USECOND;
}

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
  std::uint64_t add(const UnitPlace& place, OwnedBuffer buffer, bool stamped = false) {
    std::uint64_t dropped = 0;
    if (!stamped && progress_ != never && place.progress < progress_ - longest_reordering) {
      dropped = units_.size();
      clear();
    }
    if (precision_progress_ && is_anew(place.precision_progress, *precision_progress_)) {
      ++run_;
      precision_progress_.reset();
      if (std::exchange(frames_lead_, false)) // what came meanwhile was late
        frames_run_ = run_;
    }
    bytes_ += gst_buffer_get_size(buffer.get());
    const Key key = {run_, place.precision, arrived_++};
    const auto unit = units_.emplace(place.time, Unit{std::move(buffer), key});
    precise_.emplace(key, unit);
    progress_ = std::max(progress_, place.progress);
    precision_progress_ = std::max(precision_progress_.value_or(0), place.precision_progress);
    return dropped;
  }
  /// A gap of the units ends at that time.
  void advance(Time progress) {
    progress_ = std::max(progress_, progress);
    gaps_ = std::max(gaps_, progress);
  }
  /// Removes and returns the nearest unit at most `tolerance` from `time`; nullptr when there is none.
  OwnedBuffer take(Time time, Time tolerance) {
    auto best = units_.lower_bound(time);
    if (best != units_.begin()) {
      const auto before = std::prev(best);
      if (best == units_.end() || time - before->first <= best->first - time)
        best = before;
    }
    if (best == units_.end() || std::abs(best->first - time) > tolerance)
      return nullptr;
    return remove(best);
  }
  /// Removes and returns the first unit of this precision time in the frames' run; nullptr when there is
  /// none.
  OwnedBuffer take_precise(PrecisionTime time) {
    const auto first = precise_.lower_bound({frames_run_, time, 0});
    if (first == precise_.end() || first->first.run != frames_run_ || first->first.time != time)
      return nullptr;
    frames_lead_ = false;
    return remove(first->second);
  }
  /// True when no unit can arrive any more for a frame of this time.
  bool is_past(Time time, Time tolerance) const { return progress_ != never && progress_ > time + tolerance; }
  bool is_past_precisely(PrecisionTime time) const {
    return frames_run_ < run_ || (precision_progress_ && *precision_progress_ > time);
  }
  /// True when the units' gaps extend beyond a frame of this time.
  bool is_gap(Time time, Time tolerance) const { return gaps_ != never && gaps_ > time + tolerance; }
  std::optional<PrecisionTime> precision_progress() const { return precision_progress_; }
  /// From now on frames have stamps: they belong to the oldest run that has units.
  void begin_precisely() {
    frames_run_ = precise_.empty() ? run_ : precise_.begin()->first.run;
    frames_lead_ = false;
  }
  /// True when the units are in a later run than the frames.
  bool has_later_run() const { return frames_run_ < run_; }
  /// From now on frames belong to the next run, whether it has units yet or not. Drops the units of earlier
  /// runs and returns their number.
  std::uint64_t leave_run() {
    if (!has_later_run()) {
      ++run_;
      precision_progress_.reset();
      frames_lead_ = true;
    }
    ++frames_run_;
    return drop_before_precisely(0);
  }
  /// Drops units that no frame from `time` on can match. Returns their number.
  std::uint64_t drop_before(Time time) {
    std::uint64_t count = 0;
    for (; !units_.empty() && units_.begin()->first < time; ++count)
      remove(units_.begin());
    return count;
  }
  std::uint64_t drop_before_precisely(PrecisionTime time) {
    std::uint64_t count = 0;
    for (const Key first = {frames_run_, time, 0}; !precise_.empty() && precise_.begin()->first < first;
         ++count)
      remove(precise_.begin()->second);
    return count;
  }
  void drop_oldest() { remove(units_.begin()); } ///< there is one
  std::size_t size() const { return units_.size(); }
  std::size_t bytes() const { return bytes_; } ///< size of all buffers, including bytes after a unit
  void clear() {
    precise_.clear();
    units_.clear();
    bytes_ = 0;
    progress_ = gaps_ = never;
    precision_progress_.reset();
    frames_run_ = run_;
    frames_lead_ = false;
  }

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
  OwnedBuffer remove(Units::iterator unit) {
    OwnedBuffer buffer = std::move(unit->second.buffer);
    bytes_ -= gst_buffer_get_size(buffer.get());
    precise_.erase(unit->second.key);
    units_.erase(unit);
    return buffer;
  }

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
  bool see_frame(Time time, Time duration) {
    if (duration > 0)
      duration_ = duration;
    if (first_frame_ != never || time == never)
      return false;
    first_frame_ = time;
    return true;
  }
  void add(Stamp stamp, OwnedBuffer unit) {
    bytes_ += gst_buffer_get_size(unit.get());
    waiting_.push_back({stamp, std::move(unit)});
  }
  /// The units that have a time by now, in order of arrival; none before the first frame. With `all` also
  /// those that have none and get none, with never: frames with stamps do without.
  std::list<Unit> place(bool all = false) {
    if (first_frame_ == never && !all)
      return {};
    for (Unit& unit : waiting_)
      unit.time = first_frame_ == never ? never : time_of(unit.stamp);
    if (!all)
      waiting_.remove_if([](const Unit& unit) { return unit.time == never; });
    bytes_ = 0;
    return std::exchange(waiting_, {});
  }

  std::size_t waiting() const { return waiting_.size(); }
  std::size_t waiting_bytes() const { return bytes_; }
  /// Of those that wait for the first frame; there is one.
  void drop_oldest() {
    bytes_ -= gst_buffer_get_size(waiting_.front().buffer.get());
    waiting_.pop_front();
  }
  void forget_units() {
    waiting_.clear();
    bytes_ = 0;
    first_.reset();
    count_ = 0;
  }

 private:
  /// Where nothing tells the frame rate: 30 frames a second.
  static constexpr Time default_duration = GST_SECOND / 30;

  /// base + steps * step, or never when that lies beyond what times are.
  static Time placed_at(Time base, std::uint64_t steps, Time step) {
    const auto room = static_cast<std::uint64_t>(most_time - std::max<Time>(base, 0));
    return steps > room / static_cast<std::uint64_t>(step) ? never : base + static_cast<Time>(steps) * step;
  }
  Time time_of(const Stamp& stamp) {
    if (!first_)
      first_ = stamp;
    const std::uint64_t index = count_++;
    // What goes back belongs to another run of the sender, which nothing ties to these frames.
    if (stamp.time_us != first_->time_us)
      return stamp.time_us > first_->time_us
                 ? placed_at(first_frame_, stamp.time_us - first_->time_us, GST_USECOND)
                 : never;
    const Time duration = duration_ > 0 ? duration_ : default_duration;
    if (stamp.frame != first_->frame)
      return stamp.frame > first_->frame ? placed_at(first_frame_, stamp.frame - first_->frame, duration)
                                         : never;
    return placed_at(first_frame_, index, duration);
  }

  std::list<Unit> waiting_;
  std::size_t bytes_ = 0;
  Time first_frame_ = never, duration_ = 0;
  std::optional<Stamp> first_; ///< of the units
  std::uint64_t count_ = 0;    ///< units since the first
};

} // namespace terrainseg
