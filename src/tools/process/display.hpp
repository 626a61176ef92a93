// SPDX-License-Identifier: LGPL-2.1-or-later
// What the user sees while it runs: a bar on a terminal, a plain line now and then elsewhere.
#pragma once

#include <cstdint>
#include <deque>
#include <string>
#include <utility>

namespace terrainseg::process {

/// The state of the whole run at one moment.
struct Moment {
  int done = 0, inputs = 0; ///< inputs finished, and all
  std::string name;         ///< what is being worked on
  std::uint64_t frames = 0; ///< of the inputs being worked on
  double fps = 0;           ///< frames a second lately
  int permille = -1;        ///< of the inputs being worked on; -1 = unknown
  int whole_permille = -1;  ///< of the run, skipped inputs left out
  double seconds = 0;       ///< since the run began
};

/// Frames a second over the last seconds: inputs differ, and so an average over the run would tell little.
class Rate {
 public:
  double at(double seconds, std::uint64_t frames);

 private:
  std::deque<std::pair<double, std::uint64_t>> history_;
};

/// "m:ss" or "h:mm:ss".
std::string duration_text(double seconds);

/// One line, at most `columns` wide: name, bar, percent, frames, frames per second, time left.
std::string bar_line(const Moment& moment, int columns);

/// The same without a bar and without a limit.
std::string plain_line(const Moment& moment);

/// Prints to stderr; one thread at a time.
class Display {
 public:
  explicit Display(bool quiet);
  ~Display();
  Display(const Display&) = delete;
  Display& operator=(const Display&) = delete;

  void show(const Moment& moment); ///< draws when it is time to
  void clear();                    ///< takes the bar away, before other output
  double interval() const;         ///< seconds between two calls of show() that make sense

 private:
  bool quiet_, terminal_;
  bool drawn_ = false;
  double next_plain_ = 0;
};

} // namespace terrainseg::process
