// SPDX-License-Identifier: LGPL-2.1-or-later
#include "tools/eval/report.hpp"

#include <algorithm>
#include <cmath>
#include <fstream>
#include <iomanip>
#include <limits>
#include <set>
#include <sstream>
#include <stdexcept>

#include <nlohmann/json.hpp>
#include <opencv2/imgproc.hpp>

namespace terrainseg::eval {
namespace {

std::string text(double value, int digits = 1) {
  std::ostringstream out;
  out << std::fixed << std::setprecision(digits) << value;
  return out.str();
}

std::string text(const std::optional<double>& value, int digits = 1) {
  return value ? text(*value, digits) : "-";
}

std::string quoted(const std::string& s) {
  std::string out = "\"";
  for (const char c : s) {
    if (c == '"' || c == '\\')
      out += '\\';
    out += static_cast<unsigned char>(c) < 32 ? ' ' : c;
  }
  return out + '"';
}

std::string json(const std::optional<double>& value) {
  return value ? text(*value, 3) : "null";
}

void write_counts(std::ostream& out, const char* name, const Counts& c) {
  out << "   " << quoted(name) << ": {\"error\": " << text(c.error(), 3) << ", \"iou\": " << text(c.iou(), 3)
      << ", \"precision\": " << text(c.precision(), 3) << ", \"recall\": " << text(c.recall(), 3)
      << ", \"f\": " << text(c.f_measure(), 3) << ", \"unsafe\": " << text(c.unsafe_share(), 3)
      << ", \"false_safe\": " << text(c.false_safe_share(), 3) << "},\n";
}

std::vector<std::string> distinct(const std::vector<Figures>& all, std::string Figures::*member) {
  std::vector<std::string> values;
  for (const Figures& f : all)
    if (std::find(values.begin(), values.end(), f.*member) == values.end())
      values.push_back(f.*member);
  return values;
}

} // namespace

void write_json(std::ostream& out, const std::vector<Figures>& all) {
  out << "{\"runs\": [\n";
  for (std::size_t i = 0; i < all.size(); ++i) {
    const Figures& f = all[i];
    out << "  {\"sequence\": " << quoted(f.sequence) << ", \"engine\": " << quoted(f.engine)
        << ", \"input\": " << quoted(f.input) << ", \"width\": " << f.width << ", \"height\": " << f.height
        << ",\n";
    write_counts(out, "ground", f.ground);
    write_counts(out, "terrain", f.terrain);
    write_counts(out, "doubtful_as_ground", f.without_doubt_zone);
    out << "   \"horizon\": {\"median\": " << json(f.horizon.median) << ", \"p90\": " << json(f.horizon.p90)
        << ", \"null\": " << json(f.horizon_null)
        << "},\n   \"boundary\": {\"within\": " << json(f.boundary_within)
        << ", \"over\": " << json(f.boundary_over) << "},\n   \"flicker\": " << json(f.flicker)
        << ", \"frame_error\": {\"median\": " << json(f.frame_error.median)
        << ", \"p90\": " << json(f.frame_error.p90)
        << "},\n   \"confidence_rank\": " << json(f.confidence_rank)
        << ", \"milliseconds\": {\"median\": " << json(f.latency.median)
        << ", \"p99\": " << json(f.latency.p90) << "},\n   \"frame_errors\": [";
    for (std::size_t k = 0; k < f.frames.size(); ++k)
      out << (k ? ", " : "") << text(f.frames[k].error, 3);
    out << "],\n   \"frame_unsafe\": [";
    for (std::size_t k = 0; k < f.frames.size(); ++k)
      out << (k ? ", " : "") << text(f.frames[k].unsafe, 3);
    out << "]}" << (i + 1 < all.size() ? "," : "") << '\n';
  }
  out << "]}\n";
}

std::vector<Figures> read_json(const std::string& path) {
  std::ifstream file(path);
  if (!file)
    throw std::runtime_error(path + ": cannot be read");
  try {
    std::vector<Figures> all;
    const nlohmann::json document = nlohmann::json::parse(file);
    for (const auto& run : document.at("runs")) {
      Figures f;
      f.sequence = run.at("sequence");
      f.engine = run.at("engine");
      f.input = run.at("input");
      const std::vector<double> errors = run.at("frame_errors"), unsafe = run.at("frame_unsafe");
      for (std::size_t i = 0; i < errors.size(); ++i) {
        FrameFigures frame;
        frame.index = i;
        frame.error = errors[i];
        frame.unsafe = unsafe.at(i);
        f.frames.push_back(frame);
      }
      all.push_back(std::move(f));
    }
    return all;
  } catch (const std::exception&) {
    throw std::runtime_error(path + ": not the JSON that --json writes");
  }
}

void write_markdown(std::ostream& out, const std::vector<Figures>& all) {
  for (const std::string& sequence : distinct(all, &Figures::sequence))
    for (const std::string& input : distinct(all, &Figures::input)) {
      bool head = false;
      for (const Figures& f : all) {
        if (f.sequence != sequence || f.input != input)
          continue;
        if (!head)
          out << "\n**" << sequence << "**" << (input == "as it is" ? "" : ", " + input) << " ("
              << f.frames.size() << " frames, " << f.width << "x" << f.height << ")\n\n"
              << "| engine | error | p50 / p90 of frames | unsafe | false-safe | precision | recall | IoU | "
                 "F | terrain "
                 "error | horizon p50 / p90 (null) | boundary within 2 % (beyond) | flicker | confidence "
                 "rank | ms p50 "
                 "/ p99 |\n|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|\n";
        head = true;
        out << "| " << f.engine << " | " << text(f.ground.error(), 2) << " | " << text(f.frame_error.median)
            << " / " << text(f.frame_error.p90) << " | " << text(f.ground.unsafe_share()) << " | "
            << text(f.ground.false_safe_share()) << " | " << text(f.ground.precision()) << " | "
            << text(f.ground.recall()) << " | " << text(f.ground.iou()) << " | " << text(f.ground.f_measure())
            << " | " << text(f.terrain.error(), 2) << " | " << text(f.horizon.median) << " / "
            << text(f.horizon.p90) << " (" << text(f.horizon_null, 0) << ") | " << text(f.boundary_within)
            << " (" << text(f.boundary_over) << ") | " << text(f.flicker, 2) << " | "
            << text(f.confidence_rank, 2) << " | " << text(f.latency.median, 2) << " / "
            << text(f.latency.p90, 2) << " |\n";
      }
    }
}

void write_matrix(std::ostream& out, const std::vector<Figures>& all, bool by_input) {
  const auto sequences = distinct(all, &Figures::sequence);
  std::string Figures::*row = by_input ? &Figures::input : &Figures::engine;
  out << "\n| error / unsafe, % |";
  for (const std::string& s : sequences)
    out << ' ' << s << " |";
  out << " mean |\n|---|";
  for (std::size_t i = 0; i <= sequences.size(); ++i)
    out << "---|";
  out << '\n';
  for (const std::string& name : distinct(all, row)) {
    out << "| " << name << " |";
    double error = 0, unsafe = 0;
    int count = 0;
    for (const std::string& s : sequences) {
      const auto f = std::find_if(all.begin(), all.end(),
                                  [&](const Figures& g) { return g.sequence == s && g.*row == name; });
      if (f == all.end()) {
        out << " - |";
        continue;
      }
      out << ' ' << text(f->ground.error(), 2) << " / " << text(f->ground.unsafe_share()) << " |";
      error += f->ground.error();
      unsafe += f->ground.unsafe_share();
      ++count;
    }
    out << ' ' << (count ? text(error / count, 2) + " / " + text(unsafe / count) : "-") << " |\n";
  }
}

cv::Mat3b judged(const cv::Mat3b& picture, const cv::Mat1b& labels, const cv::Mat1b& mask) {
  cv::Mat3b out = picture.clone();
  for (int y = 0; y < out.rows; ++y)
    for (int x = 0; x < out.cols; ++x) {
      const int label = labels(y, x), said = mask(y, x);
      if (label == label_none)
        continue;
      const bool truth = label == label_terrain || label == label_ground;
      cv::Vec3b color;
      if (said >= 192)
        color = truth ? cv::Vec3b(60, 190, 60) : cv::Vec3b(40, 40, 230);
      else if (said >= 64)
        color = cv::Vec3b(40, 210, 230);
      else if (truth)
        color = cv::Vec3b(230, 80, 40);
      else
        continue;
      for (int c = 0; c < 3; ++c)
        out(y, x)[c] = static_cast<std::uint8_t>((out(y, x)[c] + color[c]) / 2);
    }
  return out;
}

cv::Mat3b contact_sheet(const std::vector<Tile>& tiles, int across, int width) {
  if (tiles.empty())
    return {};
  const cv::Mat3b& first = tiles[0].picture;
  const cv::Size size(width, width * first.rows / first.cols);
  const int down = (static_cast<int>(tiles.size()) + across - 1) / across;
  cv::Mat3b sheet(down * size.height, across * size.width, cv::Vec3b(255, 255, 255));
  for (std::size_t i = 0; i < tiles.size(); ++i) {
    cv::Mat3b tile;
    cv::resize(tiles[i].picture, tile, size, 0, 0, cv::INTER_AREA);
    cv::putText(tile, tiles[i].caption, {6, 16}, cv::FONT_HERSHEY_SIMPLEX, 0.42, {0, 0, 0}, 3, cv::LINE_AA);
    cv::putText(tile, tiles[i].caption, {6, 16}, cv::FONT_HERSHEY_SIMPLEX, 0.42, {255, 255, 255}, 1,
                cv::LINE_AA);
    const int row = static_cast<int>(i) / across, column = static_cast<int>(i) % across;
    tile.copyTo(sheet(cv::Rect({column * size.width, row * size.height}, size)));
  }
  return sheet;
}

cv::Mat3b line_plot(const std::string& title, const std::string& x_name, const std::string& y_name,
                    const std::vector<Line>& lines) {
  const cv::Rect area(60, 34, 620, 290);
  cv::Mat3b plot(370, 900, cv::Vec3b(255, 255, 255));
  double left = std::numeric_limits<double>::max(), right = -left, top = 1e-9;
  for (const Line& line : lines)
    for (const cv::Point2d& p : line.points) {
      left = std::min(left, p.x);
      right = std::max(right, p.x);
      top = std::max(top, p.y);
    }
  if (left >= right)
    right = left + 1;
  const double unit = std::pow(10, std::floor(std::log10(top)));
  top = std::ceil(top / unit) * unit;
  const auto at = [&](const cv::Point2d& p) {
    return cv::Point(area.x + static_cast<int>((p.x - left) / (right - left) * area.width),
                     area.y + area.height - static_cast<int>(p.y / top * area.height));
  };
  const auto write = [&](const std::string& s, cv::Point p, const cv::Scalar& color = {60, 60, 60}) {
    cv::putText(plot, s, p, cv::FONT_HERSHEY_SIMPLEX, 0.42, color, 1, cv::LINE_AA);
  };
  for (int i = 0; i <= 4; ++i) {
    const double x = left + (right - left) * i / 4, y = top * i / 4;
    cv::line(plot, at({left, y}), at({right, y}), {225, 225, 225});
    write(text(y, top < 10 ? 1 : 0), at({left, y}) + cv::Point(-42, 4));
    write(text(x, right - left < 10 ? 1 : 0), at({x, 0}) + cv::Point(-12, 16));
  }
  cv::rectangle(plot, area, {120, 120, 120});
  write(title, {area.x, 20}, {0, 0, 0});
  write(x_name, {area.x + area.width / 2 - 40, area.y + area.height + 36});
  write(y_name, {4, 20});
  const cv::Scalar palette[] = {{180, 90, 20},  {40, 40, 210}, {60, 150, 40}, {160, 60, 160},
                                {30, 150, 220}, {90, 90, 90},  {200, 170, 30}};
  for (std::size_t i = 0; i < lines.size(); ++i) {
    const cv::Scalar& color = palette[i % std::size(palette)];
    for (std::size_t k = 1; k < lines[i].points.size(); ++k)
      cv::line(plot, at(lines[i].points[k - 1]), at(lines[i].points[k]), color, 1, cv::LINE_AA);
    const int y = area.y + 12 + static_cast<int>(i) * 18;
    cv::line(plot, {area.x + area.width + 12, y - 4}, {area.x + area.width + 32, y - 4}, color, 2);
    write(lines[i].name, {area.x + area.width + 38, y});
  }
  return plot;
}

} // namespace terrainseg::eval
