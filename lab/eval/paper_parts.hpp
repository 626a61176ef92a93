// SPDX-License-Identifier: LGPL-2.1-or-later
// The experiments one by one. Each returns its part of the report as Markdown and leaves charts in `out`.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "lab/eval/sequence.hpp"

namespace terrainseg::eval {

struct Context {
  std::string data;                             ///< folder of sequences; empty = rendered scenes
  std::string out;                              ///< folder for charts
  Selection selection;                          ///< frames of each sequence
  std::function<void(const std::string&)> tell; ///< what is being done, for a person who waits
};

/// All sequences below the data folder, sets of stills left out; without one, rendered scenes. Things are not
/// counted in them.
std::vector<Sequence> paper_sequences(const std::string& data, const Selection& selection);

/// Different 1920x1080 pictures to measure speed on: photographs below `data`, else rendered.
std::vector<Picture> speed_pictures(const std::string& data);

std::string stage_times(const Context& context);     ///< Table 1
std::string error_rates(const Context& context);     ///< Table 2
std::string scale_and_shift(const Context& context); ///< figures 12 to 14
std::string training_pixels(const Context& context); ///< section 4.2, figure 11
std::string readings(const Context& context);        ///< how much each reading of the text matters

} // namespace terrainseg::eval
