// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <string>
#include <vector>

namespace terrainseg::experiments {

struct Arguments {
  std::string data, out = "paper";
  std::vector<std::string> only;
  int limit = 0;
};

/// Throws UsageError.
Arguments parse(const std::vector<std::string>& words, bool parts_allowed);

} // namespace terrainseg::experiments
