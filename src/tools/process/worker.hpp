// SPDX-License-Identifier: LGPL-2.1-or-later
// Inputs are decoded in worker processes: if a library crashes, only that input is lost. A worker processes
// one input after the other and is replaced when it crashes.
#pragma once

#include <sys/types.h>

#include <atomic>
#include <optional>
#include <string>
#include <vector>

#include "tools/process/inputs.hpp"
#include "tools/process/options.hpp"
#include "tools/process/outputs.hpp"
#include "tools/process/pipeline.hpp"

namespace terrainseg::process {

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

  /// Runs process() of pipeline.hpp in the worker; in this process if none can be started.
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
