// SPDX-License-Identifier: LGPL-2.1-or-later
#include "exchange/uas_datalink.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>

#include "exchange/vmti_codec.hpp"

namespace terrainseg {
namespace {

using namespace vmti;

/// Maps low..high to 0..2^bits - 1.
std::uint64_t unsigned_share(double value, double low, double high, int bits) {
  const double steps = std::ldexp(1.0, bits) - 1;
  return static_cast<std::uint64_t>(
      std::llround((std::clamp(value, low, high) - low) * steps / (high - low)));
}

/// Maps -limit..limit to -(2^(bits-1) - 1)..2^(bits-1) - 1 in two's complement; -2^(bits-1) means "out of
/// range".
std::uint64_t signed_share(double value, double limit, int bits) {
  const double steps = std::ldexp(1.0, bits - 1) - 1;
  const auto number = static_cast<std::uint64_t>(std::llround(std::clamp(value / limit, -1.0, 1.0) * steps));
  return number & ((std::uint64_t{1} << bits) - 1);
}

/// Writes an angle in the short item if it fits, otherwise in the item with the full range.
void put_angle(Bytes& set, double degrees, std::uint8_t tag, double limit, std::uint8_t full_tag) {
  constexpr double full_limit = 90;
  if (std::abs(degrees) <= limit)
    put_number(set, tag, signed_share(degrees, limit, 16), 2);
  else if (std::abs(degrees) <= full_limit)
    put_number(set, full_tag, signed_share(degrees, full_limit, 32), 4);
  else
    put_number(set, tag, 0x8000, 2);
}

} // namespace

const char* read_position(std::string_view text, UasPlatform& platform) {
  std::array<double, 4> numbers{};
  std::size_t count = 0;
  for (const char *at = text.data(), *const end = at + text.size();; ++at) {
    if (count == numbers.size())
      return "it has more than four numbers";
    while (at < end && *at == ' ')
      ++at;
    const auto [behind, error] = std::from_chars(at, end, numbers[count]);
    if (error != std::errc() || !std::isfinite(numbers[count]))
      return "it is not latitude,longitude,altitude as numbers with commas between";
    ++count;
    at = behind;
    if (at == end)
      break;
    if (*at != ',')
      return "something else than a comma follows a number";
  }
  if (count < 3)
    return "it needs three numbers: latitude,longitude,altitude";
  const auto& [latitude, longitude, altitude, heading] = numbers;
  if (std::abs(latitude) > 90)
    return "the latitude is not within -90 to 90 degrees";
  if (std::abs(longitude) > 180)
    return "the longitude is not within -180 to 180 degrees";
  if (altitude < -900 || altitude > 19000)
    return "the altitude is not within -900 to 19000 metres";
  if (count == 4 && (heading < 0 || heading > 360))
    return "the heading is not within 0 to 360 degrees";
  platform.position = {latitude, longitude, altitude};
  platform.heading = count == 4 ? std::optional(heading) : std::nullopt;
  return nullptr;
}

void put_platform(Bytes& set, const UasPlatform& platform) {
  if (platform.heading) {
    const double turn = std::fmod(*platform.heading, 360);
    put_number(set, uas_heading, unsigned_share(turn < 0 ? turn + 360 : turn, 0, 360, 16), 2);
  }
  if (platform.attitude) {
    put_angle(set, platform.attitude->pitch, uas_pitch, 20, uas_full_pitch);
    put_angle(set, platform.attitude->roll, uas_roll, 50, uas_full_roll);
  }
  if (platform.position) {
    put_number(set, uas_latitude, signed_share(platform.position->latitude, 90, 32), 4);
    put_number(set, uas_longitude, signed_share(platform.position->longitude, 180, 32), 4);
    put_number(set, uas_altitude, unsigned_share(platform.position->altitude, -900, 19000, 16), 2);
  }
  if (platform.attitude)
    for (const std::uint8_t tag : {uas_relative_azimuth, uas_relative_elevation, uas_relative_roll})
      put_number(set, tag, 0, 4);
}

} // namespace terrainseg
