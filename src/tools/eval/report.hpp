// SPDX-License-Identifier: LGPL-2.1-or-later
// Figures as JSON, Markdown and pictures.
#pragma once

#include <ostream>
#include <string>
#include <vector>

#include "tools/eval/figures.hpp"

namespace terrainseg::eval {

void write_json(std::ostream& out, const std::vector<Figures>& all);

/// Reads what write_json() wrote: sequence, engine, input and each frame's error and unsafe share. Throws
/// std::runtime_error that names the file.
std::vector<Figures> read_json(const std::string& path);

/// One table per sequence and input: a row per engine.
void write_markdown(std::ostream& out, const std::vector<Figures>& all);

/// A matrix of "error / unsafe": engines (or inputs) down, sequences across.
void write_matrix(std::ostream& out, const std::vector<Figures>& all, bool by_input);

/// A frame with what is right (green), wrongly called ground (red), missed (blue) and doubtful (yellow).
cv::Mat3b judged(const cv::Mat3b& picture, const cv::Mat1b& labels, const cv::Mat1b& mask);

/// Tiles in rows of `across`, each scaled to `width`, with a caption.
struct Tile {
  cv::Mat3b picture;
  std::string caption;
};
cv::Mat3b contact_sheet(const std::vector<Tile>& tiles, int across, int width);

/// Lines over a common x axis. All y from 0.
struct Line {
  std::string name;
  std::vector<cv::Point2d> points;
};
cv::Mat3b line_plot(const std::string& title, const std::string& x_name, const std::string& y_name,
                    const std::vector<Line>& lines);

} // namespace terrainseg::eval
