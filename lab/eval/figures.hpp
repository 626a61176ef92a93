// SPDX-License-Identifier: LGPL-2.1-or-later
// How right a sequence of masks is.
#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "lab/eval/engines.hpp"
#include "lab/eval/sequence.hpp"
#include "lab/eval/statistics.hpp"
#include "lab/eval/things.hpp"

namespace terrainseg::eval {

/// Pixels of one frame, or pooled.
struct Counts {
  long long true_ground = 0, false_ground = 0, missed_ground = 0, true_rest = 0;
  long long unsafe = 0, near_obstacles = 0; ///< obstacle pixels in the bottom third: called ground, and all
  Counts& operator+=(const Counts& other);
  long long known() const { return true_ground + false_ground + missed_ground + true_rest; }
  double error() const;     ///< percent of the labelled pixels that are wrong
  double iou() const;       ///< percent
  double precision() const; ///< percent
  double recall() const;    ///< percent
  double f_measure() const; ///< percent
  double
  unsafe_share() const; ///< percent of the obstacle pixels in the bottom third that are called traversable
  double false_safe_share() const; ///< percent of all pixels that are no ground and called traversable
};

/// Pixels of labelled ground against what a mask says; doubtful counts as not traversable. Both are of one
/// size, or std::runtime_error is thrown.
Counts count_pixels(const cv::Mat1b& mask, const cv::Mat1b& labels);

/// Cells of the grid by what the confidence map says of them, and how many of them have the right label.
struct Sureness {
  static constexpr std::size_t steps = 8;
  static constexpr std::array<int, steps + 1> from{0, 1, 64, 128, 160, 192, 216, 236, 256};
  std::array<long long, steps> cells{}, right{};
  Sureness& operator+=(const Sureness& other);
  long long all() const;
};

/// A cell's label is that of its first pixel in `mask`, and right where `labels` has the same; cells without
/// a label do not count.
Sureness count_cells(const cv::Mat1b& confidence_map, const cv::Mat1b& mask, const cv::Mat1b& labels);

struct FrameFigures {
  double error = 0, terrain = 0; ///< percent; terrain leaves label 2 out
  double other = 0;  ///< percent of the labelled pixels that are label 2 and not called traversable
  double unsafe = 0; ///< percent
  std::optional<double> horizon; ///< percent of the height off
  int confidence = -1;
  std::size_t index = 0;
};

struct Figures {
  std::string sequence, engine, input = "as it is";
  std::string kind; ///< of place, as sequence.json states it; may be empty
  int width = 0, height = 0;
  Counts ground;             ///< positive = labels 1 and 2
  Counts terrain;            ///< positive = label 1; label 2 ignored
  Counts without_doubt_zone; ///< as ground, but doubtful counts as traversable
  Things things;
  Sureness sureness;                  ///< no cells where the engine tells none
  bool stills = false;                ///< each frame is a place of its own
  std::optional<double> best_ramp;    ///< mean error of the best straight boundary; of stills only
  std::optional<Spread> horizon;      ///< |row - truth|, percent of the height
  std::optional<double> horizon_null; ///< percent of the frames with a horizon that got none
  std::optional<double>
      boundary_within; ///< percent of the columns whose boundary lies within 2 % of the height
  std::optional<double> boundary_over;   ///< percent of the columns that reach more than 2 % beyond it
  std::optional<double> flicker;         ///< percent of the pixels that change from frame to frame
  std::optional<Spread> frame_error;     ///< of the frames, percent
  std::optional<double> confidence_rank; ///< Spearman, confidence against error
  std::optional<Spread> latency;         ///< milliseconds
  std::vector<FrameFigures> frames;
  double mean_error() const;         ///< percent, mean over the frames
  double mean_terrain_error() const; ///< the same without label 2
  double mean_other_missed() const;  ///< mean of FrameFigures::other
};

/// How well the confidence finds the frames of some runs that are wrong by more than `error` percent: the
/// probability that such a frame has less of it than another one (area under the ROC curve). Each run counts
/// the same. None where all frames are of one kind, or have no confidence.
std::optional<double> found_by_confidence(const std::vector<const Figures*>& runs, double error);

/// Collects one pass.
class Scorer {
 public:
  Scorer(std::string sequence, std::string engine, std::string input);
  /// Scores frame `index` of the sequence; counting its things takes longer than all else.
  void add(const Answer& answer, const cv::Mat1b& labels, std::size_t index, bool with_things = true);
  /// Adds what another one collected of frames behind these; nothing flickers between the two.
  void join(Scorer&& later);
  Figures finish();

 private:
  Figures figures_;
  std::vector<double> horizons_, latencies_, flicker_;
  long long frames_with_horizon_ = 0, nulls_ = 0;
  bool knows_horizon_ = false;
  long long columns_ = 0, columns_within_ = 0, columns_over_ = 0;
  cv::Mat1b previous_;
};

/// First row in which at least 2 % of the columns are ground; -1 = none.
int true_horizon(const cv::Mat1b& labels);

} // namespace terrainseg::eval
