// SPDX-License-Identifier: LGPL-2.1-or-later
// Writes the estimate of one frame from the results of all stages: the mask, the connected free space for a
// controller, the horizon row and the confidence.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "base/estimate_writer.hpp"
#include "base/pipeline.hpp"
#include "base/quantities.hpp"
#include "freespace/answer/evidence.hpp"
#include "freespace/curve/frame_curves.hpp"
#include "terrainseg/frame.hpp"

namespace terrainseg {

/// The horizon row, from the upper end of the free space.
struct HorizonRow {
  int row = -1; ///< row of the frame; -1 = not found
  std::uint8_t confidence = 0;
  bool held = false; ///< the row of an earlier frame
};

/// The uppermost row of the ground without outliers, from a curve in rows of the frame per mask column. Not
/// found when the curve touches the top or the bottom, or when a low `mask_confidence` shows that it
/// separates nothing (a wall, a turn over unknown ground).
HorizonRow horizon_of(const FrameCurve& boundary, int grid_level, int mask_level, int frame_height,
                      std::uint8_t mask_confidence, std::vector<std::uint16_t>& scratch);

/// Keeps the last horizon over frames without one: a wall, a turn, a view of ground only.
class HorizonHold {
 public:
  /// Returns the horizon `seen` in a frame. When it has none and the last frame is `continued`, returns the
  /// last row with half of the confidence, until the confidence is 0.
  HorizonRow follow(const HorizonRow& seen, bool continued);

 private:
  HorizonRow last_;
};

/// Writes the curves as a mask.
class FreeSpace {
 public:
  /// Writes a mask of curves.boundary.size() columns and `height` rows, 2^curves.level times smaller than the
  /// frame: 0 above the boundary, 128 from there to the safe row, 255 below and behind obstacles, 128 in
  /// ignored regions. Returns the number of traversable pixels.
  std::uint64_t write(const FreeSpaceCurves& curves, std::span<const Rectangle> ignored,
                      const MutablePlane& mask, int height, Workers& workers);

 private:
  /// Columns left .. right - 1 and rows top .. bottom - 1 of the mask.
  struct Stretch {
    int left = 0, right = 0, top = 0, bottom = 0;
  };
  /// Writes the ground behind obstacles, adds its pixels to `traversable`, and returns where it is.
  Stretch bring_behind(const FreeSpaceCurves& curves, std::uint64_t& traversable);

  MaskCurve boundary_, safe_, behind_first_, behind_end_;
  std::vector<std::uint8_t> work_;
};

/// Per mask column the safe row, or `frame_height` where the free space is not connected to the window. It is
/// followed outwards from the window's columns and ends at a column without free space above the window's
/// bottom edge.
void reachable_rows(const FrameCurve& safe, int mask_level, const Rectangle& window, int frame_height,
                    std::span<std::uint16_t> reachable);

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
