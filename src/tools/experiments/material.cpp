// SPDX-License-Identifier: LGPL-2.1-or-later
#include "tools/experiments/material.hpp"

#include <algorithm>
#include <filesystem>
#include <stdexcept>

#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "scene/scene.hpp"

namespace terrainseg::experiments {

namespace fs = std::filesystem;

namespace {

cv::Mat read_picture(const fs::path& path, int how) {
  cv::Mat picture = cv::imread(path.string(), how);
  if (picture.empty())
    throw std::runtime_error(path.string() + ": not a readable picture");
  return picture;
}

std::vector<fs::path> pictures_in(const fs::path& folder) {
  std::vector<fs::path> found;
  if (fs::is_directory(folder))
    for (const auto& entry : fs::directory_iterator(folder))
      if (entry.path().extension() == ".png" || entry.path().extension() == ".jpg")
        found.push_back(entry.path());
  std::sort(found.begin(), found.end());
  return found;
}

class Folder : public Material {
 public:
  Folder(const fs::path& folder, int limit)
      : frames_(pictures_in(folder / "frames")), labels_(folder / "labels"), depth_(folder / "depth") {
    name = folder.filename().string();
    about = name;
    const cv::FileStorage json((folder / "sequence.json").string(),
                               cv::FileStorage::READ | cv::FileStorage::FORMAT_JSON);
    std::string source;
    json["fps"] >> fps;
    json["window_bottom"] >> window_bottom;
    json["source"] >> source;
    free = source.find("CC BY") != std::string::npos;
    if (limit > 0 && frames_.size() > static_cast<std::size_t>(limit))
      frames_.resize(static_cast<std::size_t>(limit));
    size = static_cast<int>(frames_.size());
  }

  Shot shot(int index) override {
    const fs::path& frame = frames_[static_cast<std::size_t>(index)];
    const fs::path other = frame.stem().string() + ".png";
    Shot shot{read_picture(frame, cv::IMREAD_COLOR), read_picture(labels_ / other, cv::IMREAD_GRAYSCALE), {}};
    if (shot.labels.size() != shot.picture.size())
      cv::resize(shot.labels, shot.labels, shot.picture.size(), 0, 0, cv::INTER_NEAREST);
    if (fs::exists(depth_ / other))
      shot.depth = read_picture(depth_ / other, cv::IMREAD_ANYDEPTH);
    return shot;
  }

 private:
  std::vector<fs::path> frames_;
  fs::path labels_, depth_;
};

constexpr int step = 6; // frames of the world between two shots: 5 a second

class Rendered : public Material {
 public:
  Rendered(const std::string& called, const scene::Settings& settings, cv::Size frame, int shots)
      : renderer_(settings, frame.width, frame.height), frame_(frame) {
    name = called;
    about = "rendered";
    fps = scene::frames_per_second / static_cast<double>(step);
    size = shots;
    free = true;
  }

  Shot shot(int index) override {
    Shot shot{cv::Mat(frame_, CV_8UC3), cv::Mat(frame_, CV_8UC1), {}};
    MutableFrame frame;
    frame.format = PixelFormat::BGR;
    frame.width = frame_.width;
    frame.height = frame_.height;
    frame.colorimetry.range = ColorRange::full;
    frame.planes[0] = {shot.picture.data, static_cast<std::ptrdiff_t>(shot.picture.step)};
    renderer_.render(static_cast<std::uint64_t>(index) * step, frame,
                     {shot.labels.data, static_cast<std::ptrdiff_t>(shot.labels.step)});
    return shot;
  }

 private:
  scene::Renderer renderer_;
  cv::Size frame_;
};

} // namespace

std::vector<std::unique_ptr<Material>> rendered_material(int limit) {
  struct Scene {
    const char* name;
    scene::Settings settings;
  };
  using scene::Kind, scene::Light, scene::Motion;
  const Scene scenes[] = {
      {"rendered road", {Kind::road, Light::day, Motion::straight, 3}},
      {"rendered road, dusk", {Kind::road, Light::dusk, Motion::straight, 4}},
      {"rendered trail", {Kind::trail, Light::drift, Motion::bumpy, 5}},
      {"rendered corridor", {Kind::corridor, Light::day, Motion::turn, 6}},
      {"rendered plain", {Kind::plain, Light::day, Motion::bumpy, 7}},
  };
  constexpr int shots = 60;
  std::vector<std::unique_ptr<Material>> all;
  for (const Scene& s : scenes)
    all.push_back(std::make_unique<Rendered>(s.name, s.settings, cv::Size(640, 360),
                                             limit > 0 ? std::min(limit, shots) : shots));
  return all;
}

std::vector<std::unique_ptr<Material>> open_material(const std::string& data, int limit) {
  if (data.empty())
    return rendered_material(limit);
  std::vector<std::unique_ptr<Material>> all;
  std::vector<fs::path> folders;
  if (!fs::is_directory(data))
    throw std::runtime_error(data + ": no such folder; leave it out to use rendered scenes");
  for (const auto& entry : fs::directory_iterator(data))
    if (fs::exists(entry.path() / "sequence.json"))
      folders.push_back(entry.path());
  std::sort(folders.begin(), folders.end());
  all.reserve(folders.size());
  for (const fs::path& folder : folders)
    all.push_back(std::make_unique<Folder>(folder, limit));
  if (all.empty())
    throw std::runtime_error(data + ": no folder in it has a sequence.json");
  return all;
}

std::vector<cv::Mat> speed_pictures(const std::string& data) {
  const cv::Size hd(1920, 1080);
  std::vector<cv::Mat> pictures;
  if (!data.empty())
    for (const fs::path& path : pictures_in(fs::path(data) / "hd_frames")) {
      cv::Mat picture = read_picture(path, cv::IMREAD_COLOR);
      if (picture.size() != hd)
        cv::resize(picture, picture, hd, 0, 0, cv::INTER_AREA);
      pictures.push_back(picture);
    }
  if (pictures.empty()) {
    using scene::Kind, scene::Light, scene::Motion;
    Rendered trail("trail", {Kind::trail, Light::day, Motion::straight, 5}, hd, 12);
    for (int i = 0; i < trail.size; ++i)
      pictures.push_back(trail.shot(i).picture);
  }
  return pictures;
}

} // namespace terrainseg::experiments
