// SPDX-License-Identifier: LGPL-2.1-or-later
#include "terrainseg/segmenter.hpp"

#include <cstring>
#include <vector>

namespace terrainseg {

const char* name_of(Stage stage) {
  constexpr const char* names[stage_count] = {"pyramid", "prefilter", "clustering", "update",
                                              "horizon", "scoring",   "boundary",   "mask"};
  return names[static_cast<int>(stage)];
}

struct Segmenter::State {
  Settings settings;
  Estimate estimate;
  Counters counters;
  std::array<std::int64_t, stage_count> times{};
  std::vector<std::uint8_t> mask;
  std::vector<std::uint16_t> boundary;
};

Segmenter::Segmenter(const Settings& settings) : state_(std::make_unique<State>()) {
  state_->settings = settings;
}
Segmenter::~Segmenter() = default;
Segmenter::Segmenter(Segmenter&&) noexcept = default;
Segmenter& Segmenter::operator=(Segmenter&&) noexcept = default;

void Segmenter::configure(const Settings& settings) {
  state_->settings = settings;
}
const Settings& Segmenter::settings() const {
  return state_->settings;
}

Status Segmenter::process(const Frame& frame, const Supervision&, const MaskTarget& target) {
  State& s = *state_;
  const int w = mask_extent(frame.width, s.settings.mask_level),
            h = mask_extent(frame.height, s.settings.mask_level);
  MutablePlane out = target.plane;
  if (!out.data) {
    s.mask.resize(static_cast<std::size_t>(w) * h);
    out = {s.mask.data(), w};
  }
  for (int y = 0; y < h; ++y)
    std::memset(out.row(y), mask_doubtful, w);
  s.boundary.assign(w, static_cast<std::uint16_t>(frame.height));
  s.estimate = {};
  s.estimate.frame = s.counters.frames++;
  s.estimate.frame_width = frame.width;
  s.estimate.frame_height = frame.height;
  s.estimate.mask = {{out.data, out.stride}, w, h};
  s.estimate.mask_region = {0, 0, frame.width, frame.height};
  s.estimate.boundary = s.boundary;
  return {};
}

const Estimate& Segmenter::estimate() const {
  return state_->estimate;
}
void Segmenter::reset() {}
void Segmenter::reset_temporal() {}
Terrain Segmenter::terrain() const {
  return {};
}
Status Segmenter::adopt(const Terrain&) {
  return {};
}
const Counters& Segmenter::counters() const {
  return state_->counters;
}
const std::array<std::int64_t, stage_count>& Segmenter::stage_times() const {
  return state_->times;
}

} // namespace terrainseg
