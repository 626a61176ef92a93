// SPDX-License-Identifier: LGPL-2.1-or-later
#include "lab/reference/paper_reading.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

#include <opencv2/imgproc.hpp>

#include "lab/reference/training_pixels.hpp"

namespace terrainseg::reference {

namespace {

double squared_norm(const cv::Vec3d& v) {
  return v.dot(v);
}

double binned(int value, int shift, BinRule rule) {
  return (value >> shift << shift) + (rule == BinRule::centre ? (1 << shift >> 1) : 0);
}

cv::Rect window_of(cv::Size frame, const Readings& readings) {
  WindowPlace place;
  place.bottom = readings.window_bottom;
  if (readings.upright_window) {
    // 64 x 128 against 128 x 64, in the same proportion to the frame.
    const cv::Rect lying = window_in(frame, {});
    place.width = lying.height;
    place.height = lying.width;
  }
  return window_in(frame, place);
}

/// Cells of a level whose pixel (x * 2^level, y * 2^level) lies in the window.
cv::Rect cells_of(const cv::Rect& window, int level) {
  const auto up = [level](int v) { return (v + (1 << level) - 1) >> level; };
  const int left = up(window.x), top = up(window.y);
  return {left, top, up(window.x + window.width) - left, up(window.y + window.height) - top};
}

} // namespace

PaperReading::Colors PaperReading::training_samples(const std::vector<cv::Mat>& pyramid, cv::Vec3d& mean,
                                                    cv::Vec3d& variance) const {
  const cv::Rect window = window_of(pyramid[0].size(), readings_);
  int level = readings_.levels;
  if (readings_.finer_when_few)
    while (level > 0 && cells_of(window, level).area() < 16 * readings_.training_models)
      --level;
  const cv::Mat& picture = pyramid[static_cast<std::size_t>(level)];
  const cv::Rect cells = cells_of(window, level) & cv::Rect({0, 0}, picture.size());
  Colors all;
  for (int y = cells.y; y < cells.y + cells.height; ++y)
    for (int x = cells.x; x < cells.x + cells.width; ++x)
      all.emplace_back(picture.at<cv::Vec3b>(y, x));
  mean = variance = {};
  if (all.empty())
    return all;
  const double n = static_cast<double>(all.size());
  for (const cv::Vec3d& c : all) {
    mean += c / n;
    variance += c.mul(c) / n;
  }
  variance -= mean.mul(mean);
  if (readings_.window_sigma <= 0)
    return all;

  std::vector<double> farthest;
  for (const cv::Vec3d& c : all) {
    double most = 0;
    for (int i = 0; i < 3; ++i) {
      const double off = (c[i] - mean[i]) * (c[i] - mean[i]);
      most = std::max(most, off > 0 ? off / std::max(variance[i], 1e-9) : 0);
    }
    farthest.push_back(most);
  }
  double limit = readings_.window_sigma * readings_.window_sigma;
  std::vector<double> ranked = farthest;
  std::sort(ranked.begin(), ranked.end());
  if (readings_.keep_half)
    limit = std::max(limit, ranked[(ranked.size() + 1) / 2 - 1]);
  Colors kept;
  for (std::size_t i = 0; i < all.size(); ++i)
    if (farthest[i] <= limit)
      kept.push_back(all[i]);
  return kept;
}

std::vector<PaperReading::Model> PaperReading::cluster(const Colors& samples) const {
  const auto& r = readings_;
  Colors shifted;
  cv::Vec3d mean;
  for (const cv::Vec3d& c : samples) {
    cv::Vec3d t;
    for (int i = 0; i < 3; ++i)
      t[i] = binned(static_cast<int>(c[i]), r.bit_shift, r.bins);
    shifted.push_back(t);
    mean += t / static_cast<double>(samples.size());
  }
  std::mt19937 random(r.seed);
  Colors centres{mean};
  while (static_cast<int>(centres.size()) < r.training_models)
    if (r.centres == CentreRule::samples)
      centres.push_back(shifted[random() % shifted.size()]);
    else
      centres.emplace_back(random() % 256, random() % 256, random() % 256);

  std::vector<std::size_t> owner(shifted.size(), centres.size());
  for (int round = 0; round < r.max_iterations; ++round) {
    bool changed = false;
    Colors sums(centres.size());
    std::vector<double> counts(centres.size());
    for (std::size_t i = 0; i < shifted.size(); ++i) {
      std::size_t best = 0;
      for (std::size_t k = 1; k < centres.size(); ++k)
        if (squared_norm(shifted[i] - centres[k]) < squared_norm(shifted[i] - centres[best]))
          best = k;
      changed |= owner[i] != best;
      owner[i] = best;
      sums[best] += shifted[i];
      counts[best] += 1;
    }
    for (std::size_t k = 0; k < centres.size(); ++k)
      if (counts[k] > 0)
        centres[k] = sums[k] / counts[k];
    if (!changed)
      break;
  }

  std::vector<Model> found(centres.size());
  std::vector<cv::Vec3d> squares(centres.size());
  for (std::size_t i = 0; i < shifted.size(); ++i) {
    found[owner[i]].mass += 1;
    found[owner[i]].mean += shifted[i];
    squares[owner[i]] += shifted[i].mul(shifted[i]);
  }
  const double bin_variance = r.quantisation_variance ? std::pow(4.0, r.bit_shift) / 12 : 0;
  std::vector<Model> live;
  for (std::size_t k = 0; k < found.size(); ++k) {
    Model& m = found[k];
    if (m.mass == 0)
      continue;
    m.mean /= m.mass;
    m.variance = squares[k] / m.mass - m.mean.mul(m.mean);
    for (int i = 0; i < 3; ++i)
      m.variance[i] = std::max(m.variance[i], r.variance_floor + bin_variance);
    live.push_back(m);
  }
  std::stable_sort(live.begin(), live.end(), [](const Model& a, const Model& b) { return a.mass > b.mass; });
  return live;
}

void PaperReading::learn(const std::vector<Model>& training, double cap) {
  learned_.resize(static_cast<std::size_t>(readings_.learned_models));
  for (const Model& seen : training) {
    Model* match = nullptr;
    double least = std::numeric_limits<double>::infinity();
    for (Model& model : learned_) {
      if (model.mass <= 0)
        continue;
      double distance = 0;
      for (int i = 0; i < 3; ++i) {
        const double off = model.mean[i] - seen.mean[i];
        distance += off * off / (model.variance[i] + seen.variance[i]);
      }
      if (distance <= readings_.match_threshold && distance < least) {
        least = distance;
        match = &model;
        if (readings_.match == MatchRule::first)
          break;
      }
    }
    if (match) {
      const double mass = match->mass + seen.mass;
      match->mean = (match->mean * match->mass + seen.mean * seen.mass) / mass;
      match->variance = (match->variance * match->mass + seen.variance * seen.mass) / mass;
      match->mass = mass;
    } else
      *std::min_element(learned_.begin(), learned_.end(),
                        [](const Model& a, const Model& b) { return a.mass < b.mass; }) = seen;
  }
  if (cap > 0)
    for (Model& model : learned_)
      model.mass = std::min(model.mass, cap);
}

int PaperReading::find_horizon(const cv::Mat& coarse, const cv::Vec3d& mean, const cv::Vec3d& variance,
                               int window_top, int window_end) const {
  if (readings_.horizon == HorizonRule::off)
    return -1;
  cv::Vec3d reach;
  for (int i = 0; i < 3; ++i) {
    const double v = std::max(variance[i], readings_.horizon_floor);
    reach[i] = 2 * (readings_.horizon_by_variance ? v : std::sqrt(v));
  }
  std::vector<int> alike;
  for (int y = 0; y < std::min(window_end, coarse.rows); ++y) {
    int count = 0;
    for (int x = 0; x < coarse.cols; ++x) {
      const cv::Vec3d off = cv::Vec3d(coarse.at<cv::Vec3b>(y, x)) - mean;
      count += std::abs(off[0]) <= reach[0] && std::abs(off[1]) <= reach[1] && std::abs(off[2]) <= reach[2];
    }
    alike.push_back(count);
  }
  const auto top = alike.begin(), end = top + std::min<std::ptrdiff_t>(window_top, std::ssize(alike));
  if (end == top)
    return -1;
  const int least = *std::min_element(top, end);
  if (readings_.horizon == HorizonRule::first_minimum)
    return static_cast<int>(std::find(top, end, least) - top);
  const int lowest =
      static_cast<int>(std::find(std::make_reverse_iterator(end), alike.rend(), least).base() - top) - 1;
  if (readings_.horizon == HorizonRule::lowest_minimum)
    return lowest;
  const int in_window = end == alike.end() ? least + 1 : *std::min_element(end, alike.end());
  double rest = -least;
  for (int count : alike)
    rest += count;
  const double others = static_cast<double>(alike.size()) - 1;
  const bool null = in_window <= least || 2 * least * others >= rest;
  return null ? -1 : lowest;
}

void PaperReading::label(const cv::Mat& bgr) {
  mask_.create(bgr.size(), CV_8UC1);
  const bool known =
      std::any_of(learned_.begin(), learned_.end(), [](const Model& model) { return model.mass > 0; });
  mask_.setTo(known ? 0 : 128);
  if (!known)
    return;
  struct Distances {
    std::array<std::array<float, 256>, 3> of;
  };
  std::vector<Distances> tables;
  for (const Model& model : learned_) {
    if (model.mass <= 0)
      continue;
    Distances d;
    for (int i = 0; i < 3; ++i)
      for (int v = 0; v < 256; ++v) {
        const double off = binned(v, readings_.bit_shift, readings_.bins) - model.mean[i];
        d.of[static_cast<std::size_t>(i)][static_cast<std::size_t>(v)] =
            static_cast<float>(off * off / model.variance[i]);
      }
    tables.push_back(d);
  }
  const auto limit = static_cast<float>(readings_.threshold * readings_.threshold);
  const bool flipped = readings_.horizon == HorizonRule::flipped;
  const int from = flipped || horizon_row_ < 0 ? 0 : horizon_row_;
  const int to = flipped && horizon_row_ >= 0 ? horizon_row_ : bgr.rows;
  for (int y = from; y < to; ++y) {
    const auto* pixel = bgr.ptr<cv::Vec3b>(y);
    auto* out = mask_.ptr<std::uint8_t>(y);
    for (const Distances& d : tables)
      for (int x = 0; x < bgr.cols; ++x)
        if (d.of[0][pixel[x][0]] + d.of[1][pixel[x][1]] + d.of[2][pixel[x][2]] <= limit)
          out[x] = 255;
  }
}

const cv::Mat& PaperReading::process(const cv::Mat& bgr) {
  CV_Assert(bgr.type() == CV_8UC3 && !bgr.empty());
  std::vector<cv::Mat> pyramid{bgr};
  for (int level = 0; level < readings_.levels; ++level) {
    cv::Mat next;
    cv::pyrDown(pyramid.back(), next);
    pyramid.push_back(next);
  }
  cv::Vec3d mean, variance;
  const Colors samples = training_samples(pyramid, mean, variance);
  live_clusters_ = 0;
  if (!samples.empty()) {
    const std::vector<Model> training = cluster(samples);
    live_clusters_ = static_cast<int>(training.size());
    learn(training, readings_.mass_cap * static_cast<double>(samples.size()));
  }
  const cv::Rect cells = cells_of(window_of(bgr.size(), readings_), readings_.levels);
  const int row =
      samples.empty() ? -1 : find_horizon(pyramid.back(), mean, variance, cells.y, cells.y + cells.height);
  horizon_row_ = row < 0 ? -1 : std::min(row << readings_.levels, bgr.rows);
  label(bgr);
  return mask_;
}

} // namespace terrainseg::reference
