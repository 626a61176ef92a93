// SPDX-License-Identifier: LGPL-2.1-or-later
// Times several pieces of work in one loop, in turn, so that what disturbs one disturbs all: figures are
// ratios of medians of the same run. (Google Benchmark times one thing after the other.)
#pragma once

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <ctime>
#include <functional>
#include <vector>

namespace terrainseg::bench {

using Clock = std::chrono::steady_clock;

/// Processor time of this program, all its threads, leaves out what other programs on the machine take. Where
/// several threads work, or the worst frames matter, the clock on the wall counts.
enum class Count { processor_time, wall_time };

inline std::int64_t now(Count count) {
  timespec t;
  clock_gettime(count == Count::processor_time ? CLOCK_PROCESS_CPUTIME_ID : CLOCK_MONOTONIC, &t);
  return std::int64_t{t.tv_sec} * 1000000000 + t.tv_nsec;
}

/// Times of one piece of work, in nanoseconds.
class Times {
 public:
  void add(std::int64_t nanoseconds) { all_.push_back(nanoseconds); }
  /// The value that `permille` of the times do not exceed.
  double quantile(int permille) const {
    std::vector<std::int64_t> sorted = all_;
    const auto at = sorted.begin() + static_cast<std::ptrdiff_t>((sorted.size() - 1) * permille / 1000);
    std::nth_element(sorted.begin(), at, sorted.end());
    return static_cast<double>(*at);
  }
  double median() const { return quantile(500); }
  double p99() const { return quantile(990); }
  std::size_t count() const { return all_.size(); }

 private:
  std::vector<std::int64_t> all_;
};

struct Budget {
  int least_rounds = 15;
  int most_rounds = 400;
  std::chrono::milliseconds time{1500};
  Count count = Count::processor_time;
};

/// Runs each lane once a round, lane(round), until the budget is spent; the first rounds do not count. The
/// order turns with the round, so that no lane is always the first.
inline std::vector<Times> run_lanes(const std::vector<std::function<void(int)>>& lanes,
                                    const Budget& budget) {
  std::vector<Times> times(lanes.size());
  constexpr int warm_up = 3;
  const auto begin = Clock::now();
  for (int round = 0; round < budget.most_rounds + warm_up; ++round) {
    if (round >= budget.least_rounds + warm_up && Clock::now() - begin > budget.time)
      break;
    for (std::size_t i = 0; i < lanes.size(); ++i) {
      const std::size_t lane = (i + static_cast<std::size_t>(round)) % lanes.size();
      const std::int64_t start = now(budget.count);
      lanes[lane](round);
      const std::int64_t taken = now(budget.count) - start;
      if (round >= warm_up)
        times[lane].add(taken);
    }
  }
  return times;
}

} // namespace terrainseg::bench
