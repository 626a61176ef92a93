// SPDX-License-Identifier: LGPL-2.1-or-later
// Shows the progress: a bar on a terminal, otherwise a plain line at intervals.
#pragma once

#include <unistd.h>

#include <cstdint>
#include <deque>
#include <string>
#include <utility>

namespace terrainseg::process {

/// The state of the run at one time.
struct Moment {
  int done = 0, inputs = 0; ///< finished inputs, all inputs
  std::string name;         ///< input in progress
  std::uint64_t frames = 0; ///< of the inputs in progress
  double fps = 0;           ///< frames per second over the last seconds
  int permille = -1;        ///< of the inputs in progress; -1 = unknown
  int whole_permille = -1;  ///< of the run without skipped inputs
  double seconds = 0;       ///< since the start of the run
};

/// Frames per second over the last seconds. The mean over the run would not show that inputs differ.
class Rate {
 public:
  double at(double seconds, std::uint64_t frames);

 private:
  std::deque<std::pair<double, std::uint64_t>> history_;
};

/// "m:ss" or "h:mm:ss".
std::string duration_text(double seconds);

/// A line of at most `columns` columns: name, bar, percentage, frames, frames per second, time left.
std::string bar_line(const Moment& moment, int columns);

/// The same without bar and length limit.
std::string plain_line(const Moment& moment);

/// Prints to stderr. Not thread-safe.
class Display {
 public:
  explicit Display(bool quiet) : quiet_(quiet), terminal_(isatty(STDERR_FILENO) == 1) {}
  ~Display() { clear(); }
  Display(const Display&) = delete;
  Display& operator=(const Display&) = delete;

  void show(const Moment& moment);                           ///< draws if the interval has passed
  void clear();                                              ///< removes the bar before other output
  double interval() const { return terminal_ ? 0.1 : 0.25; } ///< seconds between two useful calls of show()

 private:
  bool quiet_, terminal_;
  bool drawn_ = false;
  double next_plain_ = 0;
};

} // namespace terrainseg::process
