// SPDX-License-Identifier: LGPL-2.1-or-later
// What a benchmark found, as a table for people and as JSON for programs.
#pragma once

#include <cstdio>
#include <string>
#include <vector>

namespace terrainseg::bench {

struct Row {
  std::string section; ///< "goal", "formats", "stages", ...
  std::string name;
  std::string format;
  int width = 0, height = 0;
  double ms = 0, p99_ms = 0; ///< median and 99th percentile of what is measured
  std::string floor;         ///< what it is compared with
  double floor_ms = 0;       ///< median of that, in the same loop
  double ratio = 0;          ///< ms / floor_ms, or what the name says
  double limit = 0;          ///< the goal for the ratio, 0 = none
};

class Report {
 public:
  explicit Report(const std::string& json_path);
  ~Report();
  Report(const Report&) = delete;
  Report& operator=(const Report&) = delete;
  /// Prints one line at once, so that a long run shows where it is.
  void add(const Row& row);

 private:
  std::FILE* json_ = nullptr;
  std::string section_;
  bool first_ = true;
};

} // namespace terrainseg::bench
