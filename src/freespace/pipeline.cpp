// SPDX-License-Identifier: LGPL-2.1-or-later
#include "freespace/pipeline.hpp"

#include <algorithm>

namespace terrainseg {
namespace {

const GridCurve no_curve;

/// The vanishing line that is known before the frame is processed, from the setting or a pose. A setting
/// below the frame is ignored, because it would leave no ground.
FrameLine known_line(const FrameTask& task) {
  const int row = task.settings.vanishing_row;
  if (row != -1 && row < task.frame.height)
    return {FrameLine::Source::setting, row * 256};
  constexpr std::int32_t farthest = 1 << 24;
  if (task.frame.vanishing_row)
    return {FrameLine::Source::pose, std::clamp(*task.frame.vanishing_row, -farthest, farthest)};
  return {};
}

/// Vanishing line of the ground plane, limited to the frame: from the setting, otherwise from the pose with
/// motion's correction, otherwise from motion in the previous frame.
FrameLine end_of_plane(const FrameTask& task, bool continued, const MotionTrack& track) {
  const FrameLine known = known_line(task);
  const bool by_motion = task.settings.motion != Motion::off;
  if (!known.known())
    return continued && by_motion ? track.line : FrameLine{};
  const bool corrected = by_motion && known.source == FrameLine::Source::pose;
  return known.lower_by(corrected ? track.line_offset : 0).within(task.frame.height);
}

/// Whether the time since the last frame allows sharing the searches for small obstacles with it.
bool follows_soon(const LastPicture& last, std::int64_t pts) {
  return last.pts >= 0 && pts >= last.pts && pts - last.pts < half_rate_interval;
}

/// The line that motion found last in frames of this size. It remains known while the rover stands still,
/// across cuts, and with the saved terrain.
FrameLine kept_line(const FrameTask& task, const KeptLine& kept) {
  const bool same = kept.height > 0 && kept.width == task.frame.width && kept.height == task.frame.height;
  return same ? FrameLine{FrameLine::Source::motion, static_cast<std::int32_t>(kept.row_q8)} : FrameLine{};
}

void keep_line(const FrameTask& task, const FrameLine& found, KeptLine& kept) {
  if (const FrameLine line = found.within(task.frame.height); line.known())
    kept = {static_cast<std::uint16_t>(task.frame.width), static_cast<std::uint16_t>(task.frame.height),
            static_cast<std::uint32_t>(line.row_q8)};
}

/// The line at which the ground ends: end_of_plane(), otherwise the line that motion found last, otherwise
/// the horizon hint, otherwise where long lines meet.
FrameLine end_of_ground(const View& view, bool continued, const MotionTrack& track, const KeptLine& kept,
                        LongLines& lines, LineWatch& watch) {
  const FrameTask& task = view.task;
  if (task.settings.long_lines)
    lines.prepare(view.luma, view.grid.level);
  const FrameLine measured = end_of_plane(task, continued, track);
  if (measured.known() || known_line(task).known())
    return measured;
  if (const FrameLine line = kept_line(task, kept); task.settings.motion != Motion::off && line.known())
    return line;
  if (const int hint = task.settings.horizon_hint_q8; hint >= 0)
    return {FrameLine::Source::hint, hint * task.frame.height};
  if (!task.settings.long_lines)
    return {};
  if (watch.due(task.frame.height))
    watch.take(lines.meeting_row(view.luma));
  return watch.line();
}

} // namespace

void FreeSpacePipeline::process(const FrameTask& task, Terrain& terrain, EstimateWriter& out,
                                StageClock& clock) {
  const View view = reader_.read(task, terrain.exposure_mean, memory_.black, clock);
  answer_.start(view, out);
  const Temporal mode = task.settings.temporal;
  // The last boundary predicts where the ground of this frame is.
  const bool same_place = shows_same_place(memory_.last, view.grid, task.frame.pts, mode);
  // Scores are averaged with the last frame's, and its horizon may be held.
  const bool continued = same_place && mode != Temporal::off;
  const bool soon =
      continued && follows_soon(memory_.last, task.frame.pts) && has_hardly_moved(memory_.last, view.grid);
  WindowLesson lesson;
  FrameLine end;
  // The edges of the frame and the end of the ground do not depend on the lesson.
  task.workers.run(view.blank ? 1 : 3, [&](int part) {
    if (part == 0)
      lesson = teacher_.learn(view, same_place ? memory_.boundary : no_curve, memory_.window, tables_,
                              terrain, clock);
    else if (part == 1)
      tracer_.look(view, scorer_.look(view), continued ? memory_.boundary : no_curve);
    else
      end = end_of_ground(view, continued, memory_.holes.motion, terrain.line, long_lines_, memory_.lines);
  });
  out.estimate().flags = lesson.flags;
  if (!lesson.known) {
    out.label_unknown();
    return clock.lap(Stage::mask);
  }
  remember(view.grid, task.frame.pts, memory_.last);
  const Scores scores = scorer_.score(view, lesson.trusted, continued, memory_.average, tables_, terrain);
  clock.lap(Stage::scoring);
  const Ground& ground =
      tracer_.trace(view, scores, lesson.horizon.row, end, memory_.boundary, terrain.horizon);
  curves_.refine(view, ground);
  holes_.find({view, ground, curves_, terrain.horizon, known_line(task), continued, soon}, memory_.holes);
  const MotionTrack& track = memory_.holes.motion;
  if (task.settings.motion != Motion::off)
    keep_line(task, track.line, terrain.line);
  answer_.write({view, lesson, scores, ground, curves_.of_mask(), holes_, end_of_plane(task, true, track),
                 task.settings.motion == Motion::off ? 0 : track.speed, continued},
                memory_.horizon, out, clock);
}

TerrainModel FreeSpacePipeline::in_this_light(const TerrainModel& learned) const {
  return terrainseg::in_this_light(learned, reader_.exposure());
}

void FreeSpacePipeline::adapt(const Settings& settings, int /*grid_level*/) {
  forget_terrain();
  if (settings.horizon != HorizonMode::automatic)
    memory_.horizon = {};
}

} // namespace terrainseg
