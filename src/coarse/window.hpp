// SPDX-License-Identifier: LGPL-2.1-or-later
// Stages B and D: the training window and its pre-filter, the moments of its colours, and the horizon that
// follows from them (paper, sections 3.2 and 3.4).
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "base/fixed.hpp"
#include "coarse/grid.hpp"
#include "terrainseg/settings.hpp"
#include "terrainseg/supervision.hpp"
#include "terrainseg/terrain.hpp"

namespace terrainseg {

/// Mean and variance of colours from sums of z and z^2 over the samples (paper, equations (4), (5) and (9)).
/// The paper's (3) and (9) also multiply by the histogram, which would count samples repeatedly.
class MomentSums {
 public:
  void add(const Color& color) {
    ++count_;
    for (int c = 0; c < 3; ++c) {
      sum_[c] += color[c];
      squares_[c] += static_cast<std::uint64_t>(color[c]) * color[c];
    }
  }

  std::uint32_t count() const { return count_; }

  /// All values are 0 without samples.
  Gaussian moments() const {
    Gaussian result;
    result.mass = std::uint64_t{count_} << 8;
    for (int c = 0; c < 3 && count_ > 0; ++c) {
      result.mean[c] = static_cast<std::uint16_t>(rounded_quotient(sum_[c] << 8, count_));
      // Relative to the rounded-down mean, so that products fit 64 bits for every frame size.
      const std::uint64_t base = sum_[c] / count_, rest = sum_[c] - base * count_;
      const std::uint64_t around = squares_[c] + base * base * count_ - 2 * base * sum_[c];
      const std::uint64_t offset = (rest << 16) / count_; // Q16, below one unit
      const std::uint64_t power = rounded_quotient(around << 8, count_), lost = (offset * offset) >> 24;
      result.variance[c] = static_cast<std::uint32_t>(power > lost ? power - lost : 0);
    }
    return result;
  }

 private:
  std::uint32_t count_ = 0;
  std::array<std::uint64_t, 3> sum_{}, squares_{};
};

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

/// Stage D: the horizon (paper, equations (9) to (12)).
struct Horizon {
  int row = -1;                ///< row of the grid; -1 = none: the stage is skipped
  std::uint8_t confidence = 0; ///< how much less ground the row has than the others; 255 = none
};

/// Equation (10): whether every component of `color` is within two standard deviations of the ground.
/// Compares squares. The paper prints an interval around zero, and the variance instead of the deviation.
bool looks_like_ground(const Color& color, const Gaussian& ground);

/// Equation (11): the row above the window that has the fewest ground cells. `window_top` is the first row of
/// the window in the grid, `window_end` is exclusive. Terrain is kept from this row down (equation (12)
/// prints the opposite).
Horizon find_horizon(const Grid& grid, const Gaussian& ground, int window_top, int window_end);

} // namespace terrainseg
