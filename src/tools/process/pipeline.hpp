// SPDX-License-Identifier: LGPL-2.1-or-later
// Processes one input with one pipeline: decoder -> terrainseg -> tee -> an encoder or writer per output.
#pragma once

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstdint>

#include "tools/process/inputs.hpp"
#include "tools/process/options.hpp"
#include "tools/process/outputs.hpp"

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

/// Progress of an input: written by its pipeline, read by the display and by the worker's second thread.
struct Progress {
  std::atomic<std::uint64_t> frames{0};
  std::atomic<int> permille{-1}; ///< 0..1000; -1 = unknown length
  /// Grows while the pipeline answers; 0 while no call of GStreamer is pending. Starting and stopping a
  /// pipeline wait for its elements and have no time limit of their own.
  std::atomic<std::uint64_t> answers{0};
};

/// Processes an input and writes its outputs, or their partial variants if the input is damaged.
/// Blocks until done. May be called in several threads. `interrupted` stops it early.
Outcome process(const Input& input, const Options& options, Progress& progress,
                const std::atomic<int>& interrupted);

} // namespace terrainseg::process
