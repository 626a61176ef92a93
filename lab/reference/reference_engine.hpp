// SPDX-License-Identifier: LGPL-2.1-or-later
// The unmodified algorithm (the paper's reference [7], Dahlkamp et al. 2006): full resolution, doubles, full
// covariances. It is what the paper compares itself with, for tools, tests and the element
// `terrainreference`; docs/paper.md says what is known of the original and what is assumed here.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include <opencv2/core.hpp>

#include "lab/reference/clusters.hpp"
#include "lab/reference/mixture.hpp"
#include "lab/reference/scoring.hpp"
#include "lab/reference/training_pixels.hpp"

namespace terrainseg::reference {

struct ReferenceSettings {
  WindowPlace window;
  double window_sigma =
      0; ///< pre-filter of the window, standard deviations; 0 = off: the original had a laser
  int training_models = 3;    ///< k, 1..255
  int learned_models = 5;     ///< n, above k
  double match_threshold = 1; ///< equation (13), squared distance
  int mass_cap = 64;          ///< frames of this frame's training pixels
  double mass_share = 0.3;    ///< only models above this share of the heaviest one score
  double threshold = 3;       ///< standard deviations
  double variance_floor =
      16; ///< added to every diagonal entry: a cluster of one colour stays invertible; the paper preset's
  int dilations = 1, erosions = 2;
  bool connected = true;        ///< keep only what is connected to the training pixels
  int min_training_pixels = 16; ///< per training model; below it nothing is learned
  int max_iterations = 20;      ///< of k-means
  std::uint32_t seed = 1;
  bool learning = true;
};

enum class ReferenceStage : std::uint8_t { training_pixels, clustering, update, scoring, clean_up };
inline constexpr int reference_stage_count = 5;
const char* name_of(ReferenceStage stage);

struct ReferenceResult {
  cv::Mat mask;     ///< CV_8UC1, the frame's size: 0 not, 255 terrain; 128 everywhere while nothing is known
  cv::Mat training; ///< CV_8UC1, 255 = a training pixel of this frame
  cv::Rect window;  ///< the training window; empty when a mask stood in for it
  std::vector<Gaussian> models;   ///< all slots, null ones included
  std::vector<Gaussian> clusters; ///< this frame's training models; empty when nothing was learned
  bool learned = false;           ///< this frame was learned from
  bool starved = false;           ///< too few training pixels
  std::array<std::int64_t, reference_stage_count> stage_times{}; ///< nanoseconds
};

class ReferenceEngine {
 public:
  /// Throws std::invalid_argument when the settings contradict themselves.
  explicit ReferenceEngine(const ReferenceSettings& settings = {});

  /// Learns from one frame (CV_8UC3, B G R) and labels it. `training` (CV_8UC1, the frame's size, 128 and
  /// above = trains) stands in for the window when it is not empty. The result is valid until the next call.
  /// Throws std::invalid_argument for another type or size of picture.
  const ReferenceResult& process(const cv::Mat& bgr, const cv::Mat& training = {});

  const ReferenceResult& result() const { return result_; }
  const ReferenceSettings& settings() const { return settings_; }
  /// Takes other settings, with the constructor's checks. The models stay unless their number changes.
  void configure(const ReferenceSettings& settings);
  void reset(); ///< forgets everything

 private:
  ReferenceSettings settings_;
  Mixture mixture_;
  TrainingColors colors_;
  CleanUp clean_up_;
  ReferenceResult result_;
};

} // namespace terrainseg::reference
