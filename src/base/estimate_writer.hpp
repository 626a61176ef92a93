// SPDX-License-Identifier: LGPL-2.1-or-later
// Writes the estimate of the current frame and owns the memory that it points into. Used by both pipelines.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "terrainseg/estimate.hpp"
#include "terrainseg/mask_target.hpp"
#include "terrainseg/terrain.hpp"

namespace terrainseg {

/// The share of the window's columns, in permille, that are free for at least `margin` rows of the frame
/// ahead of the window. `boundary` as in Estimate.
int free_permille_ahead(std::span<const std::uint16_t> boundary, int mask_level, const Rectangle& window,
                        int margin);

class EstimateWriter {
 public:
  /// Starts an estimate with the frame's size and window; all other fields are unknown. The mask is written
  /// to `target`, or to this object's memory when `target` is empty. Allocates only when the mask grows.
  void start(const Frame& frame, const MaskTarget& target, const Settings& settings, const Rectangle& window,
             std::uint64_t number);

  Estimate& estimate() { return estimate_; }
  const Estimate& estimate() const { return estimate_; }
  /// The caller fills estimate().mask and the boundary (one row of the frame per mask column).
  const MutablePlane& mask() const { return mask_plane_; }
  std::span<std::uint16_t> boundary() { return boundary_; }

  /// Creates estimate().confidence_map with `width` x `height` cells of 0, for the caller to fill. Allocates
  /// only when it grows.
  MutablePlane start_confidence_map(int width, int height);

  /// Writes an estimate without a terrain: the mask is 128, the boundary has no free space, flag_blocked is
  /// set.
  void label_unknown();

  /// Sets traversable_permille, and flag_blocked from the boundary: blocked when less than
  /// settings.blocked_below permille of the window's columns are free for one cell of `grid_level`.
  void tell_free_space(std::uint64_t traversable_pixels, const Settings& settings, int grid_level);

  /// Adds a learned model whose colours are in `space`.
  void add_model(const TerrainModel& model, const ColorSpace& space);

 private:
  std::vector<std::uint8_t> own_mask_, confidence_map_;
  std::vector<std::uint16_t> boundary_;
  MutablePlane mask_plane_;
  Estimate estimate_;
};

} // namespace terrainseg
