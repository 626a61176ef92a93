// SPDX-License-Identifier: LGPL-2.1-or-later
// Labelled sequences: on disk frames/NNNN.{png,jpg}, labels/NNNN.png, sequence.json; or rendered ones.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include <opencv2/core.hpp>

namespace terrainseg::eval {

/// Codes of a label picture.
enum Label : int { label_obstacle = 0, label_terrain = 1, label_ground = 2, label_sky = 3, label_none = 255 };

struct Sample {
  cv::Mat3b picture; ///< B G R, full range
  cv::Mat1b labels;  ///< Label; the picture's size
};

struct Sequence {
  std::string name, folder;
  double fps = 0;        ///< frames per second; 0 = unknown
  int window_bottom = 0; ///< rows of the frame to lift the training window by
  std::vector<std::string> frames, labels;
  std::function<Sample(std::size_t)> source; ///< of a rendered sequence; none = the files
  std::size_t size() const { return frames.size(); }
  /// Reads one frame with its labels. Throws std::runtime_error that names the file.
  Sample read(std::size_t index) const;
};

/// Lists a folder, or describes what rendered_sequence() knows. Throws std::runtime_error that names what is
/// missing. `limit` > 0 takes the first frames only.
Sequence open_sequence(const std::string& folder, int limit);

} // namespace terrainseg::eval
