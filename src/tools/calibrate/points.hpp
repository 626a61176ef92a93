// SPDX-License-Identifier: LGPL-2.1-or-later
// What a user measured, as text: points of the ground, a chessboard.
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace terrainseg::calibrate {

/// A point of flat ground: its pixel (centres have integer coordinates) and its distance over ground from the
/// point below the lens, metres.
struct MeasuredPoint {
  double u = 0, v = 0, distance = 0;
};

/// A chessboard.
struct Board {
  int columns = 9, rows = 6; ///< inner corners
  double square = 1;         ///< side of a square, metres; the calibration does not depend on it
};

/// `9x6`; throws std::runtime_error.
Board parse_board(const std::string& text);

/// A number in full, whatever the locale; throws std::runtime_error that names `what`.
double parse_number(std::string_view text, std::string_view what);

/// `U,V,METRES`; throws std::runtime_error that quotes the text.
MeasuredPoint parse_point(std::string_view text);

/// One point a line; empty lines and what follows a `#` are passed over. Throws with the number of the line.
std::vector<MeasuredPoint> parse_points(std::string_view text);

} // namespace terrainseg::calibrate
