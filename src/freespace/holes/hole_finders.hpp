// SPDX-License-Identifier: LGPL-2.1-or-later
// The detectors of obstacles in open ground. Each has a setting that switches it off. And the veto of a
// detector outside of the filter.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "base/frame_line.hpp"
#include "freespace/curve/refinement.hpp"
#include "freespace/holes/hole.hpp"
#include "freespace/holes/odd_spots.hpp"
#include "freespace/holes/standing_things.hpp"
#include "freespace/holes/stone_field.hpp"

namespace terrainseg {

struct View;
struct Ground;

/// The state that the detectors keep between frames.
struct HoleMemory {
  StoneField::Watch stones;
  MotionTrack motion;
};

/// The ground of a frame, the input of the detectors.
struct OpenGround {
  const View& view;
  const Ground& ground;
  RefinedCurves& curves;
  std::uint32_t horizon = 0; ///< slow horizon, Q8 of the height: sizes grow with the distance from it
  FrameLine line;            ///< the known vanishing line of the ground
  bool continued = false;    ///< the last frame shows the same place
  /// Evidence of motion, which is detected first. Empty when there is none.
  FinerCells<std::int16_t> motion{};

  const FreeSpaceCurves& curves_at(int level) const { return curves.at(view, ground, level); }
};

/// One detector. hole.hpp turns its detections into holes.
class HoleFinder {
 public:
  virtual ~HoleFinder() = default;
  /// Fills found(). Finds no holes when the settings switch the detector off.
  virtual void find(OpenGround& open, HoleMemory& memory) = 0;
  const Detection& found() const { return found_; }

 protected:
  Detection found_;
};

/// Obstacles that move in the picture as objects standing on the ground.
class MotionFinder final : public HoleFinder {
 public:
  MotionFinder() { found_.label = mask_not_traversable; }
  void find(OpenGround& open, HoleMemory& memory) override;

 private:
  StandingThings things_;
};

/// Small objects that differ from the ground on both sides: in the whole picture, or far away in cells of
/// half the size.
class SpotFinder final : public HoleFinder {
 public:
  enum class Reach : std::uint8_t { whole_picture, far_away };
  explicit SpotFinder(Reach reach) : reach_(reach) {}
  void find(OpenGround& open, HoleMemory& memory) override;

 private:
  Reach reach_;
  OddSpots spots_;
};

/// Stones of any shade, where there are many.
class StoneFinder final : public HoleFinder {
 public:
  void find(OpenGround& open, HoleMemory& memory) override;

 private:
  StoneField field_;
};

/// Pixels that a detector outside of the filter vetoes. An input, not a stage: it has no setting.
class VetoFinder final : public HoleFinder {
 public:
  VetoFinder() { found_.label = mask_not_traversable; }
  void find(OpenGround& open, HoleMemory& memory) override;

 private:
  std::vector<std::int16_t> cells_; ///< evidence of each cell of the grid
};

class HoleFinders {
 public:
  using List = std::array<HoleFinder*, 5>;
  void find(OpenGround open, HoleMemory& memory);
  const List& list() const { return list_; }

 private:
  MotionFinder motion_;
  SpotFinder near_spots_{SpotFinder::Reach::whole_picture}, far_spots_{SpotFinder::Reach::far_away};
  StoneFinder stones_;
  VetoFinder veto_;
  List list_{&motion_, &near_spots_, &far_spots_, &stones_, &veto_}; // a veto overrides all other labels
};

} // namespace terrainseg
