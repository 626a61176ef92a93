// SPDX-License-Identifier: LGPL-2.1-or-later
// The paper's own pipeline transcribed in doubles, with every place at which the text is ambiguous or wrong
// as a switch. It measures how much each reading matters (docs/paper.md); the filter itself implements one
// reading only and has no such switches. Written apart from the filter's core: it is an oracle of its paper
// preset too.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include <opencv2/core.hpp>

namespace terrainseg::reference {

/// What "randomly initialised" centres are drawn from.
enum class CentreRule : std::uint8_t { samples, color_cube };
/// Equation (11) when rows tie, and whether a null horizon exists.
enum class HorizonRule : std::uint8_t {
  off,
  first_minimum,  ///< as printed: the first of the rows that tie
  lowest_minimum, ///< the lowest of them
  lowest_or_null, ///< the same, null when no row is clearly poorer or the window is as poor
  flipped,        ///< lowest_or_null with equation (12) as printed: terrain is kept above the row
};
enum class MatchRule : std::uint8_t { nearest, first };
/// What a value of the shifted sub-space stands for.
enum class BinRule : std::uint8_t { centre, lower_edge };

/// The defaults are the readings of the filter's paper preset.
struct Readings {
  int levels = 5;
  int bit_shift = 3;
  int window_bottom = 0;
  bool upright_window = false; ///< 64 wide and 128 high instead of 128 wide and 64 high, in its proportion
  double window_sigma = 1;     ///< 0 = no pre-filter
  bool keep_half = true;       ///< the pre-filter never keeps fewer than half
  bool finer_when_few = true;  ///< trains at a finer level when fewer than 16 samples x K are left
  int training_models = 3, learned_models = 5;
  int max_iterations = 8;
  CentreRule centres = CentreRule::samples;
  double variance_floor = 16;
  bool quantisation_variance = true; ///< adds 2^(2b) / 12 to the floor
  BinRule bins = BinRule::centre;
  double match_threshold = 1;
  MatchRule match = MatchRule::nearest;
  double mass_cap = 64; ///< frames of samples; 0 = off
  HorizonRule horizon = HorizonRule::lowest_or_null;
  bool horizon_by_variance = false;     ///< equation (10) as printed: 2 sigma^2 instead of 2 sigma
  double horizon_floor = 16 + 1.0 / 12; ///< least variance of the ground in equation (10)
  double threshold = 3;
  std::uint32_t seed = 1;
};

class PaperReading {
 public:
  explicit PaperReading(const Readings& readings) : readings_(readings) {}

  /// Learns from one frame (CV_8UC3) and labels it: CV_8UC1 of its size, 0 or 255, 128 while nothing is
  /// known.
  const cv::Mat& process(const cv::Mat& bgr);
  const cv::Mat& mask() const { return mask_; }        ///< of the last frame
  int horizon_row() const { return horizon_row_; }     ///< of the last frame, in its rows; -1 = null or off
  int live_clusters() const { return live_clusters_; } ///< of the last frame

 private:
  struct Model {
    cv::Vec3d mean, variance;
    double mass = 0;
  };
  using Colors = std::vector<cv::Vec3d>;

  Colors training_samples(const std::vector<cv::Mat>& pyramid, cv::Vec3d& mean, cv::Vec3d& variance) const;
  std::vector<Model> cluster(const Colors& samples) const;
  void learn(const std::vector<Model>& training, double cap);
  int find_horizon(const cv::Mat& coarse, const cv::Vec3d& mean, const cv::Vec3d& variance, int window_top,
                   int window_end) const;
  void label(const cv::Mat& bgr);

  Readings readings_;
  std::vector<Model> learned_;
  cv::Mat mask_;
  int horizon_row_ = -1, live_clusters_ = 0;
};

} // namespace terrainseg::reference
