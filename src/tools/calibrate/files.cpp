// SPDX-License-Identifier: LGPL-2.1-or-later
#include "tools/calibrate/files.hpp"

#include <glib.h>

#include <charconv>
#include <cmath>
#include <stdexcept>

#include "metric/camera_info.hpp"
#include "tools/command_line.hpp"

namespace terrainseg::calibrate {

using tools::UsageError;

namespace {

std::string_view trimmed(std::string_view text) {
  constexpr std::string_view blank = " \t\r";
  const std::size_t first = text.find_first_not_of(blank);
  return first == text.npos ? std::string_view()
                            : text.substr(first, text.find_last_not_of(blank) - first + 1);
}

/// Removes the text before the next `mark` from the front of `text` and returns it.
std::string_view next(std::string_view& text, char mark) {
  const std::size_t end = text.find(mark);
  const std::string_view part = text.substr(0, end);
  text.remove_prefix(end == text.npos ? text.size() : end + 1);
  return part;
}

} // namespace

std::string read_file(const std::string& path) {
  g_autofree gchar* bytes = nullptr;
  gsize size = 0;
  g_autoptr(GError) error = nullptr;
  if (!g_file_get_contents(path.c_str(), &bytes, &size, &error))
    throw std::runtime_error(error->message);
  return {bytes, size};
}

void write_file(const std::string& path, const std::string& bytes) {
  g_autoptr(GError) error = nullptr;
  if (!g_file_set_contents(path.c_str(), bytes.data(), static_cast<gssize>(bytes.size()), &error))
    throw std::runtime_error(error->message);
}

metric::Camera read_camera(const std::string& path) {
  std::string error;
  const auto camera = metric::read_camera_info(read_file(path), error);
  if (!camera)
    throw std::runtime_error(path + ": " + error);
  return *camera;
}

metric::Mount read_mount_argument(const std::string& argument) {
  const bool is_text = argument.find('=') != argument.npos;
  std::string error;
  const auto mount =
      is_text ? metric::parse_mount(argument, error) : metric::read_mount(read_file(argument), error);
  if (!mount)
    throw std::runtime_error((is_text ? "--mount: " : argument + ": ") + error);
  return *mount;
}

metric::Camera fitted(const metric::Camera& camera, int width, int height) {
  const double across = static_cast<double>(width) / camera.width,
               down = static_cast<double>(height) / camera.height;
  if (std::abs(across / down - 1) > 0.02)
    throw std::runtime_error("the pictures are " + std::to_string(width) + "x" + std::to_string(height) +
                             ", the calibration is for " + std::to_string(camera.width) + "x" +
                             std::to_string(camera.height) +
                             " and has other proportions: a cut-out needs a calibration of its own");
  return metric::scaled(camera, width, height);
}

double parse_number(std::string_view text, std::string_view what) {
  text = trimmed(text);
  double value = 0;
  const auto [end, status] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (status != std::errc{} || end != text.data() + text.size() || !std::isfinite(value))
    throw UsageError(std::string(what) + ": '" + std::string(text) + "' is not a number");
  return value;
}

MeasuredPoint parse_point(std::string_view text) {
  const std::string what = "point '" + std::string(trimmed(text)) + "'";
  double values[3];
  std::string_view rest = text;
  for (double& value : values) {
    if (rest.empty())
      throw UsageError(what + ": three numbers are needed, column,row,metres such as 640,400,2.5");
    value = parse_number(next(rest, ','), what);
  }
  if (!trimmed(rest).empty())
    throw UsageError(what + ": more than three numbers; column,row,metres are needed (a decimal "
                            "point is a point, not a comma)");
  if (values[2] <= 0)
    throw UsageError(what + ": the distance must be above 0 m");
  return {values[0], values[1], values[2]};
}

std::vector<MeasuredPoint> parse_points(std::string_view text) {
  std::vector<MeasuredPoint> points;
  for (int number = 1; !text.empty(); ++number) {
    std::string_view line = next(text, '\n');
    line = trimmed(next(line, '#'));
    if (line.empty())
      continue;
    try {
      points.push_back(parse_point(line));
    } catch (const std::runtime_error& error) {
      throw std::runtime_error("line " + std::to_string(number) + ": " + error.what());
    }
  }
  return points;
}

Board parse_board(const std::string& text) {
  std::string_view rest = text;
  const bool two = text.find('x') != text.npos;
  const double columns = two ? parse_number(next(rest, 'x'), "--board") : 0,
               rows = two ? parse_number(rest, "--board") : 0;
  for (const double side : {columns, rows})
    if (side < 3 || side > 100 || side != std::floor(side))
      throw UsageError(
          "--board: '" + text +
          "' is not COLUMNSxROWS of inner corners, each 3..100 (a board of 10x7 squares has 9x6)");
  return {.columns = static_cast<int>(columns), .rows = static_cast<int>(rows)};
}

} // namespace terrainseg::calibrate
