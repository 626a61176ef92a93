// SPDX-License-Identifier: LGPL-2.1-or-later
// Times of KLV units that come without a time stamp.
#pragma once

#include <cstdint>
#include <list>
#include <optional>

#include "elements/terraincombine/unit_store.hpp"
#include "support/buffers.hpp"

namespace terrainseg {

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
  struct Placed {
    Time time;
    std::uint64_t time_us;
    OwnedBuffer unit;
  };

  /// Every frame, in order; `duration` 0 = unknown. True when it is the first that units can be placed by.
  bool see_frame(Time time, Time duration);
  void add(Stamp stamp, OwnedBuffer unit);
  /// The units that have a time by now, in order of arrival; none before the first frame. With `all` also
  /// those that have none and get none, with never: frames with stamps do without.
  std::list<Placed> place(bool all = false);

  std::size_t waiting() const { return waiting_.size(); }
  std::size_t waiting_bytes() const { return bytes_; }
  std::uint64_t drop_oldest(); ///< of those that wait for the first frame; returns how many
  void forget_units();
  void reset(); ///< and the frames

 private:
  struct Waiting {
    Stamp stamp;
    OwnedBuffer unit;
  };
  Time time_of(const Stamp& stamp);

  std::list<Waiting> waiting_;
  std::size_t bytes_ = 0;
  Time first_frame_ = never, duration_ = 0;
  std::optional<Stamp> first_; ///< of the units
  std::uint64_t count_ = 0;    ///< units since the first
};

} // namespace terrainseg
