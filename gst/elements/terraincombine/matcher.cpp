// SPDX-License-Identifier: LGPL-2.1-or-later
#include "elements/terraincombine/matcher.hpp"

#include <algorithm>
#include <utility>

namespace terrainseg {
namespace {

/// Largest number of units that wait for video, not decoded: more than two minutes at 30 frames a second.
constexpr std::size_t most_units = 4096;
constexpr std::size_t most_unit_bytes = std::size_t{64} << 20;
/// Units at most this far from a frame with a stamp are kept, because links shift time stamps by less.
constexpr Time most_shift = 10 * Time{GST_SECOND};

std::string seconds_text(Time time) {
  gchar text[32];
  g_snprintf(text, sizeof text, "%.3f s", static_cast<double>(time) / GST_SECOND);
  return text;
}

std::string late_units(Time behind, Matcher::Clock::duration latency) {
  const auto more = std::chrono::milliseconds(std::min<Time>(behind / GST_MSECOND, 60000));
  const auto enough = std::chrono::duration_cast<std::chrono::milliseconds>(latency) + more;
  return "units arrive " + seconds_text(behind) + " after their frames: set latency to " +
         std::to_string(enough.count()) + " or more";
}

} // namespace

void Matcher::start() {
  counts_ = {};
  live_ = Live::unknown;
  silence_ = {};
  silence_report_.again();
  timeless_report_.again();
}

// ---- units -----------------------------------------------------------------------------------------------

bool Matcher::add_unit(const UnitTimes& times, OwnedBuffer unit) {
  begin_units();
  ++silence_.units;
  if (times.time == never) {
    clock_.add({times.precision, times.frame}, std::move(unit));
    place_units();
    return newest_frame_ != never && !stamps_.came && timeless_report_.first();
  }
  newest_unit_ = std::max(newest_unit_, times.time);
  const Time progress = times.decoding != never ? std::min(times.decoding, times.time) : times.time;
  const PrecisionTime ahead = static_cast<PrecisionTime>(times.time - progress) / GST_USECOND;
  counts_.unused +=
      units_.add({times.time, progress, times.precision, times.precision - std::min(times.precision, ahead)},
                 std::move(unit), stamps_.in_use);
  return false;
}

/// Gives the units without a PTS that wait for the first frame their times; where frames have stamps, others
/// stay as long as those of this moment.
void Matcher::place_units() {
  for (auto& [stamp, buffer, placed] : clock_.place(stamps_.came)) {
    const Time time = placed != never ? placed : std::max({newest_unit_, newest_frame_, Time{0}});
    newest_unit_ = std::max(newest_unit_, placed);
    counts_.unused +=
        units_.add({time, time, stamp.time_us, stamp.time_us}, std::move(buffer), stamps_.in_use);
  }
}

void Matcher::add_gap(Time end) {
  if (end != never)
    units_.advance(end);
  ++silence_.gaps;
}

void Matcher::flush_units() {
  begin_units();
  newest_unit_ = never;
  units_.clear();
  clock_.forget_units();
}

bool Matcher::has_room() const {
  return units_.size() + clock_.waiting() < most_units &&
         units_.bytes() + clock_.waiting_bytes() < most_unit_bytes;
}

void Matcher::make_room() {
  for (; !has_room() && units_.size() + clock_.waiting() > 0; ++counts_.unused)
    if (units_.size() > 0)
      units_.drop_oldest();
    else
      clock_.drop_oldest();
}

// ---- frames ----------------------------------------------------------------------------------------------

void Matcher::expect_frame(Time time, bool has_stamp, Time duration) {
  newest_frame_ = std::max(newest_frame_, time);
  const bool first_stamp = has_stamp && !std::exchange(stamps_.came, true);
  if (clock_.see_frame(time, duration) || first_stamp)
    place_units();
}

void Matcher::flush_frames() {
  stamps_ = {};
  newest_frame_ = never;
  clock_ = {};
}

/// Whether this frame belongs to the sender's next run (it has restarted). When units of the next run have
/// arrived, every step back is the restart, and so is a long series of frames without a unit. Otherwise a
/// single wrong stamp, or a clock that is set back a little, is not a restart.
bool Matcher::begins_anew(PrecisionTime stamp) const {
  if (units_.has_later_run())
    return stamp < stamps_.last || silence_.frames >= silence_frames;
  const auto progress = units_.precision_progress();
  return is_anew(stamp, stamps_.last) && progress && is_anew(stamp, *progress);
}

void Matcher::begin_frame(const Frame& frame) {
  if (!frame.stamp) {
    stamps_.in_use =
        stamps_.in_use && frame.match == Match::automatic && ++stamps_.missing < stampless_frames;
    return;
  }
  stamps_.missing = 0;
  if (!std::exchange(stamps_.in_use, true))
    units_.begin_precisely();
  else if (begins_anew(*frame.stamp))
    counts_.unused += units_.leave_run();
  stamps_.last = *frame.stamp;
}

/// Also false for a frame that has lost its stamp: the nearest unit may belong to its neighbour.
bool Matcher::can_match(const Frame& frame) const {
  return frame.stamp || (frame.time != never && !stamps_.in_use);
}

/// Whether the frame's unit cannot arrive any more. Gaps have no stamp, and the link changes their time
/// stamps: in a live pipeline the frame waits.
bool Matcher::is_past(const Frame& frame) const {
  if (!frame.stamp)
    return units_.is_past(frame.time, frame.tolerance);
  return units_.is_past_precisely(*frame.stamp) ||
         (live_ == Live::no && frame.time != never && units_.is_gap(frame.time, frame.tolerance));
}

/// Drops units that neither this frame nor a later one can match. Returns their number.
std::uint64_t Matcher::drop_past(const Frame& frame) {
  if (!frame.stamp)
    return units_.drop_before(frame.time - frame.tolerance);
  // A stamp beyond all units may be damaged: then the next frame's decides.
  const auto progress = units_.precision_progress();
  const bool beyond = !units_.has_later_run() && progress && *frame.stamp > *progress;
  const std::uint64_t past = beyond ? 0 : units_.drop_before_precisely(*frame.stamp);
  return frame.time == never ? past : past + units_.drop_before(frame.time - most_shift);
}

Matcher::Answer Matcher::look_for(const Frame& frame, const Wait& wait, Clock::time_point now) {
  Answer answer;
  if (!can_match(frame))
    return answer;
  answer.unit = frame.stamp ? units_.take_precise(*frame.stamp) : units_.take(frame.time, frame.tolerance);
  answer.dropped = drop_past(frame);
  counts_.unused += answer.dropped;
  if (answer.unit || ended_ || stalled_ || wait.in_vain || is_past(frame))
    return answer;
  answer.until = live_ == Live::no ? std::max(wait.since, unit_side_moved_) +
                                         std::max<Clock::duration>(stall_limit, wait.latency)
                                   : wait.arrival + wait.latency;
  answer.is_final = stalled_ = now >= answer.until; // the next frames do not wait until a unit arrives
  return answer;
}

std::string Matcher::end_frame(const Frame& frame, bool matched, Clock::duration latency) {
  if (matched) {
    ++counts_.matched;
    counts_.precise += frame.stamp ? 1 : 0;
    silence_ = {};
    return {};
  }
  ++counts_.lost;
  if (++silence_.frames < silence_frames || ended_ || (silence_.units == 0 && silence_.gaps > 0) ||
      !silence_report_.first())
    return {};
  return silence_reason(frame, latency);
}

// ---- reasons ---------------------------------------------------------------------------------------------

std::string Matcher::precise_silence_reason(PrecisionTime frame, Clock::duration latency) const {
  constexpr PrecisionTime most_delay = 60'000'000;
  const PrecisionTime newest = units_.precision_progress().value_or(0);
  if (newest < frame && frame - newest <= most_delay && live_ != Live::no)
    return late_units(static_cast<Time>(frame - newest) * static_cast<Time>(GST_USECOND), latency);
  return "the precision times of the frames (now " + std::to_string(frame) +
         " us) differ from those of the units (now " + std::to_string(newest) +
         " us): check that the sender's terrainstamp and terrainextract see the same frames, or set "
         "match=time-stamps";
}

std::string Matcher::silence_reason(const Frame& frame, Clock::duration latency) const {
  if (silence_.units == 0)
    return "no KLV unit was received: check that the sender's terrainextract is linked to the muxer, and the "
           "demuxer's meta/x-klv pad to this element";
  if (frame.stamp)
    return precise_silence_reason(*frame.stamp, latency);
  if (frame.time == never)
    return "the frames carry no time stamps: add an element that sets them (a parser, or appsrc with "
           "do-timestamp=true)";
  if (newest_unit_ == never)
    return "the units carry neither time stamps nor precision times: send them with time stamps";
  const Time ahead = newest_unit_ - frame.time;
  if (ahead < -frame.tolerance && live_ != Live::no)
    return late_units(-ahead, latency);
  if (ahead < -frame.tolerance || ahead > frame.tolerance)
    return "the units' time stamps are " + seconds_text(ahead < 0 ? -ahead : ahead) +
           (ahead < 0 ? " before" : " after") + " the video's: both streams need the same clock and segment";
  return "the units are more than half a frame away from any frame: check for a videorate between the "
         "sender's terrainextract and encoder";
}

} // namespace terrainseg
