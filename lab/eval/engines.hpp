// SPDX-License-Identifier: LGPL-2.1-or-later
// What is measured: the filter in any setting, the unmodified algorithm, baselines that never look at the
// picture, and masks that something else wrote.
#pragma once

#include <iosfwd>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <opencv2/core.hpp>

#include "lab/eval/sequence.hpp"
#include "terrainseg/settings.hpp"

namespace terrainseg::eval {

struct Answer {
  cv::Mat1b mask;                ///< 0, 128, 255; the picture's size
  std::optional<double> horizon; ///< share of the height, 0 = top
  bool knows_horizon = false;    ///< the engine has a horizon stage
  std::optional<int> confidence; ///< 0..255
  double milliseconds = 0;       ///< processor time of the engine in the calling thread; 0 = not measured
  cv::Mat1b confidence_map{};    ///< 0..255 for each cell of the grid; empty where the engine tells none
};

class Engine {
 public:
  virtual ~Engine() = default;
  /// Frame `index` of the sequence, in order. `training` (128 and above = learn from here; the picture's
  /// size) stands in for the window of an engine that learns when it is not empty.
  virtual Answer look(const Picture& picture, std::size_t index, const cv::Mat1b& training) = 0;
  Answer look(const Picture& picture, std::size_t index) { return look(picture, index, {}); }
  /// Everything that was seen so far is forgotten.
  virtual void forget() {}
};

/// What engines() knows, for the usage text.
extern const char* const engine_help;

/// What `default|paper[,SETTING=VALUE...]` says; throws std::runtime_error that names what is wrong. The
/// sequence's `window_bottom` holds unless the text sets it.
Settings filter_settings(const std::string& text, int window_bottom);

/// Sets the tuned constants of the core as `tuning.NAME=VALUE` in an engine's text says, all others as the
/// source has them. While no frame is processed: they are the whole program's. Throws std::runtime_error.
void tune(const std::string& text);
/// Prints the name and the value of every tuned constant.
void list_tuning(std::ostream& out);

/// An engine for one pass over a sequence. `text` is default | paper | reference | rows[:R] | ramp |
/// mean-mask | masks:FOLDER; the filter takes settings behind it: "default,texture=false,caution=8".
/// Location-only baselines are fitted to the labels of the very sequence they are scored on: an upper bound
/// of what they can do. Throws std::runtime_error that names what is wrong.
std::unique_ptr<Engine> make_engine(const std::string& text, const Sequence& sequence,
                                    const std::vector<cv::Mat1b>& labels);

/// The filter with settings of one's own, given I420 as decoders leave it, or BGR, what `videoconvert` makes
/// of that. Throws std::runtime_error when the settings contradict themselves.
/// With `posed` it is told where rendered pictures have the ground's vanishing line, as a pose tells it.
std::unique_ptr<Engine> make_filter(const Settings& settings, double fps,
                                    PixelFormat input = PixelFormat::I420, bool posed = false);
/// The unmodified algorithm.
std::unique_ptr<Engine> make_reference(int window_bottom);

} // namespace terrainseg::eval
