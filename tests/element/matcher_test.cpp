// SPDX-License-Identifier: LGPL-2.1-or-later
// The matcher of terraincombine by itself: no pads, no threads, no clock.
#include "elements/terraincombine/matcher.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <deque>
#include <limits>
#include <map>
#include <random>
#include <vector>

namespace terrainseg {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

constexpr Time frame_time = 40 * GST_MSECOND;
constexpr int nothing = -1;
const Matcher::Clock::time_point start;

OwnedBuffer unit_number(int i) {
  return OwnedBuffer(gst_buffer_new_memdup(&i, sizeof i));
}
int number_of(const OwnedBuffer& unit) {
  int i = nothing;
  if (unit)
    gst_buffer_extract(unit.get(), 0, &i, sizeof i);
  return i;
}

/// The matcher with the frames that wait in front of it, as the element queues them.
class Bench {
 public:
  explicit Bench(Live live) { matcher.set_live(live); }

  void push(const Matcher::Frame& frame) {
    matcher.expect_frame(frame.time, frame.stamp.has_value(), frame_time);
    waiting_.push_back({frame, now, {}});
  }
  void push(const Matcher::UnitTimes& times, int number) {
    matcher.note_unit_side(now);
    timeless_reports += matcher.add_unit(times, unit_number(number));
  }
  /// Lets frames leave for as long as the answer is final.
  void run() {
    while (!waiting_.empty()) {
      Waiting& front = waiting_.front();
      if (!front.since) {
        front.since = now;
        matcher.begin_frame(front.frame);
      }
      const auto answer = matcher.look_for(front.frame, {front.arrival, *front.since, latency}, now);
      if (!answer.is_final) {
        until = answer.until;
        return;
      }
      const int unit = number_of(answer.unit);
      left.push_back(unit);
      left_at.push_back(now);
      if (auto reason = matcher.end_frame(front.frame, unit != nothing, latency); !reason.empty())
        reasons.push_back(reason);
      waiting_.pop_front();
    }
    until.reset();
  }
  /// Time passes up to `to`; frames leave when their deadline comes.
  void run_until(Matcher::Clock::time_point to) {
    for (run(); until && *until <= to; run())
      now = *until;
    now = to;
  }

  Matcher matcher;
  Matcher::Clock::time_point now = start;
  Matcher::Clock::duration latency = milliseconds(200);
  std::vector<int> left; ///< the unit of each frame, in order
  std::vector<Matcher::Clock::time_point> left_at;
  std::vector<std::string> reasons;
  std::optional<Matcher::Clock::time_point> until; ///< of the frame that waits
  int timeless_reports = 0;

 private:
  struct Waiting {
    Matcher::Frame frame;
    Matcher::Clock::time_point arrival;
    std::optional<Matcher::Clock::time_point> since;
  };
  std::deque<Waiting> waiting_;
};

Matcher::Frame frame_at(Time time) {
  return {time, frame_time / 2, std::nullopt, Match::automatic};
}
Matcher::Frame stamped_frame(Time time, PrecisionTime stamp) {
  return {time, frame_time / 2, stamp, Match::automatic};
}
Matcher::UnitTimes unit_at(Time time, PrecisionTime precision = 0) {
  return {time, never, precision, 0};
}

/// A drive: frames, and units of most of them that lie a little beside.
struct Drive {
  std::vector<Matcher::Frame> frames;
  std::vector<Matcher::UnitTimes> units;
};

Drive random_drive(std::mt19937& random, bool stamped) {
  Drive drive;
  std::uniform_int_distribution<Time> beside(-frame_time * 2 / 5, frame_time * 2 / 5);
  const Time shift = stamped ? std::uniform_int_distribution<Time>(-GST_SECOND, GST_SECOND)(random) : 0;
  for (int i = 0; i < 120; ++i) {
    const Time time = i * frame_time;
    const PrecisionTime precision = 1'000'000 + static_cast<PrecisionTime>(i) * 40'000;
    drive.frames.push_back(stamped ? stamped_frame(time, precision) : frame_at(time));
    if (random() % 5) // the others are lost
      drive.units.push_back(unit_at(time + shift + beside(random), precision));
    if (random() % 10 == 0) // the sender does not know the next frame: videorate dropped it
      drive.frames.pop_back();
  }
  return drive;
}

/// The oracle knows all units from the beginning and looks at every one of them for every frame.
std::vector<int> oracle(const Drive& drive, bool stamped) {
  std::vector<bool> used(drive.units.size());
  std::vector<int> result;
  for (const Matcher::Frame& frame : drive.frames) {
    int best = nothing;
    Time least = std::numeric_limits<Time>::max();
    for (std::size_t i = 0; i < drive.units.size(); ++i) {
      const Time distance = stamped ? (drive.units[i].precision == *frame.stamp ? 0 : least)
                                    : std::abs(drive.units[i].time - frame.time);
      if (!used[i] && distance < least && (stamped || distance <= frame.tolerance)) {
        least = distance;
        best = static_cast<int>(i);
      }
    }
    if (best != nothing)
      used[static_cast<std::size_t>(best)] = true;
    result.push_back(best);
  }
  return result;
}

// Not live the data alone decide: however frames and units interleave, the result is the oracle's.
TEST(Matcher, NotLiveEveryInterleavingGivesTheOraclesPairs) {
  std::mt19937 random(7);
  for (int trial = 0; trial < 400; ++trial) {
    const bool stamped = trial % 2;
    const Drive drive = random_drive(random, stamped);
    const std::vector<int> expected = oracle(drive, stamped);
    Bench bench(Live::no);
    std::size_t frame = 0, unit = 0;
    const unsigned frames_in_ten = 1 + random() % 9;
    while (frame < drive.frames.size() || unit < drive.units.size()) {
      // Sometimes units run far ahead; frames may do so by what the element's queue holds.
      const bool ahead = frame > unit + 8;
      if (frame < drive.frames.size() &&
          (unit == drive.units.size() || (!ahead && random() % 10 < frames_in_ten)))
        bench.push(drive.frames[frame++]);
      else {
        bench.push(drive.units[unit], static_cast<int>(unit));
        ++unit;
      }
      bench.now += milliseconds(random() % 50);
      bench.run();
    }
    bench.matcher.end_units();
    bench.run();
    ASSERT_EQ(bench.left, expected) << "trial " << trial;
    const auto& counts = bench.matcher.counts();
    const auto matched = static_cast<std::uint64_t>(
        std::count_if(expected.begin(), expected.end(), [](int i) { return i != nothing; }));
    EXPECT_EQ(counts.matched, matched);
    EXPECT_EQ(counts.precise, stamped ? matched : 0);
    EXPECT_EQ(counts.lost, expected.size() - matched);
  }
}

// Live a frame leaves with its unit at once, else exactly `latency` after it came.
TEST(Matcher, LiveAFrameLeavesWithItsUnitOrAtItsDeadline) {
  std::mt19937 random(11);
  for (int trial = 0; trial < 50; ++trial) {
    Bench bench(trial % 2 ? Live::yes : Live::unknown);
    struct Arrival {
      milliseconds at;
      bool is_unit;
      int number;
    };
    std::vector<Arrival> arrivals;
    std::vector<milliseconds> frame_at_ms, unit_at_ms;
    milliseconds last_unit(0);
    for (int i = 0; i < 60; ++i) {
      frame_at_ms.emplace_back(40 * i);
      // In order, and always before the unit would be too late: then no frame gives up the wait for those
      // behind it.
      last_unit = std::max(last_unit, milliseconds(40 * i + static_cast<int>(random() % 180)));
      unit_at_ms.push_back(last_unit);
      arrivals.push_back({frame_at_ms.back(), false, i});
      arrivals.push_back({unit_at_ms.back(), true, i});
    }
    std::stable_sort(arrivals.begin(), arrivals.end(),
                     [](const auto& a, const auto& b) { return a.at < b.at; });
    for (const Arrival& a : arrivals) {
      bench.run_until(start + a.at);
      if (a.is_unit)
        bench.push(unit_at(a.number * frame_time), a.number);
      else
        bench.push(frame_at(a.number * frame_time));
      bench.run();
    }
    ASSERT_EQ(bench.left.size(), 60u);
    for (int i = 0; i < 60; ++i) {
      EXPECT_EQ(bench.left[static_cast<std::size_t>(i)], i);
      EXPECT_EQ(bench.left_at[static_cast<std::size_t>(i)],
                start + std::max(frame_at_ms[static_cast<std::size_t>(i)],
                                 unit_at_ms[static_cast<std::size_t>(i)]));
    }
    // The unit of this one does not come: it leaves at its deadline; the next does not wait any more.
    const auto late = start + milliseconds(10'000);
    bench.run_until(late);
    bench.push(frame_at(60 * frame_time));
    bench.run_until(late + milliseconds(150));
    bench.push(frame_at(61 * frame_time));
    bench.run_until(late + milliseconds(199));
    EXPECT_EQ(bench.left.size(), 60u);
    bench.run_until(late + milliseconds(200));
    EXPECT_EQ(bench.left.size(), 62u) << "once a frame waited in vain the next ones leave at once";
    bench.push(unit_at(62 * frame_time), 62);
    bench.push(frame_at(63 * frame_time));
    bench.run();
    EXPECT_EQ(bench.left.size(), 62u) << "a unit came: frames wait again";
  }
}

// A gap says that there is no unit. Live and with a stamp the frame rather waits: gaps have time stamps only.
TEST(Matcher, AGapReleasesItsFrame) {
  for (const Live live : {Live::no, Live::yes})
    for (const bool stamped : {false, true}) {
      Bench bench(live);
      bench.push(stamped ? stamped_frame(0, 5'000'000) : frame_at(0));
      bench.matcher.add_gap(frame_time);
      bench.run();
      EXPECT_EQ(bench.left.size(), live == Live::yes && stamped ? 0u : 1u);
    }
}

// A file whose units stop without an end.
TEST(Matcher, NotLiveAFrameWaitsForTheStallLimitFromTheLastUnit) {
  Bench bench(Live::no);
  bench.push(frame_at(100 * frame_time));
  bench.run_until(start + seconds(4));
  bench.push(unit_at(0), 0); // something comes: the way of the units is not blocked
  bench.run_until(start + seconds(4) + Matcher::stall_limit - milliseconds(1));
  EXPECT_TRUE(bench.left.empty());
  bench.run_until(start + seconds(4) + Matcher::stall_limit);
  EXPECT_EQ(bench.left, std::vector<int>{nothing});
}

TEST(Matcher, AFlushForgetsBothSides) {
  Bench bench(Live::no);
  bench.push(stamped_frame(0, 1'000'000));
  bench.push(unit_at(0, 1'000'000), 0);
  bench.run();
  EXPECT_EQ(bench.left, std::vector<int>{0});
  bench.push(unit_at(5 * frame_time, 1'200'000), 5);
  bench.matcher.flush_units();
  bench.matcher.flush_frames();
  // The same times once more, and without stamps: nothing of before counts.
  bench.push(frame_at(5 * frame_time));
  bench.run();
  EXPECT_EQ(bench.left.size(), 1u) << "its unit was flushed; another may come";
  bench.push(unit_at(5 * frame_time), 6);
  bench.run();
  EXPECT_EQ(bench.left, (std::vector<int>{0, 6}));
}

TEST(Matcher, UnitsWithoutTimeStampsBeginWithTheFirstFrame) {
  Bench bench(Live::no);
  for (int i = 0; i < 5; ++i)
    bench.push({never, never, 7'000'000 + static_cast<PrecisionTime>(i) * 40'000, 0}, i);
  EXPECT_EQ(bench.timeless_reports, 0) << "before a frame nothing is known of its stamps";
  for (int i = 0; i < 5; ++i)
    bench.push(frame_at(GST_SECOND + i * frame_time));
  bench.run();
  EXPECT_EQ(bench.left, (std::vector<int>{0, 1, 2, 3, 4}));
  bench.push({never, never, 7'200'000, 0}, 5);
  bench.push({never, never, 7'240'000, 0}, 6);
  EXPECT_EQ(bench.timeless_reports, 1) << "once";
}

// Memory is bounded: the oldest units go first.
TEST(Matcher, RoomForUnitsIsBounded) {
  Bench bench(Live::yes);
  int pushed = 0;
  for (; bench.matcher.has_room(); ++pushed)
    bench.push(unit_at(pushed * frame_time), pushed);
  EXPECT_EQ(pushed, 4096);
  bench.matcher.make_room();
  EXPECT_TRUE(bench.matcher.has_room());
  EXPECT_EQ(bench.matcher.counts().unused, 1u);
  bench.push(frame_at(0)); // the unit of this one is gone
  bench.push(frame_at(frame_time));
  bench.run();
  EXPECT_EQ(bench.left, (std::vector<int>{nothing, 1}));
}

/// The one reason for silence after frames and units that never match.
std::string reason_of(Live live, bool stamped, Time unit_offset, bool any_units = true) {
  Bench bench(live);
  for (int i = 0; i < 2 * static_cast<int>(Matcher::silence_frames); ++i) {
    const Time time = 20 * GST_SECOND + i * frame_time;
    const auto precision = static_cast<PrecisionTime>(time / GST_USECOND);
    bench.push(stamped ? stamped_frame(time, precision) : frame_at(time));
    if (any_units)
      bench.push(unit_at(time + unit_offset, static_cast<PrecisionTime>((time + unit_offset) / GST_USECOND)),
                 i);
    bench.run();
    bench.now += seconds(6); // whatever waits gives up
    bench.run();
  }
  EXPECT_EQ(bench.reasons.size(), 1u);
  return bench.reasons.empty() ? "" : bench.reasons.front();
}

TEST(Matcher, TheReasonForSilenceIsTheCause) {
  const auto has = [](const std::string& text, const char* part) {
    return text.find(part) != std::string::npos;
  };
  EXPECT_PRED2(has, reason_of(Live::yes, false, 0, false), "no KLV unit");
  EXPECT_PRED2(has, reason_of(Live::yes, false, -3 * GST_SECOND), "latency to 3200 ");
  EXPECT_PRED2(has, reason_of(Live::yes, true, -3 * GST_SECOND), "latency to 3200 ");
  EXPECT_PRED2(has, reason_of(Live::no, false, -3 * GST_SECOND), "3.000 s before");
  EXPECT_PRED2(has, reason_of(Live::no, false, 3 * GST_SECOND), "3.000 s after");
  EXPECT_PRED2(has, reason_of(Live::no, true, 5 * GST_MSECOND), "terrainstamp");
}

} // namespace
} // namespace terrainseg

int main(int argc, char** argv) {
  gst_init(&argc, &argv);
  testing::InitGoogleTest(&argc, argv);
  return RUN_ALL_TESTS();
}
