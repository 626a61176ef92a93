// SPDX-License-Identifier: LGPL-2.1-or-later
#include "tools/eval/sequence.hpp"

#include <algorithm>
#include <filesystem>
#include <map>
#include <stdexcept>

#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "tools/eval/rendered.hpp"

namespace terrainseg::eval {
namespace fs = std::filesystem;
namespace {

std::map<std::string, std::string> pictures_in(const fs::path& folder) {
  if (!fs::is_directory(folder))
    throw std::runtime_error(folder.string() +
                             ": no such folder; a sequence holds frames/, labels/ and sequence.json");
  std::map<std::string, std::string> found;
  for (const auto& entry : fs::directory_iterator(folder)) {
    const std::string extension = entry.path().extension().string();
    if (extension == ".png" || extension == ".jpg" || extension == ".jpeg")
      found[entry.path().stem().string()] = entry.path().string();
  }
  return found;
}

} // namespace

Sequence open_sequence(const std::string& folder, int limit) {
  if (is_rendered(folder))
    return rendered_sequence(folder, limit);
  Sequence s;
  s.folder = folder;
  s.name = fs::path(folder).lexically_normal().filename().string();
  if (s.name.empty())
    s.name = fs::path(folder).lexically_normal().parent_path().filename().string();
  const auto frames = pictures_in(fs::path(folder) / "frames"),
             labels = pictures_in(fs::path(folder) / "labels");
  for (const auto& [stem, path] : frames)
    if (const auto label = labels.find(stem); label != labels.end()) {
      s.frames.push_back(path);
      s.labels.push_back(label->second);
    }
  if (s.frames.empty())
    throw std::runtime_error(folder + ": no frame has a label of the same name");
  if (limit > 0 && s.frames.size() > static_cast<std::size_t>(limit)) {
    s.frames.resize(static_cast<std::size_t>(limit));
    s.labels.resize(static_cast<std::size_t>(limit));
  }
  const std::string description = (fs::path(folder) / "sequence.json").string();
  if (fs::exists(description)) {
    try {
      const cv::FileStorage json(description, cv::FileStorage::READ | cv::FileStorage::FORMAT_JSON);
      if (!json["fps"].empty())
        s.fps = static_cast<double>(json["fps"]);
      if (!json["window_bottom"].empty())
        s.window_bottom = static_cast<int>(json["window_bottom"]);
    } catch (const cv::Exception&) {
      throw std::runtime_error(description + ": not valid JSON");
    }
  }
  return s;
}

Sample Sequence::read(std::size_t index) const {
  if (source)
    return source(index);
  Sample sample;
  sample.picture = cv::imread(frames[index], cv::IMREAD_COLOR);
  if (sample.picture.empty())
    throw std::runtime_error(frames[index] + ": not a readable picture");
  sample.labels = cv::imread(labels[index], cv::IMREAD_GRAYSCALE);
  if (sample.labels.empty())
    throw std::runtime_error(labels[index] + ": not a readable picture");
  if (sample.labels.size() != sample.picture.size())
    cv::resize(sample.labels, sample.labels, sample.picture.size(), 0, 0, cv::INTER_NEAREST);
  return sample;
}

} // namespace terrainseg::eval
