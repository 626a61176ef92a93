// SPDX-License-Identifier: LGPL-2.1-or-later
// Labelled sequences and stills: on disk frames/NNNN.{png,jpg}, labels/NNNN.png, sequence.json; or rendered
// ones.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include <opencv2/core.hpp>

#include "lab/eval/picture.hpp"

namespace terrainseg::eval {

/// Codes of a label picture.
enum Label : int { label_obstacle = 0, label_terrain = 1, label_ground = 2, label_sky = 3, label_none = 255 };

struct Sample {
  Picture picture;
  cv::Mat1b labels;  ///< Label; the picture's size
  cv::Mat1w depth{}; ///< millimetres, 0 = none; empty where there is no range sensor
};

struct Sequence {
  std::string name, folder;
  std::string kind;      ///< of place, for --leave-out; empty = not stated
  double fps = 0;        ///< frames per second; 0 = unknown
  int window_bottom = 0; ///< rows of the frame to lift the training window by
  /// Of the ground's vanishing line, fractions of the height: one for all frames or one each; empty =
  /// unknown.
  std::vector<double> horizon;
  bool free = false;       ///< its pictures may be published
  bool stills = false;     ///< each frame is a place of its own
  std::size_t run = 0;     ///< frames after which everything is forgotten; 0 = never
  std::size_t warm_up = 0; ///< first frames of each run that are shown and not scored
  int repeat = 1;          ///< how often each frame is shown; the last mask is scored
  int things_every = 1;    ///< things are counted in every so-manyth scored frame; 0 = never
  std::vector<std::string> frames, labels;
  std::function<Sample(std::size_t)> source; ///< of a rendered sequence; none = the files
  std::size_t size() const { return frames.size(); }
  std::size_t run_length() const { return run > 0 ? run : size(); }
  bool is_scored(std::size_t index) const { return index % run_length() >= warm_up; }
  /// Reads one frame with its labels. Throws std::runtime_error that names the file.
  Sample read(std::size_t index) const;
};

/// Which frames of a sequence are taken.
struct Selection {
  int limit = 0; ///< the first frames only; 0 = all
  int every = 1; ///< every so-manyth frame only
};

/// Lists a folder, or describes what rendered_sequence() knows. Throws std::runtime_error that names what is
/// missing.
Sequence open_sequence(const std::string& folder, const Selection& selection = {});

/// The sequences in the subfolders of `folder`, by name; sets of stills are left out. Throws
/// std::runtime_error when there are none.
std::vector<Sequence> sequences_in(const std::string& folder, const Selection& selection = {});

} // namespace terrainseg::eval
