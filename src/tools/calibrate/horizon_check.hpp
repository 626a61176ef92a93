// SPDX-License-Identifier: LGPL-2.1-or-later
// Whether a recording's horizon lies where the mount has it.
#pragma once

#include <istream>
#include <vector>

#include "metric/mount.hpp"

namespace terrainseg::calibrate {

/// Where the horizon was found in a recording.
struct Horizons {
  int width = 0, height = 0; ///< of the frames
  std::size_t frames = 0;
  std::vector<int> rows; ///< of the confident frames
};

/// A frame's horizon counts from this confidence on (0..255).
inline constexpr int confident = 128;

/// Reads JSON lines of terrainextract or terrainseg-process. Throws std::runtime_error with the line's
/// number.
Horizons read_horizons(std::istream& lines);

struct HorizonCheck {
  double row = 0, lower_quartile = 0, upper_quartile = 0; ///< the recording's, median and quartiles
  double expected = 0; ///< the mount's, at the middle of the width; may lie outside the picture
  double degrees = 0;  ///< by which the recording's horizon lies below the mount's
};

/// Throws std::runtime_error when fewer than 30 frames were confident, or when the frames have other
/// proportions than the calibration.
HorizonCheck check_horizon(const Horizons& horizons, const metric::Camera& camera,
                           const metric::Mount& mount);

/// The row of the horizon at the middle of the width.
double horizon_row(const metric::Camera& camera, const metric::Mount& mount);

} // namespace terrainseg::calibrate
