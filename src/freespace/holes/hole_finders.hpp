// SPDX-License-Identifier: LGPL-2.1-or-later
// The detectors of obstacles in open ground. Each has a setting that switches it off. And the veto of a
// detector outside of the filter.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "base/quantities.hpp"
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
  bool far_turn = false; ///< the last frame was one for spots far away
};

/// The ground of a frame, the input of the detectors.
struct OpenGround {
  const View& view;
  const Ground& ground;
  RefinedCurves& curves;
  std::uint32_t horizon = 0; ///< slow horizon, Q8 of the height: sizes grow with the distance from it
  FrameLine line;            ///< the known vanishing line of the ground
  bool continued = false;    ///< the last frame shows the same place
  bool soon = false;         ///< and is less than half_rate_interval older, and the picture has hardly moved
};

/// One detector. hole.hpp turns its detections into holes. Detectors run on several threads at once.
class HoleFinder {
 public:
  virtual ~HoleFinder() = default;
  /// Level of the columns of the curves for find(); nothing when the settings switch the detector off.
  virtual std::optional<int> column_level(const View& view) const = 0;
  /// Fills found(). Reads `open`, changes only its own part of `memory`. `curves` is nullptr when the
  /// detector is switched off.
  virtual void find(const OpenGround& open, const FreeSpaceCurves* curves, HoleMemory& memory) = 0;
  const Detection& found() const { return found_; }

 protected:
  Detection found_;
};

/// Obstacles that move in the picture as objects standing on the ground.
class MotionFinder final : public HoleFinder {
 public:
  MotionFinder() { found_.label = mask_not_traversable; }
  std::optional<int> column_level(const View& view) const override;
  void find(const OpenGround& open, const FreeSpaceCurves* curves, HoleMemory& memory) override;
  const FinerCells<std::int16_t>& evidence() const { return evidence_; } ///< empty when there is none

 private:
  StandingThings things_;
  FinerCells<std::int16_t> evidence_;
};

/// Small objects that differ from the ground on both sides: far away in cells of half the size, or near by,
/// in the whole picture when far spots are off.
class SpotFinder final : public HoleFinder {
 public:
  enum class Reach : std::uint8_t { near_by, far_away };
  explicit SpotFinder(Reach reach) : reach_(reach) {}
  std::optional<int> column_level(const View& view) const override;
  void find(const OpenGround& open, const FreeSpaceCurves* curves, HoleMemory& memory) override;
  /// Removes from found() what moves as the ground does.
  void drop_flat(const FinerCells<std::int16_t>& motion);

 private:
  Reach reach_;
  OddSpots spots_;
};

/// Stones of any shade, where there are many.
class StoneFinder final : public HoleFinder {
 public:
  std::optional<int> column_level(const View& view) const override;
  void find(const OpenGround& open, const FreeSpaceCurves* curves, HoleMemory& memory) override;

 private:
  StoneField field_;
};

/// Pixels that a detector outside of the filter vetoes. An input, not a stage: it has no setting.
class VetoFinder final : public HoleFinder {
 public:
  VetoFinder() { found_.label = mask_not_traversable; }
  std::optional<int> column_level(const View&) const override { return std::nullopt; } // needs no curves
  void find(const OpenGround& open, const FreeSpaceCurves* curves, HoleMemory& memory) override;

 private:
  std::vector<std::int16_t> cells_; ///< evidence of each cell of the grid
};

class HoleFinders {
 public:
  using List = std::array<HoleFinder*, 5>;
  /// Searches with all detectors. In a frame that follows soon, spots near by and stones take turns with
  /// spots far away: found() of a detector that waits stays as it was.
  void find(const OpenGround& open, HoleMemory& memory);
  const List& list() const { return list_; }

 private:
  MotionFinder motion_;
  SpotFinder near_spots_{SpotFinder::Reach::near_by}, far_spots_{SpotFinder::Reach::far_away};
  StoneFinder stones_;
  VetoFinder veto_;
  List list_{&motion_, &near_spots_, &far_spots_, &stones_, &veto_}; // a veto overrides all other labels
};

} // namespace terrainseg
