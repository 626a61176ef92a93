// SPDX-License-Identifier: LGPL-2.1-or-later
// Stage B: the training window and its pre-filter (paper, section 3.2).
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "coarse/grid.hpp"
#include "coarse/moments.hpp"
#include "coarse/veto.hpp"
#include "terrainseg/settings.hpp"
#include "terrainseg/supervision.hpp"

namespace terrainseg {

/// Where the window lies in a frame, or nothing when the window that was set does not fit. Automatic sides
/// (0) shrink to what `window_bottom` and `window_x` leave of the frame. `window_rect_q16` always fits.
std::optional<Rectangle> place_window(const Settings& settings, int frame_width, int frame_height);

/// That the window which was set does not fit, for a person.
std::string window_does_not_fit(const Settings& settings, int frame_width, int frame_height);

/// Which pixels of a frame train: the window, or the supervision that stands in for it, without what is
/// ignored or vetoed.
struct TrainingArea {
  Rectangle window;
  Supervision supervision;            ///< used instead of the window where not empty
  std::span<const Rectangle> ignored; ///< frame pixels
  int frame_width = 0, frame_height = 0;
  VetoArea veto{}; ///< a cell with a vetoed pixel does not train
};

/// Fills `cells` with the cells of a pyramid level that train, in raster order. Capacity is kept.
void select_cells(const TrainingArea& area, int level, std::vector<Cell>& cells);

/// The coarsest level <= `coarsest` at which at least `needed` cells train, or 0 where none has them; `cells`
/// are that level's. Eight cells, what the paper's window has at 1/32, cannot carry K = 3 Gaussians.
int select_training_level(const TrainingArea& area, int coarsest, int needed, std::vector<Cell>& cells);

/// The bounding box of what trains, in frame pixels: the window, or what stands in for it.
Rectangle training_bounds(const TrainingArea& area, int level, std::span<const Cell> cells);

/// Mean and variance over cells (equations (4), (5), (9)).
Gaussian moments_of(const Grid& grid, std::span<const Cell> cells);

struct PrefilterRule {
  /// What happens when few cells survive.
  enum class Scarce : std::uint8_t {
    nearest_half,          ///< the half that is nearest to the mean stays (never fewer than half)
    all_below_one_quarter, ///< everything stays when less than a quarter would
  };
  int sigma_q8 = 256;               ///< standard deviations in Q8
  std::uint32_t variance_floor = 0; ///< Q8, added to each variance
  Scarce scarce = Scarce::nearest_half;
};

/// Cells that passed, in their order, and room to work in that is kept from frame to frame.
struct Prefiltered {
  std::vector<Cell> cells;
  std::vector<std::uint64_t> distances, ranks;
};

/// Keeps the cells whose every component lies within `sigma` standard deviations of the mean (caption of
/// figure 5). Squares are compared: no root is taken.
void prefilter(const Grid& grid, std::span<const Cell> cells, const Gaussian& moments,
               const PrefilterRule& rule, Prefiltered& kept);

} // namespace terrainseg
