// SPDX-License-Identifier: LGPL-2.1-or-later
#include "tools/eval/figures.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

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
  Counts c;
  const int third = 2 * labels.rows / 3;
  for (int y = 0; y < labels.rows; ++y) {
    const std::uint8_t *l = labels[y], *m = mask[y];
    for (int x = 0; x < labels.cols; ++x) {
      if (l[x] == label_none || (only_terrain && l[x] == label_ground))
        continue;
      const bool truth = is_ground(l[x]), said = m[x] >= from;
      ++(truth ? said ? c.true_ground : c.missed_ground : said ? c.false_ground : c.true_rest);
      if (!truth && y >= third) {
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

double percentile(std::vector<double>& values, double share) {
  std::sort(values.begin(), values.end());
  const double position = share * static_cast<double>(values.size() - 1);
  const auto low = static_cast<std::size_t>(position);
  const std::size_t high = std::min(low + 1, values.size() - 1);
  return values[low] + (values[high] - values[low]) * (position - static_cast<double>(low));
}

std::vector<double> ranks_of(const std::vector<double>& values) {
  std::vector<std::size_t> order(values.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) { return values[a] < values[b]; });
  std::vector<double> ranks(values.size());
  for (std::size_t i = 0; i < order.size();) {
    std::size_t end = i;
    while (end < order.size() && values[order[end]] == values[order[i]])
      ++end;
    for (std::size_t k = i; k < end; ++k)
      ranks[order[k]] = static_cast<double>(i + end - 1) / 2;
    i = end;
  }
  return ranks;
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

Spread spread_of(std::vector<double> values) {
  if (values.empty())
    return {};
  return {percentile(values, 0.5), percentile(values, 0.9)};
}

int true_horizon(const cv::Mat1b& labels) {
  for (int y = 0; y < labels.rows; ++y)
    if (50 * std::count_if(labels[y], labels[y] + labels.cols, is_ground) >= labels.cols)
      return y;
  return -1;
}

std::optional<double> rank_correlation(const std::vector<double>& a, const std::vector<double>& b) {
  if (a.size() < 3)
    return std::nullopt;
  const std::vector<double> x = ranks_of(a), y = ranks_of(b);
  const double mean = static_cast<double>(a.size() - 1) / 2;
  double xy = 0, xx = 0, yy = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    xy += (x[i] - mean) * (y[i] - mean);
    xx += (x[i] - mean) * (x[i] - mean);
    yy += (y[i] - mean) * (y[i] - mean);
  }
  if (xx <= 0 || yy <= 0)
    return std::nullopt;
  return xy / std::sqrt(xx * yy);
}

Scorer::Scorer(std::string sequence, std::string engine, std::string input) {
  figures_.sequence = std::move(sequence);
  figures_.engine = std::move(engine);
  figures_.input = std::move(input);
}

void Scorer::add(const Answer& answer, const cv::Mat1b& labels) {
  const cv::Mat1b& mask = answer.mask;
  figures_.width = labels.cols;
  figures_.height = labels.rows;
  const Counts frame = count(mask, labels, false, traversable_from);
  figures_.ground += frame;
  figures_.terrain += count(mask, labels, true, traversable_from);
  figures_.without_doubt_zone += count(mask, labels, false, 1);

  FrameFigures f;
  f.index = figures_.frames.size();
  f.error = frame.error();
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
  if (!previous_.empty() && previous_.size() == now.size())
    flicker_.push_back(100.0 * cv::countNonZero(now != previous_) / static_cast<double>(now.total()));
  previous_ = now;
  if (answer.milliseconds > 0)
    latencies_.push_back(answer.milliseconds);
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
  if (!latencies_.empty())
    f.latency = {percentile(latencies_, 0.5), percentile(latencies_, 0.99)};
  return std::move(f);
}

} // namespace terrainseg::eval
