// SPDX-License-Identifier: LGPL-2.1-or-later
#include "tools/calibrate/horizon_check.hpp"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>
#include <stdexcept>
#include <string>

#include "exchange/counted.hpp"
#include "tools/calibrate/files.hpp"
#include "tools/calibrate/mount_fit.hpp"

namespace terrainseg::calibrate {
namespace {

constexpr std::size_t fewest_frames = 30;

/// Quantile of sorted values.
double quantile(const std::vector<int>& sorted, double share) {
  const double at = share * static_cast<double>(sorted.size() - 1);
  const std::size_t low = static_cast<std::size_t>(at), high = std::min(low + 1, sorted.size() - 1);
  return sorted[low] + (sorted[high] - sorted[low]) * (at - static_cast<double>(low));
}

/// An integer up to the largest valid picture size. Other numbers and texts are not from this project's
/// lines.
int within_a_picture(const nlohmann::json& json) {
  constexpr int most = 1 << 18;
  const auto& value = json.get_ref<const nlohmann::json::number_integer_t&>();
  if (value < -most || value > most)
    throw std::runtime_error(json.dump() + " belongs to no picture");
  return static_cast<int>(value);
}

} // namespace

Horizons read_horizons(std::istream& lines) {
  Horizons out;
  std::string line;
  for (std::size_t number = 1; std::getline(lines, line); ++number) {
    if (line.find_first_not_of(" \t\r") == line.npos)
      continue;
    try {
      const nlohmann::json frame = nlohmann::json::parse(line);
      const int width = within_a_picture(frame.at("width")), height = within_a_picture(frame.at("height"));
      if (out.frames && (width != out.width || height != out.height))
        throw std::runtime_error("the frames' size changes; check one recording at a time");
      out.width = width;
      out.height = height;
      ++out.frames;
      const nlohmann::json& horizon = frame.at("horizon");
      if (!horizon.at("row").is_null() && within_a_picture(horizon.at("confidence")) >= confident)
        out.rows.push_back(within_a_picture(horizon.at("row")));
    } catch (const nlohmann::json::exception&) {
      throw std::runtime_error("line " + std::to_string(number) +
                               ": no JSON line of terrainextract or terrainseg-process (--outputs json)");
    } catch (const std::runtime_error& error) {
      throw std::runtime_error("line " + std::to_string(number) + ": " + error.what());
    }
  }
  if (out.frames && (out.width < 1 || out.height < 1 || out.width > 32767 || out.height > 32767))
    throw std::runtime_error("width and height are not within 1..32767");
  return out;
}

double horizon_row(const metric::Camera& camera, const metric::Mount& mount) {
  // The horizontal ray of the middle column: -sin p - cos p (sin r x + cos r y) = 0.
  const double x = ((camera.width - 1) / 2.0 - camera.cx) / camera.fx;
  const double y = (-std::tan(mount.pitch) - std::sin(mount.roll) * x) / std::cos(mount.roll);
  return metric::distort(camera, {x, y}).y;
}

HorizonCheck check_horizon(const Horizons& horizons, const metric::Camera& calibrated,
                           const metric::Mount& mount) {
  if (horizons.rows.size() < fewest_frames)
    throw std::runtime_error("the horizon was found with confidence in " +
                             std::to_string(horizons.rows.size()) + " of " +
                             counted(horizons.frames, "frame") +
                             ", 30 are needed: record open, flat ground with the horizon in view");
  const metric::Camera camera = fitted(calibrated, horizons.width, horizons.height);
  std::vector<int> sorted = horizons.rows;
  std::ranges::sort(sorted);
  HorizonCheck check{.row = quantile(sorted, 0.5),
                     .lower_quartile = quantile(sorted, 0.25),
                     .upper_quartile = quantile(sorted, 0.75),
                     .expected = horizon_row(camera, mount)};
  const auto ray = metric::undistort(camera, (camera.width - 1) / 2.0, check.row);
  if (!ray)
    throw std::runtime_error("the lens model has no ray at row " + std::to_string(check.row) +
                             ": is the calibration this camera's?");
  check.degrees = descent(mount, *ray) * 180 / std::numbers::pi;
  return check;
}

} // namespace terrainseg::calibrate
