// SPDX-License-Identifier: LGPL-2.1-or-later
// Time that passes for this process.
#pragma once

#include <algorithm>
#include <chrono>

namespace terrainseg::process {

/// A clock for time limits. It stands while the process is stopped (Ctrl-Z), so that a limit does not expire
/// at once when the process goes on. Read by one thread, many times a second.
class RunningClock {
 public:
  using Clock = std::chrono::steady_clock;
  /// Since the construction.
  Clock::duration now() {
    const Clock::time_point at = Clock::now();
    time_ += std::min<Clock::duration>(at - last_, most);
    last_ = at;
    return time_;
  }

 private:
  static constexpr std::chrono::seconds most{1}; ///< between two readings
  Clock::time_point last_ = Clock::now();
  Clock::duration time_{};
};

} // namespace terrainseg::process
