// SPDX-License-Identifier: LGPL-2.1-or-later
#include "exchange/json_lines.hpp"

namespace terrainseg {

void append_json_line(std::string& out, const Estimate& estimate, std::int64_t pts, bool) {
  out += "{\"frame\": " + std::to_string(estimate.frame) + ", \"pts\": " + std::to_string(pts) + "}\n";
}

} // namespace terrainseg
