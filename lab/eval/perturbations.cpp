// SPDX-License-Identifier: LGPL-2.1-or-later
#include "lab/eval/perturbations.hpp"

#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <functional>
#include <map>
#include <stdexcept>

#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <opencv2/videoio.hpp>

namespace terrainseg::eval {
namespace {

/// A picture while it is changed: B, G, R of full range, and its labels.
struct Scene {
  cv::Mat3b picture;
  cv::Mat1b labels;
};
using Change = std::function<void(Scene&)>;

Change warp(const std::function<cv::Matx23d(const cv::Size&)>& matrix_for) {
  return [=](Scene& s) {
    const cv::Size size = s.picture.size();
    const cv::Matx23d m = matrix_for(size);
    cv::Mat3b picture;
    cv::Mat1b labels;
    // What enters from outside looks like the ground beside it; a repeated edge would be streaks.
    cv::warpAffine(s.picture, picture, m, size, cv::INTER_LINEAR, cv::BORDER_REFLECT);
    cv::warpAffine(s.labels, labels, m, size, cv::INTER_NEAREST, cv::BORDER_CONSTANT, cv::Scalar(label_none));
    s = {picture, labels};
  };
}

Change shift(double share) {
  return warp([=](const cv::Size& size) { return cv::Matx23d(1, 0, 0, 0, 1, share * size.height); });
}

Change roll(double degrees) {
  return warp([=](const cv::Size& size) {
    return cv::Matx23d(cv::getRotationMatrix2D({size.width / 2.0F, size.height / 2.0F}, degrees, 1));
  });
}

Change light(double factor, double added = 0) {
  return [=](Scene& s) { s.picture.convertTo(s.picture, -1, factor, added); };
}

/// Normal noise that depends on the picture's place in the sequence only through the state of one generator.
Change noise(double deviation) {
  return [=, random = cv::RNG(7)](Scene& s) mutable {
    cv::Mat grain(s.picture.size(), CV_16SC3), sum;
    random.fill(grain, cv::RNG::NORMAL, 0, deviation);
    s.picture.convertTo(sum, CV_16S);
    cv::Mat(sum + grain).convertTo(s.picture, CV_8U);
  };
}

Change crop() {
  return [](Scene& s) {
    const cv::Size size = s.picture.size();
    // Away from above and from both sides; the bottom edge stays, and with it the window.
    const cv::Rect part(size.width / 8, size.height / 5, size.width * 3 / 4, size.height - size.height / 5);
    s = {s.picture(part).clone(), s.labels(part).clone()};
  };
}

class TemporaryFile {
 public:
  explicit TemporaryFile(const char* suffix) {
    std::string pattern =
        (std::filesystem::temp_directory_path() / "terrainseg-eval-XXXXXX").string() + suffix;
    const int file = mkstemps(pattern.data(), static_cast<int>(std::string(suffix).size()));
    if (file < 0)
      throw std::runtime_error(pattern + ": cannot be written");
    close(file);
    path_ = pattern;
  }
  ~TemporaryFile() {
    std::error_code ignored;
    std::filesystem::remove(path_, ignored);
  }
  TemporaryFile(const TemporaryFile&) = delete;
  TemporaryFile& operator=(const TemporaryFile&) = delete;
  const std::string& path() const { return path_; }

 private:
  std::string path_;
};

void encode_h264(std::vector<Scene>& samples, bool stills) {
  const TemporaryFile file(".mkv");
  // The largest picture, because a video has one size. 4:2:0 has even sides; OpenCV writes rows without the
  // padding that GStreamer expects behind a width that is not a multiple of four.
  cv::Size size;
  for (const Scene& s : samples)
    size = {std::max(size.width, (s.picture.cols + 3) / 4 * 4),
            std::max(size.height, (s.picture.rows + 1) / 2 * 2)};
  {
    const std::string pipeline =
        "appsrc ! videoconvert ! video/x-raw,format=I420 ! x264enc pass=qual quantizer=36 "
        "speed-preset=veryfast " +
        std::string(stills ? "key-int-max=1" : "") +
        " ! h264parse ! matroskamux ! filesink location=" + file.path();
    cv::VideoWriter writer(pipeline, cv::CAP_GSTREAMER, 0, 15, size, true);
    if (!writer.isOpened())
      throw std::runtime_error("h264: OpenCV has no GStreamer with x264enc here");
    for (const Scene& s : samples) {
      cv::Mat padded;
      cv::copyMakeBorder(s.picture, padded, 0, size.height - s.picture.rows, 0, size.width - s.picture.cols,
                         cv::BORDER_REPLICATE);
      writer.write(padded);
    }
  }
  cv::VideoCapture reader("filesrc location=" + file.path() +
                              " ! decodebin ! videoconvert ! video/x-raw,format=BGR ! "
                              "appsink sync=false",
                          cv::CAP_GSTREAMER);
  for (std::size_t i = 0; i < samples.size(); ++i) {
    cv::Mat picture;
    if (!reader.read(picture) || picture.size() != size)
      throw std::runtime_error("h264: frame " + std::to_string(i) + " did not come back from the decoder");
    samples[i].picture = picture({{}, samples[i].picture.size()}).clone();
  }
}

Change jpeg(int quality) {
  return [=](Scene& s) {
    std::vector<std::uint8_t> bytes;
    cv::imencode(".jpg", s.picture, bytes, {cv::IMWRITE_JPEG_QUALITY, quality});
    s.picture = cv::imdecode(bytes, cv::IMREAD_COLOR);
  };
}

const std::vector<std::pair<std::string, Change>>& changes() {
  static const std::vector<std::pair<std::string, Change>> all{
      {"crop", crop()},
      {"mirror",
       [](Scene& s) {
         cv::flip(s.picture, s.picture, 1);
         cv::flip(s.labels, s.labels, 1);
       }},
      {"pitch-up", shift(0.08)},
      {"pitch-down", shift(-0.08)},
      {"roll", roll(5)},
      {"dark", light(0.5)},
      {"bright", light(1.6)},
      {"haze", light(0.88, 12)},
      {"noise", noise(10)},
      {"blur", [](Scene& s) { cv::GaussianBlur(s.picture, s.picture, {}, 2); }},
      {"jpeg", jpeg(15)},
      {"grey",
       [](Scene& s) {
         cv::Mat1b gray;
         cv::cvtColor(s.picture, gray, cv::COLOR_BGR2GRAY);
         cv::cvtColor(gray, s.picture, cv::COLOR_GRAY2BGR);
       }},
  };
  return all;
}

} // namespace

const std::vector<std::string>& perturbation_names() {
  static const std::vector<std::string> names = [] {
    std::vector<std::string> list;
    for (const auto& [name, change] : changes())
      list.push_back(name);
    list.push_back("h264");
    return list;
  }();
  return names;
}

void check_perturbation(const std::string& name) {
  const std::vector<std::string>& names = perturbation_names();
  if (std::find(names.begin(), names.end(), name) != names.end())
    return;
  std::string all;
  for (const std::string& known : names)
    all += " " + known;
  throw std::runtime_error(name + ": no such perturbation; there are" + all);
}

void perturb(const std::string& name, std::vector<Sample>& samples, bool stills) {
  check_perturbation(name);
  std::vector<Scene> scenes;
  scenes.reserve(samples.size());
  for (const Sample& s : samples)
    scenes.push_back({s.picture.bgr(), s.labels.clone()});
  if (name == "h264")
    encode_h264(scenes, stills);
  else {
    const Change change = std::find_if(changes().begin(), changes().end(), [&](const auto& known) {
                            return known.first == name;
                          })->second; // with a new generator of random numbers
    for (Scene& s : scenes)
      change(s);
  }
  for (std::size_t i = 0; i < samples.size(); ++i)
    samples[i] = {Picture::of(scenes[i].picture, samples[i].picture.colorimetry()), scenes[i].labels};
}

} // namespace terrainseg::eval
