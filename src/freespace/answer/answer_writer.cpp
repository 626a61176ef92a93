// SPDX-License-Identifier: LGPL-2.1-or-later
#include "freespace/answer/answer_writer.hpp"

#include "freespace/answer/evidence.hpp"
#include "freespace/curve/ground.hpp"
#include "freespace/holes/hole_finders.hpp"
#include "freespace/learn/window_teacher.hpp"
#include "freespace/look/view.hpp"
#include "freespace/score/scores.hpp"

namespace terrainseg {

void AnswerWriter::start(const View& view, EstimateWriter& out) {
  confidence_map_ = out.start_confidence_map(view.grid.width, view.grid.height);
  out.estimate().window = view.window;
}

void AnswerWriter::write_unknown(EstimateWriter& out, StageClock& clock) {
  out.label_unknown();
  clock.lap(Stage::mask);
}

void AnswerWriter::write(const Findings& f, HorizonHold& hold, EstimateWriter& out, StageClock& clock) {
  Estimate& estimate = out.estimate();
  const std::uint8_t confidence =
      mask_confidence(f.view.grid, f.scores.average, f.ground.boundary, f.ground.behind);
  estimate.speed_over_height = f.speed;
  estimate.vanishing_row = f.end.row_q16(f.view.task.frame.height);
  write_rows(f, confidence, hold, out);
  // A window that shows the vehicle says nothing about the ground.
  estimate.confidence = f.lesson.flags & flag_window_still ? confidence / 4
                        : f.lesson.from_memory             ? confidence / 2
                                                           : confidence;
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
  std::uint64_t traversable = free_space_.write(f.curves, settings.mask_level, settings.ignore_regions,
                                                out.mask(), mask.height, f.view.task.workers);
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
