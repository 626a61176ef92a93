// SPDX-License-Identifier: LGPL-2.1-or-later
// Pictures after the paper's figures 4 to 9, from material that may be published.
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <iostream>

#include <opencv2/imgproc.hpp>

#include "lab/eval/charts.hpp"
#include "lab/eval/engines.hpp"
#include "lab/eval/figures.hpp"
#include "lab/eval/options.hpp"
#include "lab/eval/paper.hpp"
#include "lab/eval/rendered.hpp"
#include "lab/reference/clusters.hpp"
#include "lab/reference/training_pixels.hpp"
#include "painter.hpp"
#include "terrainseg/segmenter.hpp"

namespace terrainseg::eval {

namespace {

using Sequences = std::vector<Sequence>;

cv::Rect window_of(const Sequence& sequence, const cv::Mat& picture) {
  reference::WindowPlace place;
  place.bottom = sequence.window_bottom;
  return reference::window_in(picture.size(), place);
}

Tile shifted(const cv::Mat& picture, int b) {
  cv::Mat values;
  picture.convertTo(values, CV_8U);
  values.forEach<cv::Vec3b>([b](cv::Vec3b& p, const int*) {
    for (int c = 0; c < 3; ++c)
      p[c] = static_cast<std::uint8_t>((p[c] >> b << b) + (1 << b >> 1));
  });
  return {values, b == 0 ? "original" : "b = " + std::to_string(b)};
}

/// Figure 4: what is left of a picture in the shifted sub-space.
cv::Mat bit_shifts(const Sequence& sequence) {
  const cv::Mat picture = sequence.read(sequence.size() / 3).picture.bgr();
  std::vector<Tile> tiles;
  tiles.reserve(8);
  for (int b = 0; b < 8; ++b)
    tiles.push_back(shifted(picture, b));
  return contact_sheet(tiles, 4, 320);
}

/// Figure 5: the window, and its pixels within one standard deviation of its mean.
cv::Mat window_inliers(const Sequences& sequences) {
  std::vector<Tile> tiles;
  for (const Sequence& sequence : sequences) {
    const cv::Mat picture = sequence.read(sequence.size() / 2).picture.bgr();
    const cv::Rect window = window_of(sequence, picture);
    cv::Mat marked = picture.clone(), chosen, kept;
    cv::rectangle(marked, window, {0, 140, 255}, std::max(2, picture.cols / 240));
    reference::window_pixels(picture, window, 1, chosen);
    picture.copyTo(kept, chosen);
    tiles.push_back({marked, sequence.name});
    tiles.push_back(
        {kept(window), "kept: " + number(100.0 * cv::countNonZero(chosen) / window.area(), 0) + " %"});
  }
  return contact_sheet(tiles, 4, 320);
}

/// Figure 6: the window's pixels by training cluster, K = 3.
cv::Mat training_clusters(const Sequences& sequences) {
  constexpr int k = 3;
  std::vector<Tile> tiles;
  for (const Sequence& sequence : sequences) {
    const cv::Mat picture = sequence.read(sequence.size() / 2).picture.bgr();
    const cv::Rect window = window_of(sequence, picture);
    cv::Mat chosen;
    reference::window_pixels(picture, window, 0, chosen);
    reference::TrainingColors colors;
    reference::gather(picture, chosen, colors);
    const reference::Clustering found = reference::cluster(colors, k, 20, 1);
    std::vector<cv::Mat> parts(found.clusters.size());
    for (cv::Mat& part : parts)
      part = cv::Mat(window.size(), CV_8UC3, cv::Scalar(255, 255, 255));
    // gather() reads in raster order and every pixel of the window trains here.
    for (std::size_t i = 0; i < found.members.size(); ++i) {
      const int x = static_cast<int>(i) % window.width, y = static_cast<int>(i) / window.width;
      parts[found.members[i]].at<cv::Vec3b>(y, x) = picture.at<cv::Vec3b>(window.y + y, window.x + x);
    }
    tiles.push_back({picture(window), sequence.name});
    for (int j = 0; j < k; ++j)
      if (static_cast<std::size_t>(j) < parts.size())
        tiles.push_back({parts[static_cast<std::size_t>(j)],
                         number(100 * found.clusters[static_cast<std::size_t>(j)].mass /
                                    static_cast<double>(found.members.size()),
                                0) +
                             " % of the window"});
      else
        tiles.push_back({cv::Mat(window.size(), CV_8UC3, cv::Scalar(255, 255, 255)), "empty"});
  }
  return contact_sheet(tiles, 4, 320);
}

/// Runs the filter over the shots up to `last` and paints its answer to that one.
cv::Mat painted(const Sequence& sequence, const Settings& base, OverlayStyle style, std::size_t last) {
  Settings settings = base;
  settings.window_bottom = sequence.window_bottom;
  Segmenter segmenter(settings);
  cv::Mat picture;
  for (std::size_t i = last - std::min<std::size_t>(last, 20); i <= last; ++i) {
    const Sample sample = sequence.read(i);
    Frame frame = sample.picture.frame();
    frame.pts = static_cast<std::int64_t>(static_cast<double>(i) * 1e9 / sequence.fps);
    if (const Status status = segmenter.process(frame); !status.ok())
      throw std::runtime_error(status.message());
    if (i == last)
      picture = sample.picture.bgr();
  }
  MutableFrame target;
  target.format = PixelFormat::BGR;
  target.width = picture.cols;
  target.height = picture.rows;
  target.colorimetry.range = ColorRange::full;
  target.planes[0] = {picture.data, static_cast<std::ptrdiff_t>(picture.step)};
  PaintStyle paint_style;
  paint_style.style = style;
  paint(target, segmenter.estimate(), paint_style);
  return picture;
}

/// Figure 7: what the horizon stage takes away.
cv::Mat horizons(const Sequences& sequences) {
  std::vector<Tile> tiles;
  for (const Sequence& sequence : sequences) {
    Settings settings = Settings::of(Preset::paper);
    settings.window_bottom = sequence.window_bottom;
    const Sample shot = sequence.read(sequence.size() / 2);
    const Answer answer = make_filter(settings, sequence.fps, PixelFormat::BGR)->look(shot.picture, 0);
    const cv::Mat3b picture = shot.picture.bgr();
    const int row = answer.horizon ? static_cast<int>(std::lround(*answer.horizon * picture.rows)) : -1,
              truth = true_horizon(shot.labels);
    cv::Mat cut = picture.clone();
    if (row > 0)
      cut.rowRange(0, row).setTo(0);
    if (truth >= 0)
      cv::line(cut, {0, truth}, {cut.cols, truth}, {0, 220, 255}, std::max(1, cut.rows / 240));
    tiles.push_back({picture, sequence.name});
    tiles.push_back({cut, row < 0 ? "null: skipped (yellow: truth)" : "removed (yellow: truth)"});
  }
  return contact_sheet(tiles, 4, 320);
}

/// Figure 8: learned models with their mass, along a sequence.
cv::Mat learned_models(const Sequences& sequences) {
  std::vector<Tile> tiles;
  for (const Sequence& sequence : sequences)
    for (const std::size_t last :
         {std::size_t{0}, sequence.size() / 4, sequence.size() / 2, sequence.size() - 1})
      tiles.push_back({painted(sequence, Settings::of(Preset::paper), OverlayStyle::models, last),
                       sequence.name + ", frame " + std::to_string(last)});
  return contact_sheet(tiles, 4, 320);
}

/// Figure 9: examples, the paper preset beside the default.
cv::Mat examples(const Sequences& sequences) {
  std::vector<Tile> tiles;
  for (const Sequence& sequence : sequences)
    for (const std::size_t last : {sequence.size() / 3, 5 * sequence.size() / 6})
      for (const Preset preset : {Preset::paper, Preset::standard})
        tiles.push_back({painted(sequence, Settings::of(preset), OverlayStyle::tint, last),
                         sequence.name + (preset == Preset::paper ? ": paper preset" : ": default")});
  return contact_sheet(tiles, 4, 320);
}

} // namespace

void run_figures(const std::vector<std::string>& arguments) {
  const PaperOptions a = parse_paper_options(arguments, false);
  std::filesystem::create_directories(a.out);
  cv::setNumThreads(1);
  Sequences sequences = rendered_for_paper(a.selection);
  if (!a.data.empty())
    for (Sequence& sequence : sequences_in(a.data, a.selection))
      if (sequence.free)
        sequences.insert(sequences.begin(), std::move(sequence));
  const auto write = [&](const std::string& name, const cv::Mat& picture) {
    save(a.out + "/" + name, picture);
    std::cout << a.out << '/' << name << '\n';
  };
  write("figure04-bit-shift.jpg", bit_shifts(sequences.front()));
  write("figure05-window.jpg", window_inliers(sequences));
  write("figure06-clusters.jpg", training_clusters(sequences));
  write("figure07-horizon.jpg", horizons(sequences));
  write("figure08-models.jpg", learned_models(sequences));
  write("figure09-examples.jpg", examples(sequences));
}

} // namespace terrainseg::eval
