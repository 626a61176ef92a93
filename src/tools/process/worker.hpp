// SPDX-License-Identifier: LGPL-2.1-or-later
// Inputs are decoded in a process of their own: libraries that crash on a file take that input with them, and
// not the run. A process serves one input after the other, and is replaced when it is lost.
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

/// The first argument of the program when it works for another of its kind; the second is a socket.
inline constexpr const char* worker_option = "--worker";

/// The side of the run; belongs to one of its threads.
class Worker {
 public:
  /// `arguments` are those that the program was started with.
  explicit Worker(std::vector<std::string> arguments) : arguments_(std::move(arguments)) {}
  ~Worker();
  Worker(const Worker&) = delete;
  Worker& operator=(const Worker&) = delete;

  /// process() of pipeline.hpp in the other process. Where none can be started the work is done in this one.
  Outcome process(const Input& input, const Naming& naming, const Options& options, Progress& progress,
                  const std::atomic<int>& interrupted);

 private:
  bool start();
  std::optional<Outcome> ask(const Input& input, Progress& progress, const std::atomic<int>& interrupted);
  int stop();

  std::vector<std::string> arguments_;
  pid_t pid_ = -1; ///< -1: there is none
  int socket_ = -1;
};

/// The side of the worker: serves what comes through the socket until its other end is closed. Never returns.
[[noreturn]] void serve(int socket, const Options& options);

/// Why an input is lost whose process ended with that status of waitpid(); `file`: it is one, which can be
/// converted.
struct Loss {
  Cause cause = Cause::none;
  std::string text;
};
Loss loss_of(int status, bool file);

/// What goes through the socket. File names are bytes, and need be no UTF-8.
std::string packed(const Input& input);
std::string packed(const Outcome& outcome);
Input unpacked_input(const std::string& bytes);
Outcome unpacked_outcome(const std::string& bytes);

} // namespace terrainseg::process
