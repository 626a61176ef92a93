// SPDX-License-Identifier: LGPL-2.1-or-later
#include "metric/mount.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <numbers>
#include <set>

namespace terrainseg::metric {
namespace {

constexpr double steepest = 80 * std::numbers::pi / 180;

struct Key {
  std::string_view name;
  double Mount::*field;
  bool angle;
};
constexpr Key keys[] = {{"height", &Mount::height, false},
                        {"pitch", &Mount::pitch, true},
                        {"roll", &Mount::roll, true},
                        {"yaw", &Mount::yaw, true},
                        {"x", &Mount::x, false},
                        {"y", &Mount::y, false},
                        {"pitch-error", &Mount::pitch_error, true}};

std::string quoted(std::string_view text) {
  std::string out(1, '\'');
  return out.append(text).append("': ");
}

std::string_view trimmed(std::string_view text) {
  text.remove_prefix(std::min(text.find_first_not_of(" \t"), text.size()));
  return text.substr(0, text.find_last_not_of(" \t") + 1);
}

} // namespace

std::string flaw_of(const Mount& mount) {
  for (const Key& key : keys)
    if (!std::isfinite(mount.*key.field))
      return std::string(key.name) + " is not a finite number";
  if (mount.height <= 0 || mount.height > 1000)
    return "height = " + std::to_string(mount.height) +
           " m is not above 0 and at most 1000: measure from the ground to the lens";
  if (std::abs(mount.pitch) > steepest)
    return "pitch = " + std::to_string(mount.pitch) +
           " rad is steeper than 80 degrees: angles are radians, or degrees with the suffix deg "
           "(pitch=10deg)";
  if (std::abs(mount.roll) > std::numbers::pi || std::abs(mount.yaw) > std::numbers::pi)
    return "roll and yaw must lie within -180..180 degrees: angles are radians, or degrees with the suffix "
           "deg";
  if (mount.pitch_error < 0 || mount.pitch_error > 0.5)
    return "pitch-error must lie within 0..0.5 rad";
  return {};
}

std::optional<Mount> parse_mount(std::string_view text, std::string& error) {
  Mount mount;
  std::set<const Key*> stated;
  while (!text.empty()) {
    const std::size_t comma = text.find(',');
    const std::string_view item = trimmed(text.substr(0, comma));
    text.remove_prefix(comma == text.npos ? text.size() : comma + 1);
    const std::size_t equals = item.find('=');
    std::string name(trimmed(item.substr(0, equals)));
    std::replace(name.begin(), name.end(), '_', '-');
    const Key* known = nullptr;
    for (const Key& key : keys)
      if (key.name == name)
        known = &key;
    if (known && !stated.insert(known).second) {
      error = quoted(item) + known->name.data() + " is stated twice";
      return std::nullopt;
    }
    if (equals == item.npos || !known) {
      error =
          quoted(item) + "known are height=, pitch=, roll=, yaw=, x=, y=, pitch-error=, separated by commas";
      return std::nullopt;
    }
    std::string_view number = trimmed(item.substr(equals + 1));
    bool degrees = false;
    if (known->angle && number.size() > 3 && number.substr(number.size() - 3) == "deg") {
      degrees = true;
      number = trimmed(number.substr(0, number.size() - 3));
    }
    if (!number.empty() && number.front() == '+')
      number.remove_prefix(1);
    double value = 0;
    const auto [end, status] = std::from_chars(number.data(), number.data() + number.size(), value);
    if (status != std::errc{} || end != number.data() + number.size()) {
      error = quoted(item) + std::string(number) + " is not a number" +
              (known->angle ? " of radians, or of degrees with the suffix deg" : " of metres");
      return std::nullopt;
    }
    mount.*known->field = degrees ? value * std::numbers::pi / 180 : value;
  }
  if (!stated.count(&keys[0])) {
    error = "height is missing: the metres from the ground to the lens";
    return std::nullopt;
  }
  error = flaw_of(mount);
  return error.empty() ? std::optional(mount) : std::nullopt;
}

GroundProjection::GroundProjection(const Mount& mount) : height_(mount.height), x_(mount.x), y_(mount.y) {
  const double cr = std::cos(mount.roll), sr = std::sin(mount.roll), cp = std::cos(mount.pitch),
               sp = std::sin(mount.pitch), cy = std::cos(mount.yaw), sy = std::sin(mount.yaw);
  rotation_ = {{{cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr},
                {sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr},
                {-sp, cp * sr, cp * cr}}};
}

std::optional<GroundPoint> GroundProjection::operator()(const ImagePoint& ray) const {
  const double down = -along(2, ray);
  if (!(down > least_descent))
    return std::nullopt;
  const double t = height_ / down;
  return GroundPoint{x_ + t * along(0, ray), y_ + t * along(1, ray)};
}

std::optional<ImagePoint> GroundProjection::ray_to(const GroundPoint& point) const {
  const double to[3] = {point.x - x_, point.y - y_, -height_};
  double seen[3]{}; // along the camera's forward, left and upward axes
  for (int axis = 0; axis < 3; ++axis)
    for (int i = 0; i < 3; ++i)
      seen[axis] += rotation_[i][axis] * to[i];
  if (!(seen[0] > least_descent * height_))
    return std::nullopt;
  return ImagePoint{-seen[1] / seen[0], -seen[2] / seen[0]};
}

std::optional<double> vanishing_row(const Mount& mount, const Camera& camera) {
  const GroundProjection ground(mount);
  const auto& up = ground.row(2);
  if (!(up[2] > least_descent))
    return std::nullopt;
  const ImagePoint level{0, up[0] / up[2]}; // along(2, level) = 0
  const ImagePoint pixel = distort(camera, level);
  const auto back = undistort(camera, pixel.x, pixel.y);
  constexpr double same = 1e-3; // beyond the lens's range the polynomial comes back elsewhere
  if (!back || !(std::abs(back->y - level.y) <= same * (1 + std::abs(level.y))))
    return std::nullopt;
  return pixel.y;
}

std::optional<std::int32_t> vanishing_row_q8(const Mount& mount, const Camera& camera) {
  const auto row = vanishing_row(mount, camera);
  if (!row)
    return std::nullopt;
  const double farthest = 4.0 * camera.height;
  return static_cast<std::int32_t>(std::lround(std::clamp(*row, -farthest, farthest) * 256));
}

} // namespace terrainseg::metric
