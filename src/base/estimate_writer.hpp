// SPDX-License-Identifier: LGPL-2.1-or-later
// The estimate of the frame at hand and the memory that it points into: what both pipelines write.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "terrainseg/estimate.hpp"
#include "terrainseg/mask_target.hpp"
#include "terrainseg/terrain.hpp"

namespace terrainseg {

/// Of 1000 columns of the window, how many are free for at least `margin` rows (of the frame) ahead of it.
/// `boundary` as in Estimate.
int free_permille_ahead(std::span<const std::uint16_t> boundary, int mask_level, const Rectangle& window,
                        int margin);

class EstimateWriter {
 public:
  /// An estimate that knows the frame's size and window, and nothing else. The mask goes to `target`, or to
  /// memory of its own where that is empty. Allocates only when the mask grows.
  void start(const Frame& frame, const MaskTarget& target, const Settings& settings, const Rectangle& window,
             std::uint64_t number);

  Estimate& estimate() { return estimate_; }
  const Estimate& estimate() const { return estimate_; }
  /// To be filled: estimate().mask, and one row of the frame per mask column.
  const MutablePlane& mask() const { return mask_plane_; }
  std::span<std::uint16_t> boundary() { return boundary_; }

  /// To be filled: estimate().confidence_map, `width` x `height` cells, 0 everywhere. Allocates only when it
  /// grows.
  MutablePlane start_confidence_map(int width, int height);

  /// Nothing is known: the mask is 128, the boundary stays without free space, the way is blocked.
  void label_unknown();

  /// The share of the mask's pixels that are traversable, and, from the boundary, whether the way ahead is
  /// blocked: less than settings.blocked_below permille of the window's columns are free for one cell of
  /// `grid_level`.
  void tell_free_space(std::uint64_t traversable_pixels, const Settings& settings, int grid_level);

  /// Adds a learned model, as the colours of `space` show it.
  void add_model(const TerrainModel& model, const ColorSpace& space);

 private:
  std::vector<std::uint8_t> own_mask_, confidence_map_;
  std::vector<std::uint16_t> boundary_;
  MutablePlane mask_plane_;
  Estimate estimate_;
};

} // namespace terrainseg
