// SPDX-License-Identifier: LGPL-2.1-or-later
// Decides which KLV unit belongs to which frame, and how long a frame waits for its unit.
#pragma once

#include <chrono>
#include <cstdint>
#include <optional>
#include <string>

#include "elements/terraincombine/units.hpp"
#include "support/warnings.hpp"

namespace terrainseg {

enum class Match : std::uint8_t { automatic, time_stamps };
enum class Live : std::uint8_t { unknown, no, yes };

/// Matches units and frames as they arrive. It has no pads, threads or clock: the owner passes times, waits,
/// and locks.
///
/// Live, a frame waits for `latency` from its arrival. Not live, the result depends on the data alone: a
/// frame waits until its unit is there, cannot come any more, or the units have ended; or, so that no
/// pipeline hangs, until no unit has come for stall_limit.
class Matcher {
 public:
  using Clock = std::chrono::steady_clock;
  static constexpr std::chrono::seconds stall_limit{5};
  static constexpr unsigned silence_frames = 60; ///< frames without a unit after which the reason is reported
  /// Number of consecutive frames without a stamp, after stamped ones, from which on the sender has stopped
  /// stamping. Before that a frame without a stamp has lost it on the link, and the nearest unit may belong
  /// to its neighbour.
  static constexpr unsigned stampless_frames = 25;

  /// What a frame is matched by.
  struct Frame {
    Time time = never;
    Time tolerance = 0;
    std::optional<PrecisionTime> stamp;
    Match match = Match::automatic;
  };
  /// Times of a unit; `decoding` gives the order of units after an encoder with B-frames.
  struct UnitTimes {
    Time time = never, decoding = never;
    PrecisionTime precision = 0;
    std::uint64_t frame = 0;
  };
  struct Wait {
    Clock::time_point arrival, since; ///< arrival of the frame, and when it became the next one to leave
    Clock::duration latency;
    bool in_vain = false; ///< no unit can arrive: the pad is unlinked or flushing
  };
  struct Answer {
    OwnedBuffer unit;
    bool is_final = true;                          ///< false: wait for changes, or until `until`
    Clock::time_point until = Clock::time_point(); ///< then it is final
    std::uint64_t dropped = 0;                     ///< units that no frame can match any more
  };
  struct Counts {
    std::uint64_t matched = 0;  ///< frames with metadata
    std::uint64_t precise = 0;  ///< of these, matched by precision time
    std::uint64_t lost = 0;     ///< frames without metadata
    std::uint64_t rejected = 0; ///< units that were damaged or foreign
    std::uint64_t unused = 0;   ///< units whose frame did not arrive
  };

  void start(); ///< resets counts and reports
  void set_live(Live live) { live_ = live; }
  Live live() const { return live_; }

  // ---- units
  /// True once, when units without time stamps are matched by less than the video's time stamps.
  bool add_unit(const UnitTimes& times, OwnedBuffer unit);
  std::uint64_t reject_unit() { return ++counts_.rejected; } ///< returns the number so far
  void add_gap(Time end); ///< there are no units up to `end`; never = unknown
  /// Data or an event of the units has arrived.
  void note_unit_side(Clock::time_point now) { unit_side_moved_ = now; }
  void begin_units() { ended_ = stalled_ = false; }
  void end_units() { ended_ = true; }
  void flush_units();
  bool has_room() const;
  void make_room(); ///< drops the oldest units

  // ---- frames
  /// A frame has arrived and is queued. `duration` is that of a frame, 0 = unknown.
  void expect_frame(Time time, bool has_stamp, Time duration);
  void flush_frames();
  /// The frame is the next to leave. Call it once, before its first look_for().
  void begin_frame(const Frame& frame);
  Answer look_for(const Frame& frame, const Wait& wait, Clock::time_point now);
  /// Counts the frame that leaves. Empty, or why no frame has been matched for a while and what to do, once
  /// until start().
  std::string end_frame(const Frame& frame, bool matched, Clock::duration latency);

  const Counts& counts() const { return counts_; }

 private:
  void place_units();
  bool begins_anew(PrecisionTime stamp) const;
  bool can_match(const Frame& frame) const;
  bool is_past(const Frame& frame) const;
  std::uint64_t drop_past(const Frame& frame);
  std::string silence_reason(const Frame& frame, Clock::duration latency) const;
  std::string precise_silence_reason(PrecisionTime frame, Clock::duration latency) const;

  UnitStore units_;
  UnitClock clock_; ///< times of units without a PTS
  Counts counts_;
  Live live_ = Live::unknown;
  bool ended_ = false;   ///< the stream of units has ended
  bool stalled_ = false; ///< a frame waited without result, and no unit has arrived since
  Clock::time_point unit_side_moved_;
  Time newest_unit_ = never, newest_frame_ = never; ///< largest times since the last flush
  struct {
    bool came = false;    ///< a frame with one has been queued since the last flush
    bool in_use = false;  ///< frames carry stamps
    unsigned missing = 0; ///< frames without one in a row
    PrecisionTime last = 0;
  } stamps_;
  struct {
    unsigned frames = 0, units = 0, gaps = 0; ///< since the last match
  } silence_;
  Once<> silence_report_, timeless_report_;
};

} // namespace terrainseg
