// SPDX-License-Identifier: LGPL-2.1-or-later
#include "lab/reference/reference_engine.hpp"

#include <chrono>
#include <stdexcept>
#include <string>

namespace terrainseg::reference {

namespace {

using Clock = std::chrono::steady_clock;

/// Adds the time between its calls to the stages of a frame.
class Laps {
 public:
  explicit Laps(std::array<std::int64_t, reference_stage_count>& times) : times_(times) { times_.fill(0); }
  void end_of(ReferenceStage stage) {
    const Clock::time_point now = Clock::now();
    times_[static_cast<std::size_t>(stage)] += std::chrono::nanoseconds(now - last_).count();
    last_ = now;
  }

 private:
  std::array<std::int64_t, reference_stage_count>& times_;
  Clock::time_point last_ = Clock::now();
};

const ReferenceSettings& checked(const ReferenceSettings& s) {
  const auto refuse = [](const std::string& why) { throw std::invalid_argument("reference engine: " + why); };
  if (s.training_models < 1 || s.training_models > 255)
    refuse("training_models = " + std::to_string(s.training_models) + ": outside 1..255");
  if (s.learned_models <= s.training_models)
    refuse("learned_models = " + std::to_string(s.learned_models) +
           ": must be above training_models = " + std::to_string(s.training_models));
  if (!(s.variance_floor > 0))
    refuse("variance_floor must be above 0, else a cluster of one colour has no inverse");
  if (!(s.threshold >= 0) || !(s.match_threshold >= 0) || !(s.mass_cap > 0))
    refuse("thresholds must not be negative and mass_cap must be above 0");
  if (s.max_iterations < 1)
    refuse("max_iterations must be 1 or more");
  return s;
}

} // namespace

const char* name_of(ReferenceStage stage) {
  constexpr const char* names[reference_stage_count] = {"training pixels", "clustering", "update", "scoring",
                                                        "clean-up"};
  return names[static_cast<int>(stage)];
}

ReferenceEngine::ReferenceEngine(const ReferenceSettings& settings)
    : settings_(checked(settings)), mixture_(static_cast<std::size_t>(settings.learned_models)) {}

void ReferenceEngine::configure(const ReferenceSettings& settings) {
  const bool other_slots = checked(settings).learned_models != settings_.learned_models;
  settings_ = settings;
  if (other_slots)
    reset();
}

void ReferenceEngine::reset() {
  mixture_ = Mixture(static_cast<std::size_t>(settings_.learned_models));
  result_ = {};
}

const ReferenceResult& ReferenceEngine::process(const cv::Mat& bgr, const cv::Mat& training) {
  if (bgr.empty() || bgr.type() != CV_8UC3)
    throw std::invalid_argument("reference engine: the frame must be 8-bit B G R and not empty");
  if (!training.empty() && (training.type() != CV_8UC1 || training.size() != bgr.size()))
    throw std::invalid_argument(
        "reference engine: the training mask must be 8-bit grey and of the frame's size");

  Laps laps(result_.stage_times);
  result_.window = {};
  if (training.empty()) {
    result_.window = window_in(bgr.size(), settings_.window);
    window_pixels(bgr, result_.window, settings_.window_sigma, result_.training);
  } else
    cv::compare(training, 128, result_.training, cv::CMP_GE);
  laps.end_of(ReferenceStage::training_pixels);

  result_.clusters.clear();
  result_.learned = result_.starved = false;
  if (settings_.learning) {
    gather(bgr, result_.training, colors_);
    const auto wanted = static_cast<std::size_t>(settings_.min_training_pixels) *
                        static_cast<std::size_t>(settings_.training_models);
    result_.starved = colors_.size() < wanted || colors_.size() == 0;
    if (!result_.starved) {
      result_.clusters =
          cluster(colors_, settings_.training_models, settings_.max_iterations, settings_.seed).clusters;
      for (Gaussian& seen : result_.clusters)
        seen.covariance.diagonal().array() += settings_.variance_floor;
    }
    laps.end_of(ReferenceStage::clustering);
    if (!result_.starved) {
      mixture_.learn(result_.clusters, settings_.match_threshold,
                     settings_.mass_cap * static_cast<double>(colors_.size()));
      result_.learned = true;
    }
    laps.end_of(ReferenceStage::update);
  }

  result_.models = mixture_.models();
  if (mixture_.empty()) {
    result_.mask.create(bgr.size(), CV_8UC1);
    result_.mask.setTo(128);
    return result_;
  }
  label_pixels(bgr, mixture_.heaviest(settings_.mass_share), settings_.threshold, result_.mask);
  laps.end_of(ReferenceStage::scoring);
  clean_up_.smooth(result_.mask, settings_.dilations, settings_.erosions);
  if (settings_.connected)
    clean_up_.keep_connected(result_.mask, result_.training);
  laps.end_of(ReferenceStage::clean_up);
  return result_;
}

} // namespace terrainseg::reference
