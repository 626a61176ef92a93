// SPDX-License-Identifier: LGPL-2.1-or-later
// Position and attitude of the camera as items of a MISB ST 0601 UAS Datalink Local Set. ST 0601 maps ranges
// of degrees and metres linearly to integers (table: docs/klv.md).
#pragma once

#include <cstdint>
#include <optional>
#include <string_view>
#include <vector>

namespace terrainseg {

/// Angles to the horizontal plane, in degrees. The platform of ST 0601 is the camera: its axes are the
/// camera's.
struct UasAttitude {
  double pitch = 0; ///< positive = looks up
  double roll = 0;  ///< positive = right side down
};

struct UasPosition {
  double latitude = 0;  ///< degrees, -90..90, north is positive
  double longitude = 0; ///< degrees, -180..180, east is positive
  double altitude = 0;  ///< metres above mean sea level, -900..19000
};

/// The known values of the platform. Unknown values are not written.
struct UasPlatform {
  std::optional<double> heading; ///< direction of the camera, degrees clockwise from north, any value
  std::optional<UasAttitude> attitude;
  std::optional<UasPosition> position;
};

/// Parses `latitude,longitude,altitude` or `latitude,longitude,altitude,heading` (degrees, metres, decimal
/// points). Returns nullptr, or the error as the end of a sentence; then `platform` is unchanged.
const char* read_position(std::string_view text, UasPlatform& platform);

/// Appends the items of the known values.
void put_platform(std::vector<std::uint8_t>& set, const UasPlatform& platform);

} // namespace terrainseg
