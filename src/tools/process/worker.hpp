// SPDX-License-Identifier: LGPL-2.1-or-later
// Processes one input with one pipeline: decoder -> terrainseg -> tee -> an encoder or writer per output.
// Inputs are decoded in worker processes: if a library crashes, only that input is lost. A worker processes
// one input after the other and is replaced when it crashes.
#pragma once

#include <sys/types.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "tools/process/inputs.hpp"
#include "tools/process/options.hpp"
#include "tools/process/outputs.hpp"

namespace terrainseg::process {

/// Tells how long a number has not changed. The time stands while the process is stopped (Ctrl-Z), so that a
/// limit does not expire at once when the process goes on. Asked by one thread, many times a second.
class Watch {
 public:
  using Clock = std::chrono::steady_clock;
  Clock::duration unchanged(std::uint64_t number) {
    const Clock::time_point at = Clock::now();
    unchanged_ += std::min<Clock::duration>(at - std::exchange(last_, at), most);
    if (std::exchange(number_, number) != number)
      unchanged_ = {};
    return unchanged_;
  }

 private:
  static constexpr std::chrono::seconds most{1}; ///< between two readings
  Clock::time_point last_ = Clock::now();
  Clock::duration unchanged_{};
  std::uint64_t number_ = 0;
};

/// Progress of an input: written by its pipeline, read by the display and by the worker's main thread.
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

/// The result of an input without outputs: failed or, by the fault's cause, interrupted.
Outcome failed(Record record, const Fault& fault);

/// First argument of the program for a worker; the second one is a socket.
inline constexpr const char* worker_option = "--worker";

/// A worker as the run sees it; used by one thread.
class Worker {
 public:
  /// `arguments` are those of the program.
  explicit Worker(std::vector<std::string> arguments) : arguments_(std::move(arguments)) {}
  ~Worker() { stop(); }
  Worker(const Worker&) = delete;
  Worker& operator=(const Worker&) = delete;

  /// Runs process() in the worker; in this process if none can be started.
  Outcome process(const Input& input, const Options& options, Progress& progress,
                  const std::atomic<int>& interrupted);

 private:
  bool start();
  std::optional<Outcome> ask(const Input& input, Progress& progress, const std::atomic<int>& interrupted);
  int stop();

  std::vector<std::string> arguments_;
  pid_t pid_ = -1; ///< -1: not running
  int socket_ = -1;
};

/// The worker's main loop: processes requests from the socket until the other end is closed. Never returns.
[[noreturn]] void serve(int socket, const Options& options);

/// Why an input failed whose worker ended with that status of waitpid(). `file`: whether it is a file, which
/// can be converted.
Fault loss_of(int status, bool file);

/// Messages of the socket: an Input or an Outcome. File names are bytes and may be invalid UTF-8.
template <typename Value> std::string packed(const Value& value);
template <typename Value> Value unpacked(const std::string& bytes);

} // namespace terrainseg::process
