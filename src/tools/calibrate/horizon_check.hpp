// SPDX-License-Identifier: LGPL-2.1-or-later
// Compares the horizon of a recording with the horizon of the mount.
#pragma once

#include <istream>
#include <vector>

#include "metric/mount.hpp"

namespace terrainseg::calibrate {

/// The horizon rows in a recording.
struct Horizons {
  int width = 0, height = 0; ///< size of the frames, pixels
  std::size_t frames = 0;
  std::vector<int> rows; ///< one row per confident frame
};

/// Minimum confidence of a horizon that is used (0..255).
inline constexpr int confident = 128;

/// Reads JSON lines of terrainextract or terrainseg-process. Throws std::runtime_error with the number of the
/// line.
Horizons read_horizons(std::istream& lines);

struct HorizonCheck {
  double row = 0, lower_quartile = 0, upper_quartile = 0; ///< row in the recording: median and quartiles
  double expected = 0; ///< row of the mount at the middle of the width; may be outside the picture
  double degrees = 0;  ///< angle by which the recording's horizon is below the mount's
};

/// Throws std::runtime_error if fewer than 30 frames were confident, or if the frames have other proportions
/// than the calibration.
HorizonCheck check_horizon(const Horizons& horizons, const metric::Camera& camera,
                           const metric::Mount& mount);

/// Row of the horizon at the middle of the width.
double horizon_row(const metric::Camera& camera, const metric::Mount& mount);

} // namespace terrainseg::calibrate
