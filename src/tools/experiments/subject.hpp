// SPDX-License-Identifier: LGPL-2.1-or-later
// What labels a shot in an experiment, and how right it was.
#pragma once

#include <memory>

#include <opencv2/core.hpp>

#include "reference/paper_reading.hpp"
#include "reference/reference_engine.hpp"
#include "terrainseg/segmenter.hpp"
#include "tools/experiments/material.hpp"

namespace terrainseg::experiments {

class Subject {
 public:
  virtual ~Subject() = default;
  /// Shots come in order. `training` (CV_8UC1, may be empty) stands in for the window. The mask is valid
  /// until the next call.
  virtual cv::Mat label(const Shot& shot, const cv::Mat& training) = 0;
  cv::Mat label(const Shot& shot) { return label(shot, {}); }
  virtual int horizon_row() const { return -1; }
};

/// How a picture is given to the filter: as the three planes of B G R, or as 4:2:0 as cameras and decoders
/// give it.
enum class Input { bgr, i420 };

std::unique_ptr<Subject> filter_subject(const Settings& settings, Input input, double fps);
std::unique_ptr<Subject> reference_subject(const reference::ReferenceSettings& settings);
std::unique_ptr<Subject> reading_subject(const reference::Readings& readings);
/// Everything below `row` (a fraction of the height) is ground.
std::unique_ptr<Subject> row_subject(double row);

/// A picture in the layout of `input`; keeps its memory.
class FramePicture {
 public:
  const Frame& set(const cv::Mat& bgr, Input input);

 private:
  cv::Mat bgr_, i420_;
  Frame frame_;
};

/// Pixels of labelled ground (labels 1 and 2) against what was said; doubtful counts as not traversable.
struct Score {
  double wrong = 0, known = 0, unsafe = 0, near_obstacles = 0;
  void add(const cv::Mat& mask, const cv::Mat& labels);
  double error() const { return known > 0 ? 100 * wrong / known : 0; } ///< percent of the labelled pixels
  /// Percent of the obstacle pixels in the bottom third that are called traversable.
  double unsafe_share() const { return near_obstacles > 0 ? 100 * unsafe / near_obstacles : 0; }
};

/// First row in which at least 2 % of the columns are ground; -1 = none.
int true_horizon(const cv::Mat& labels);

} // namespace terrainseg::experiments
