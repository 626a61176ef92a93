// SPDX-License-Identifier: LGPL-2.1-or-later
// Writes the estimate of one frame from the results of all stages.
#pragma once

#include <vector>

#include "base/estimate_writer.hpp"
#include "base/frame_line.hpp"
#include "base/pipeline.hpp"
#include "freespace/answer/evidence.hpp"
#include "freespace/answer/free_space.hpp"

namespace terrainseg {

struct View;
struct WindowLesson;
struct Scores;
struct Ground;
class HoleFinders;

/// The results of all stages for one frame.
struct Findings {
  const View& view;
  const WindowLesson& lesson;
  const Scores& scores;
  const Ground& ground;
  const FreeSpaceCurves& curves;
  const HoleFinders& holes;
  FrameLine end;          ///< the end of the ground plane
  std::int32_t speed = 0; ///< forward speed in camera heights, Q16 1/s
  bool continued = false; ///< the last frame shows the same place
};

class AnswerWriter {
 public:
  /// Writes the fields that do not depend on the terrain.
  void start(const View& view, EstimateWriter& out);
  /// Writes the estimate for an unknown terrain.
  static void write_unknown(EstimateWriter& out, StageClock& clock);
  void write(const Findings& f, HorizonHold& hold, EstimateWriter& out, StageClock& clock);

 private:
  void write_rows(const Findings& f, std::uint8_t confidence, HorizonHold& hold, EstimateWriter& out);
  void write_mask(const Findings& f, EstimateWriter& out);
  void write_confidence(const Findings& f, const Estimate& estimate);

  MutablePlane confidence_map_;
  FrameCurve below_things_; ///< the safe curve, lowered below obstacles in open ground
  std::vector<std::uint16_t> scratch_;
  FreeSpace free_space_;
  Evidence evidence_;
};

} // namespace terrainseg
