// SPDX-License-Identifier: LGPL-2.1-or-later
#include "report.hpp"

namespace terrainseg::bench {

Report::Report(const std::string& json_path) {
  if (!json_path.empty()) {
    json_ = std::fopen(json_path.c_str(), "w");
    if (!json_)
      std::fprintf(stderr, "cannot write %s\n", json_path.c_str());
  }
  if (json_)
    std::fputs("[", json_);
}

Report::~Report() {
  if (json_) {
    std::fputs("\n]\n", json_);
    std::fclose(json_);
  }
}

void Report::add(const Row& r) {
  if (r.section != section_) {
    section_ = r.section;
    std::printf("\n%-58s %-6s %-10s %9s %9s  %9s %7s  %s\n", section_.c_str(), "format", "size", "ms",
                "p99 ms", "floor ms", "ratio", "goal");
  }
  const std::string size = r.width ? std::to_string(r.width) + "x" + std::to_string(r.height) : "";
  char goal[64] = "";
  if (r.limit > 0)
    std::snprintf(goal, sizeof goal, "<= %.4g %s", r.limit, r.ratio <= r.limit ? "met" : "MISSED");
  std::printf("%-58s %-6s %-10s %9.4f %9.4f  %9.4f %7.3f  %s\n", r.name.c_str(), r.format.c_str(),
              size.c_str(), r.ms, r.p99_ms, r.floor_ms, r.ratio, goal);
  std::fflush(stdout);
  if (!json_)
    return;
  std::fprintf(
      json_,
      "%s\n  {\"section\": \"%s\", \"name\": \"%s\", \"format\": \"%s\", \"width\": %d, \"height\": %d, "
      "\"ms\": %.6f, \"p99_ms\": %.6f, \"floor\": \"%s\", \"floor_ms\": %.6f, \"ratio\": %.5f, "
      "\"limit\": %.5g, \"met\": %s}",
      first_ ? "" : ",", r.section.c_str(), r.name.c_str(), r.format.c_str(), r.width, r.height, r.ms,
      r.p99_ms, r.floor.c_str(), r.floor_ms, r.ratio, r.limit,
      r.limit > 0 ? (r.ratio <= r.limit ? "true" : "false") : "null");
  std::fflush(json_);
  first_ = false;
}

} // namespace terrainseg::bench
