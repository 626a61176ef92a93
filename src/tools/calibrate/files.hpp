// SPDX-License-Identifier: LGPL-2.1-or-later
// Reads and writes the tool's files and parses its values: ground points, chessboards, mounts. Every function
// throws std::runtime_error, for a file with its name; for a value it is tools::UsageError.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "metric/mount.hpp"

namespace terrainseg::calibrate {

/// A point of flat ground: its pixel (centres have integer coordinates) and its distance over ground from the
/// point below the lens, metres.
struct MeasuredPoint {
  double u = 0, v = 0, distance = 0;
};

/// A chessboard.
struct Board {
  int columns = 9, rows = 6; ///< inner corners
  double square = 1;         ///< side of a square, metres; does not change the calibration
};

/// Parses `9x6`.
Board parse_board(const std::string& text);

/// Parses a number that is the whole text, with a decimal point in every locale. `what` begins the error.
double parse_number(std::string_view text, std::string_view what);

/// Parses `U,V,METRES`. The error has the text.
MeasuredPoint parse_point(std::string_view text);

/// Reads one point a line; ignores empty lines and text after `#`. Throws with the number of the line.
std::vector<MeasuredPoint> parse_points(std::string_view text);

std::string read_file(const std::string& path);
/// Writes a file atomically.
void write_file(const std::string& path, const std::string& bytes);

metric::Camera read_camera(const std::string& path);
/// Reads a mount file, or parses its text: `height=0.5,pitch=10deg`.
metric::Mount read_mount_argument(const std::string& argument);

/// Scales a calibration to pictures of another size with the same proportions. Throws if the proportions
/// differ, because the pictures were then cropped.
metric::Camera fitted(const metric::Camera& camera, int width, int height);

} // namespace terrainseg::calibrate
