// SPDX-License-Identifier: LGPL-2.1-or-later
// What is measured: the filter in any setting, the unmodified algorithm, baselines that never look at the
// picture, and masks that something else wrote.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <opencv2/core.hpp>

#include "tools/eval/sequence.hpp"

namespace terrainseg::eval {

struct Answer {
  cv::Mat1b mask;                ///< 0, 128, 255; the picture's size
  std::optional<double> horizon; ///< share of the height, 0 = top
  bool knows_horizon = false;    ///< the engine has a horizon stage
  std::optional<int> confidence; ///< 0..255
  double milliseconds = 0;       ///< of the engine alone; 0 = not measured
};

class Engine {
 public:
  virtual ~Engine() = default;
  /// Frame `index` of the sequence, in order.
  virtual Answer look(const cv::Mat3b& picture, std::size_t index) = 0;
};

/// What engines() knows, for the usage text.
extern const char* const engine_help;

/// An engine for one pass over a sequence. `text` is default | paper | reference | rows[:R] | ramp |
/// mean-mask | masks:FOLDER; the filter takes settings behind it: "default,texture=false,caution=8".
/// Location-only baselines are fitted to the labels of the very sequence they are scored on: an upper bound
/// of what they can do. Throws std::runtime_error that names what is wrong.
std::unique_ptr<Engine> make_engine(const std::string& text, const Sequence& sequence,
                                    const std::vector<cv::Mat1b>& labels);

} // namespace terrainseg::eval
