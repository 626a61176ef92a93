// SPDX-License-Identifier: LGPL-2.1-or-later
#include "freespace/answer/answer_writer.hpp"

#include <algorithm>

#include "base/fixed.hpp"
#include "base/tuning.hpp"
#include "base/workers.hpp"
#include "coarse/grid.hpp"
#include "freespace/curve/reestimation.hpp"
#include "freespace/holes/hole_finders.hpp"
#include "freespace/learn/window_teacher.hpp"
#include "freespace/look/view.hpp"
#include "freespace/score/cell_scorer.hpp"
#include "kernels/mask.hpp"

namespace terrainseg {
namespace {

TERRAINSEG_TUNED(int, horizon_row, horizon_percent, 5);   ///< percent of the columns that are higher and
                                                          ///< count as outliers
TERRAINSEG_TUNED(int, horizon_row, least_confidence, 16); ///< smallest confidence of the mask for a valid
                                                          ///< horizon

} // namespace

HorizonRow horizon_of(const FrameCurve& boundary, int grid_level, int mask_level, int frame_height,
                      std::uint8_t mask_confidence, std::vector<std::uint16_t>& scratch) {
  // The curve is linear between the refinement's columns, so these are sufficient.
  const int step = std::max(1 << refinement_level(grid_level) >> mask_level, 1);
  scratch.clear();
  for (std::size_t x = 0; x < boundary.size(); x += step)
    scratch.push_back(boundary[x]);
  const int row = percentile(scratch, horizon_percent),
            spread = percentile(scratch, 10) - percentile(scratch, 2);
  if (row <= 0 || row >= frame_height || mask_confidence < least_confidence)
    return {};
  return {row, horizon_confidence(mask_confidence, spread, frame_height)};
}

HorizonRow HorizonHold::follow(const HorizonRow& seen, bool continued) {
  if (seen.row >= 0 || !continued)
    return last_ = seen;
  last_.confidence /= 2;
  last_.held = true;
  if (last_.row < 0 || last_.confidence == 0)
    last_ = {};
  return last_;
}

std::uint64_t FreeSpace::write(const FreeSpaceCurves& curves, std::span<const Rectangle> ignored,
                               const MutablePlane& mask, int height, Workers& workers) {
  const std::size_t width = curves.safe.size();
  boundary_.resize(width);
  safe_.resize(width);
  behind_first_.resize(width);
  behind_end_.resize(width);
  std::uint64_t traversable = 0;
  for (std::size_t x = 0; x < width; ++x) {
    // A mask row has the label of its uppermost row of pixels.
    boundary_[x] = static_cast<std::uint16_t>(std::min(subsampled(curves.boundary[x], curves.level), height));
    safe_[x] = static_cast<std::uint16_t>(
        std::clamp(subsampled(curves.safe[x], curves.level), int{boundary_[x]}, height));
    traversable += static_cast<std::uint64_t>(height - safe_[x]);
  }
  Stretch behind;
  if (curves.ground_behind)
    behind = bring_behind(curves, traversable);
  const int bands = workers.count();
  work_.resize(2 * width * bands);
  workers.run(bands, [&](int band) {
    const int first = height * band / bands, end = height * (band + 1) / bands;
    kernels::write_mask_rows(boundary_.data(), safe_.data(), static_cast<int>(width), first, end, mask.data,
                             mask.stride, &work_[2 * width * band]);
    kernels::add_mask_stretches(behind_first_.data() + behind.left, behind_end_.data() + behind.left,
                                behind.right - behind.left, std::max(first, behind.top),
                                std::min(end, behind.bottom), mask.data + behind.left, mask.stride);
  });
  return traversable - mark_ignored(ignored, curves.level, mask, static_cast<int>(width), height);
}

FreeSpace::Stretch FreeSpace::bring_behind(const FreeSpaceCurves& curves, std::uint64_t& traversable) {
  const std::size_t width = curves.safe.size();
  Stretch all{static_cast<int>(width), 0, 65535, 0};
  for (std::size_t x = 0; x < width; ++x) {
    const int end = std::min<int>(subsampled(curves.behind_end[x], curves.level), boundary_[x]),
              first = std::min(subsampled(curves.behind_first[x], curves.level), end);
    behind_first_[x] = static_cast<std::uint16_t>(first);
    behind_end_[x] = static_cast<std::uint16_t>(end);
    if (first == end)
      continue;
    traversable += static_cast<std::uint64_t>(end - first);
    all.left = std::min(all.left, static_cast<int>(x));
    all.right = static_cast<int>(x) + 1;
    all.top = std::min(all.top, first);
    all.bottom = std::max(all.bottom, end);
  }
  return all.left < all.right ? all : Stretch{};
}

void reachable_rows(const FrameCurve& safe, int mask_level, const Rectangle& window, int frame_height,
                    std::span<std::uint16_t> reachable) {
  std::fill(reachable.begin(), reachable.end(), static_cast<std::uint16_t>(frame_height));
  const int width = static_cast<int>(safe.size()), bottom = window.y + window.height;
  const int left = std::clamp(subsampled(window.x, mask_level), 0, width - 1),
            right = std::clamp((window.x + window.width - 1) >> mask_level, left, width - 1);
  const auto take = [&](int x) {
    if (safe[x] >= bottom)
      return false;
    reachable[x] = safe[x];
    return true;
  };
  for (int x = left; x <= right; ++x)
    take(x);
  for (int x = left - 1; x >= 0 && reachable[x + 1] < frame_height && take(x);)
    --x;
  for (int x = right + 1; x < width && reachable[x - 1] < frame_height && take(x);)
    ++x;
}

void AnswerWriter::start(const View& view, EstimateWriter& out) {
  confidence_map_ = out.start_confidence_map(view.grid.width, view.grid.height);
  out.estimate().window = view.window;
}

void AnswerWriter::write(const Findings& f, HorizonHold& hold, EstimateWriter& out, StageClock& clock) {
  Estimate& estimate = out.estimate();
  const std::uint8_t confidence =
      mask_confidence(f.view.grid, f.scores.average, f.ground.boundary, f.ground.behind);
  estimate.speed_over_height = f.speed;
  estimate.vanishing_row = f.end.row_q16(f.view.task.frame.height);
  write_rows(f, confidence, hold, out);
  // An unclear window lowers the confidence of the mask. That of the horizon depends on the curve alone.
  const auto clear = static_cast<std::uint8_t>(std::min(confidence * f.lesson.clarity / 256, 255));
  // A window that shows the vehicle says nothing about the ground.
  estimate.confidence = f.lesson.flags & flag_window_still ? clear / 4
                        : f.lesson.from_memory             ? clear / 2
                                                           : clear;
  clock.lap(Stage::boundary);
  write_mask(f, out);
  write_confidence(f, estimate);
  clock.lap(Stage::mask);
}

// Writes the connected free space and the horizon row.
void AnswerWriter::write_rows(const Findings& f, std::uint8_t confidence, HorizonHold& hold,
                              EstimateWriter& out) {
  const Settings& settings = f.view.task.settings;
  const int height = f.view.task.frame.height, level = f.view.grid.level;
  Estimate& estimate = out.estimate();
  below_things_ = f.curves.safe;
  for (const HoleFinder* finder : f.holes.list())
    lower_below(finder->found(), settings.mask_level, below_things_);
  reachable_rows(below_things_, settings.mask_level, estimate.window, height, out.boundary());
  if (settings.horizon == HorizonMode::paper) {
    const Horizon& horizon = f.lesson.horizon;
    estimate.horizon_row = horizon.row < 0 ? -1 : horizon.row << level;
    estimate.horizon_confidence = horizon.confidence;
  } else if (settings.horizon == HorizonMode::automatic) {
    const HorizonRow seen =
        horizon_of(f.curves.boundary, level, settings.mask_level, height, confidence, scratch_);
    const HorizonRow told = hold.follow(seen, f.continued);
    estimate.horizon_row = told.row;
    estimate.horizon_confidence = told.confidence;
    if (told.held)
      estimate.flags |= flag_horizon_held;
  }
}

// Where the holes of two detectors overlap, doubtful has priority.
void AnswerWriter::write_mask(const Findings& f, EstimateWriter& out) {
  const Settings& settings = f.view.task.settings;
  const GrayView& mask = out.estimate().mask;
  std::uint64_t traversable =
      free_space_.write(f.curves, settings.ignore_regions, out.mask(), mask.height, f.view.task.workers);
  for (const std::uint8_t label : {mask_doubtful, mask_not_traversable})
    for (const HoleFinder* finder : f.holes.list())
      if (finder->found().label == label)
        traversable -= mark(finder->found(), out.mask(), mask.width, mask.height, settings.mask_level);
  out.tell_free_space(traversable, settings, f.view.grid.level);
}

// Must follow write_mask(): the confidence refers to the labels of the mask.
void AnswerWriter::write_confidence(const Findings& f, const Estimate& estimate) {
  evidence_.start(f.view.grid, f.scores.average, f.ground.boundary, f.ground.behind);
  for (const HoleFinder* finder : f.holes.list())
    evidence_.subtract(finder->found());
  evidence_.tell(f.view.grid, estimate.mask, f.view.task.settings.mask_level, estimate.confidence,
                 confidence_map_);
}

} // namespace terrainseg
