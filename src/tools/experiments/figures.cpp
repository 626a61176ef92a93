// SPDX-License-Identifier: LGPL-2.1-or-later
// Pictures after the paper's figures 4 to 9, from material that may be published.
#include <algorithm>
#include <filesystem>
#include <iostream>

#include <opencv2/imgproc.hpp>

#include "painter.hpp"
#include "reference/clusters.hpp"
#include "reference/training_pixels.hpp"
#include "tools/experiments/arguments.hpp"
#include "tools/experiments/experiments.hpp"
#include "tools/experiments/report.hpp"
#include "tools/experiments/subject.hpp"

namespace terrainseg::experiments {

namespace {

using Materials = std::vector<std::unique_ptr<Material>>;

cv::Rect window_of(const Material& material, const cv::Mat& picture) {
  reference::WindowPlace place;
  place.bottom = material.window_bottom;
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
cv::Mat bit_shifts(Material& material) {
  const cv::Mat picture = material.shot(material.size / 3).picture;
  std::vector<Tile> tiles;
  tiles.reserve(8);
  for (int b = 0; b < 8; ++b)
    tiles.push_back(shifted(picture, b));
  return sheet(tiles, 4, 320);
}

/// Figure 5: the window, and its pixels within one standard deviation of its mean.
cv::Mat window_inliers(const Materials& materials) {
  std::vector<Tile> tiles;
  for (const auto& material : materials) {
    const cv::Mat picture = material->shot(material->size / 2).picture;
    const cv::Rect window = window_of(*material, picture);
    cv::Mat marked = picture.clone(), chosen, kept;
    cv::rectangle(marked, window, {0, 140, 255}, std::max(2, picture.cols / 240));
    reference::window_pixels(picture, window, 1, chosen);
    picture.copyTo(kept, chosen);
    tiles.push_back({marked, material->name});
    tiles.push_back(
        {kept(window), "kept: " + number(100.0 * cv::countNonZero(chosen) / window.area(), 0) + " %"});
  }
  return sheet(tiles, 4, 320);
}

/// Figure 6: the window's pixels by training cluster, K = 3.
cv::Mat training_clusters(const Materials& materials) {
  constexpr int k = 3;
  std::vector<Tile> tiles;
  for (const auto& material : materials) {
    const cv::Mat picture = material->shot(material->size / 2).picture;
    const cv::Rect window = window_of(*material, picture);
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
    tiles.push_back({picture(window), material->name});
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
  return sheet(tiles, 4, 320);
}

Frame frame_of(const cv::Mat& picture) {
  return FramePicture().set(picture, Input::bgr);
}

/// Runs the filter over the shots up to `last` and paints its answer to that one.
cv::Mat painted(Material& material, const Settings& base, OverlayStyle style, int last) {
  Settings settings = base;
  settings.window_bottom = material.window_bottom;
  Segmenter segmenter(settings);
  cv::Mat picture;
  for (int i = std::max(0, last - 20); i <= last; ++i) {
    picture = material.shot(i).picture;
    Frame frame = frame_of(picture);
    frame.pts = static_cast<std::int64_t>(i * 1e9 / material.fps);
    if (const Status status = segmenter.process(frame); !status.ok())
      throw std::runtime_error(status.message());
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
cv::Mat horizons(const Materials& materials) {
  std::vector<Tile> tiles;
  for (const auto& material : materials) {
    Settings settings = Settings::of(Preset::paper);
    settings.window_bottom = material->window_bottom;
    const auto filter = filter_subject(settings, Input::bgr, material->fps);
    const Shot shot = material->shot(material->size / 2);
    filter->label(shot);
    const int row = filter->horizon_row(), truth = true_horizon(shot.labels);
    cv::Mat cut = shot.picture.clone();
    if (row > 0)
      cut.rowRange(0, row).setTo(0);
    if (truth >= 0)
      cv::line(cut, {0, truth}, {cut.cols, truth}, {0, 220, 255}, std::max(1, cut.rows / 240));
    tiles.push_back({shot.picture, material->name});
    tiles.push_back({cut, row < 0 ? "null: skipped (yellow: truth)" : "removed (yellow: truth)"});
  }
  return sheet(tiles, 4, 320);
}

/// Figure 8: learned models with their mass, along a sequence.
cv::Mat learned_models(const Materials& materials) {
  std::vector<Tile> tiles;
  for (const auto& material : materials)
    for (const int last : {0, material->size / 4, material->size / 2, material->size - 1})
      tiles.push_back({painted(*material, Settings::of(Preset::paper), OverlayStyle::models, last),
                       material->name + ", frame " + std::to_string(last)});
  return sheet(tiles, 4, 320);
}

/// Figure 9: examples, the paper preset beside the default.
cv::Mat examples(const Materials& materials) {
  std::vector<Tile> tiles;
  for (const auto& material : materials)
    for (const int last : {material->size / 3, 5 * material->size / 6})
      for (const Preset preset : {Preset::paper, Preset::standard})
        tiles.push_back({painted(*material, Settings::of(preset), OverlayStyle::tint, last),
                         material->name + (preset == Preset::paper ? ": paper preset" : ": default")});
  return sheet(tiles, 4, 320);
}

} // namespace

void run_figures(const std::vector<std::string>& arguments) {
  const Arguments a = parse(arguments, false);
  std::filesystem::create_directories(a.out);
  cv::setNumThreads(1);
  Materials materials = rendered_material(a.limit);
  if (!a.data.empty())
    for (auto& material : open_material(a.data, a.limit))
      if (material->free)
        materials.insert(materials.begin(), std::move(material));
  const auto write = [&](const std::string& name, const cv::Mat& picture) {
    save(a.out + "/" + name, picture);
    std::cout << a.out << '/' << name << '\n';
  };
  write("figure04-bit-shift.jpg", bit_shifts(*materials.front()));
  write("figure05-window.jpg", window_inliers(materials));
  write("figure06-clusters.jpg", training_clusters(materials));
  write("figure07-horizon.jpg", horizons(materials));
  write("figure08-models.jpg", learned_models(materials));
  write("figure09-examples.jpg", examples(materials));
}

} // namespace terrainseg::experiments
