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

/// The window in a frame, or nothing when the configured window does not fit. Automatic sides (0) are limited
/// to the space that `window_bottom` and `window_x` leave. `window_rect_q16` always fits.
std::optional<Rectangle> place_window(const Settings& settings, int frame_width, int frame_height);

/// The error message for a configured window that does not fit.
std::string window_does_not_fit(const Settings& settings, int frame_width, int frame_height);

/// The training pixels of a frame: the window, or the supervision that replaces it, without ignored and
/// vetoed pixels.
struct TrainingArea {
  Rectangle window;
  Supervision supervision;            ///< replaces the window unless it is empty
  std::span<const Rectangle> ignored; ///< in pixels of the frame
  int frame_width = 0, frame_height = 0;
  VetoArea veto{}; ///< cells with a vetoed pixel are excluded
};

/// Fills `cells` with the training cells of a pyramid level, row by row. Keeps the capacity.
void select_cells(const TrainingArea& area, int level, std::vector<Cell>& cells);

/// The coarsest level <= `coarsest` with at least `needed` training cells, or 0 when there is none. Fills
/// `cells` with that level's. The paper's window has eight cells at 1/32, too few for K = 3 Gaussians.
int select_training_level(const TrainingArea& area, int coarsest, int needed, std::vector<Cell>& cells);

/// The bounding box of the training pixels in the frame: the window, or the supervision that replaces it.
Rectangle training_bounds(const TrainingArea& area, int level, std::span<const Cell> cells);

/// Mean and variance over cells (equations (4), (5), (9)).
Gaussian moments_of(const Grid& grid, std::span<const Cell> cells);

struct PrefilterRule {
  /// Which cells are kept when few pass.
  enum class Scarce : std::uint8_t {
    nearest_half,          ///< at least the half of the cells that is nearest to the mean
    all_below_one_quarter, ///< all cells when less than a quarter passes
  };
  int sigma_q8 = 256;               ///< standard deviations in Q8
  std::uint32_t variance_floor = 0; ///< Q8, added to each variance
  Scarce scarce = Scarce::nearest_half;
};

/// Cells that passed, in their order, and working memory that is kept from frame to frame.
struct Prefiltered {
  std::vector<Cell> cells;
  std::vector<std::uint64_t> distances, ranks;
};

/// Keeps the cells of which every component is within `sigma` standard deviations of the mean (caption of
/// figure 5). Compares squares, so that no root is needed.
void prefilter(const Grid& grid, std::span<const Cell> cells, const Gaussian& moments,
               const PrefilterRule& rule, Prefiltered& kept);

} // namespace terrainseg
