// SPDX-License-Identifier: LGPL-2.1-or-later
// Where the camera is and how it is held, as items of a MISB ST 0601 UAS Datalink Local Set. ST 0601 maps
// ranges of degrees and metres linearly to whole numbers; docs/klv.md has the table.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace terrainseg {

/// Degrees against the level. The platform of ST 0601 is the camera itself: its axes are the camera's.
struct UasAttitude {
  double pitch = 0; ///< positive = looks up
  double roll = 0;  ///< positive = right side down
};

struct UasPosition {
  double latitude = 0;  ///< degrees, -90..90, north is positive
  double longitude = 0; ///< degrees, -180..180, east is positive
  double altitude = 0;  ///< metres above mean sea level, -900..19000
};

/// What is known of the platform; what is not leaves its items out.
struct UasPlatform {
  std::optional<double> heading; ///< degrees clockwise from north to where the camera looks, any turn
  std::optional<UasAttitude> attitude;
  std::optional<UasPosition> position;
};

/// Reads `latitude,longitude,altitude` or `latitude,longitude,altitude,heading` (degrees, metres; a point is
/// the decimal mark). nullptr, or what is wrong, as the rest of a sentence; `platform` is unchanged then.
const char* read_position(std::string_view text, UasPlatform& platform);

/// Appends the items of what is known.
void put_platform(std::vector<std::uint8_t>& set, const UasPlatform& platform);

} // namespace terrainseg
