// SPDX-License-Identifier: LGPL-2.1-or-later
// The experiments one by one. Each returns its part of the report as Markdown and leaves charts in `out`.
#pragma once

#include <functional>
#include <string>

namespace terrainseg::experiments {

struct Context {
  std::string data;                             ///< folder of sequences; empty = rendered scenes
  std::string out;                              ///< folder for charts
  int limit = 0;                                ///< shots per sequence, 0 = all
  std::function<void(const std::string&)> tell; ///< what is being done, for a person who waits
};

std::string stage_times(const Context& context);     ///< Table 1
std::string error_rates(const Context& context);     ///< Table 2
std::string scale_and_shift(const Context& context); ///< figures 12 to 14
std::string training_pixels(const Context& context); ///< section 4.2, figure 11
std::string readings(const Context& context);        ///< how much each reading of the text matters

} // namespace terrainseg::experiments
