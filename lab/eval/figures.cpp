// SPDX-License-Identifier: LGPL-2.1-or-later
#include "lab/eval/figures.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <stdexcept>

#include "terrainseg/frame.hpp"

namespace terrainseg::eval {
namespace {

constexpr int traversable_from = 192; // 128 = doubtful
constexpr double column_tolerance = 0.02;

double percent(long long part, long long whole) {
  return whole > 0 ? 100.0 * static_cast<double>(part) / static_cast<double>(whole) : 0;
}

bool is_ground(int label) {
  return label == label_terrain || label == label_ground;
}

Counts count(const cv::Mat1b& mask, const cv::Mat1b& labels, bool only_terrain, int from) {
  if (mask.size() != labels.size())
    throw std::runtime_error("a mask and its labels differ in size");
  Counts c;
  const int third = 2 * labels.rows / 3;
  for (int y = 0; y < labels.rows; ++y) {
    const std::uint8_t *l = labels[y], *m = mask[y];
    for (int x = 0; x < labels.cols; ++x) {
      if (l[x] == label_none || (only_terrain && l[x] == label_ground))
        continue;
      const bool truth = is_ground(l[x]), said = m[x] >= from;
      ++(truth ? said ? c.true_ground : c.missed_ground : said ? c.false_ground : c.true_rest);
      if (l[x] == label_obstacle && y >= third) {
        ++c.near_obstacles;
        c.unsafe += said;
      }
    }
  }
  return c;
}

/// The highest row of the run of ground that starts at a column's lowest labelled pixel; `rows` = none, -1 =
/// the column says nothing. Pixels without a label neither break nor lengthen the run.
template <class IsGround> int run_top(const cv::Mat1b& labels, int x, const IsGround& is_free) {
  int top = -1;
  for (int y = labels.rows - 1; y >= 0; --y) {
    if (labels(y, x) == label_none)
      continue;
    if (!is_free(y))
      return top < 0 ? labels.rows : top;
    top = y;
  }
  return top;
}

double mean_of(const std::vector<FrameFigures>& frames, double FrameFigures::*figure) {
  double sum = 0;
  for (const FrameFigures& f : frames)
    sum += f.*figure;
  return frames.empty() ? 0 : sum / static_cast<double>(frames.size());
}

} // namespace

Counts& Counts::operator+=(const Counts& o) {
  true_ground += o.true_ground;
  false_ground += o.false_ground;
  missed_ground += o.missed_ground;
  true_rest += o.true_rest;
  unsafe += o.unsafe;
  near_obstacles += o.near_obstacles;
  return *this;
}

Sureness& Sureness::operator+=(const Sureness& o) {
  for (std::size_t i = 0; i < steps; ++i) {
    cells[i] += o.cells[i];
    right[i] += o.right[i];
  }
  return *this;
}

long long Sureness::all() const {
  return std::accumulate(cells.begin(), cells.end(), 0ll);
}

Sureness count_cells(const cv::Mat1b& confidence_map, const cv::Mat1b& mask, const cv::Mat1b& labels) {
  int level = 0;
  while (confidence_map.cols < subsampled(labels.cols, level))
    ++level;
  if (mask.size() != labels.size() || confidence_map.cols != subsampled(labels.cols, level) ||
      confidence_map.rows != subsampled(labels.rows, level))
    throw std::runtime_error("a confidence map, its mask and its labels do not belong together");
  Sureness s;
  for (int i = 0; i < confidence_map.rows; ++i)
    for (int j = 0; j < confidence_map.cols; ++j) {
      const int x = std::min(j << level, labels.cols - 1), y = std::min(i << level, labels.rows - 1);
      if (labels(y, x) == label_none)
        continue;
      const auto next = std::upper_bound(Sureness::from.begin(), Sureness::from.end(), confidence_map(i, j));
      const auto step = static_cast<std::size_t>(next - Sureness::from.begin()) - 1;
      ++s.cells[step];
      s.right[step] += is_ground(labels(y, x)) == (mask(y, x) >= traversable_from);
    }
  return s;
}

double Counts::error() const {
  return percent(false_ground + missed_ground, known());
}
double Counts::iou() const {
  return percent(true_ground, true_ground + false_ground + missed_ground);
}
double Counts::precision() const {
  return percent(true_ground, true_ground + false_ground);
}
double Counts::recall() const {
  return percent(true_ground, true_ground + missed_ground);
}
double Counts::f_measure() const {
  return percent(2 * true_ground, 2 * true_ground + false_ground + missed_ground);
}
double Counts::unsafe_share() const {
  return percent(unsafe, near_obstacles);
}
double Counts::false_safe_share() const {
  return percent(false_ground, false_ground + true_rest);
}

int true_horizon(const cv::Mat1b& labels) {
  for (int y = 0; y < labels.rows; ++y)
    if (50 * std::count_if(labels[y], labels[y] + labels.cols, is_ground) >= labels.cols)
      return y;
  return -1;
}

Counts count_pixels(const cv::Mat1b& mask, const cv::Mat1b& labels) {
  return count(mask, labels, false, traversable_from);
}

std::optional<double> found_by_confidence(const std::vector<const Figures*>& runs, double error) {
  // By value of the confidence, the weights of wrong frames and of the others.
  std::array<double, 256> wrong{}, others{};
  for (const Figures* run : runs)
    for (const FrameFigures& frame : run->frames)
      if (frame.confidence >= 0)
        (frame.error > error ? wrong : others)[static_cast<std::size_t>(std::min(frame.confidence, 255))] +=
            1 / static_cast<double>(run->frames.size());
  const double all_wrong = std::accumulate(wrong.begin(), wrong.end(), 0.0),
               all_others = std::accumulate(others.begin(), others.end(), 0.0);
  if (all_wrong == 0 || all_others == 0)
    return std::nullopt;
  double below = 0, found = 0;
  for (std::size_t c = 0; c < wrong.size(); ++c) {
    found += wrong[c] * (all_others - below - others[c] / 2);
    below += others[c];
  }
  return found / (all_wrong * all_others);
}

Scorer::Scorer(std::string sequence, std::string engine, std::string input) {
  figures_.sequence = std::move(sequence);
  figures_.engine = std::move(engine);
  figures_.input = std::move(input);
}

double Figures::mean_error() const {
  return mean_of(frames, &FrameFigures::error);
}
double Figures::mean_terrain_error() const {
  return mean_of(frames, &FrameFigures::terrain);
}
double Figures::mean_other_missed() const {
  return mean_of(frames, &FrameFigures::other);
}

void Scorer::add(const Answer& answer, const cv::Mat1b& labels, std::size_t index, bool with_things) {
  const cv::Mat1b& mask = answer.mask;
  figures_.width = labels.cols;
  figures_.height = labels.rows;
  const Counts frame = count(mask, labels, false, traversable_from);
  figures_.ground += frame;
  const Counts terrain = count(mask, labels, true, traversable_from);
  figures_.terrain += terrain;
  figures_.without_doubt_zone += count(mask, labels, false, 1);

  FrameFigures f;
  f.index = index;
  f.error = frame.error();
  f.terrain = terrain.error();
  f.other = percent(frame.missed_ground - terrain.missed_ground, frame.known());
  f.unsafe = frame.unsafe_share();
  f.confidence = answer.confidence.value_or(-1);
  const int horizon = true_horizon(labels);
  knows_horizon_ |= answer.knows_horizon;
  if (horizon >= 0 && answer.knows_horizon) {
    ++frames_with_horizon_;
    if (answer.horizon) {
      f.horizon = 100 * std::abs(*answer.horizon - static_cast<double>(horizon) / labels.rows);
      horizons_.push_back(*f.horizon);
    } else {
      ++nulls_;
    }
  }
  figures_.frames.push_back(f);

  const double tolerance = column_tolerance * labels.rows;
  for (int x = 0; x < labels.cols; ++x) {
    const int truth = run_top(labels, x, [&](int y) { return is_ground(labels(y, x)); });
    if (truth < 0)
      continue;
    const int said = run_top(labels, x, [&](int y) { return mask(y, x) >= traversable_from; });
    ++columns_;
    columns_within_ += std::abs(said - truth) <= tolerance;
    columns_over_ += truth - said > tolerance;
  }

  const cv::Mat1b now = mask >= traversable_from;
  if (!answer.confidence_map.empty())
    figures_.sureness += count_cells(answer.confidence_map, mask, labels);
  if (with_things)
    figures_.things += count_things(labels, now);
  if (!previous_.empty() && previous_.size() == now.size())
    flicker_.push_back(100.0 * cv::countNonZero(now != previous_) / static_cast<double>(now.total()));
  previous_ = now;
  if (answer.milliseconds > 0)
    latencies_.push_back(answer.milliseconds);
}

void Scorer::join(Scorer&& later) {
  const auto append = [](auto& to, const auto& from) { to.insert(to.end(), from.begin(), from.end()); };
  Figures& f = later.figures_;
  if (f.frames.empty())
    return;
  figures_.width = f.width;
  figures_.height = f.height;
  figures_.ground += f.ground;
  figures_.terrain += f.terrain;
  figures_.without_doubt_zone += f.without_doubt_zone;
  figures_.things += f.things;
  figures_.sureness += f.sureness;
  append(figures_.frames, f.frames);
  append(horizons_, later.horizons_);
  append(latencies_, later.latencies_);
  append(flicker_, later.flicker_);
  frames_with_horizon_ += later.frames_with_horizon_;
  nulls_ += later.nulls_;
  knows_horizon_ |= later.knows_horizon_;
  columns_ += later.columns_;
  columns_within_ += later.columns_within_;
  columns_over_ += later.columns_over_;
  previous_ = later.previous_;
}

Figures Scorer::finish() {
  Figures& f = figures_;
  f.horizon = spread_of(horizons_);
  if (knows_horizon_ && frames_with_horizon_ > 0)
    f.horizon_null = percent(nulls_, frames_with_horizon_);
  if (columns_ > 0) {
    f.boundary_within = percent(columns_within_, columns_);
    f.boundary_over = percent(columns_over_, columns_);
  }
  if (!flicker_.empty())
    f.flicker = std::accumulate(flicker_.begin(), flicker_.end(), 0.0) / static_cast<double>(flicker_.size());
  std::vector<double> errors, confidences;
  for (const FrameFigures& frame : f.frames) {
    errors.push_back(frame.error);
    confidences.push_back(frame.confidence);
  }
  f.frame_error = spread_of(errors);
  if (!confidences.empty() && confidences[0] >= 0)
    f.confidence_rank = rank_correlation(errors, confidences);
  f.latency = spread_of(latencies_);
  return std::move(f);
}

} // namespace terrainseg::eval
