// SPDX-License-Identifier: LGPL-2.1-or-later
#include "lab/eval/sequence.hpp"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <map>
#include <stdexcept>

#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>

#include "lab/eval/rendered.hpp"

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

std::string size_text(const cv::Size& size) {
  return std::to_string(size.width) + "x" + std::to_string(size.height);
}

/// Each frame a place of its own: shown long enough to be learned, then forgotten.
void become_stills(Sequence& s) {
  constexpr int shown = 4;
  constexpr double frames_per_second = 25; // what imagefreeze makes of a picture
  s.stills = true;
  s.run = 1;
  s.repeat = shown;
  s.fps = frames_per_second;
}

/// Takes what sequence.json says; without the file nothing is known.
void describe(Sequence& s, const fs::path& path) {
  std::ifstream file(path);
  if (!file)
    return;
  try {
    const nlohmann::json about = nlohmann::json::parse(file);
    s.fps = about.value("fps", 0.0);
    s.window_bottom = about.value("window_bottom", 0);
    s.kind = about.value("kind", std::string());
    if (const auto horizon = about.find("horizon"); horizon != about.end())
      s.horizon = horizon->is_array() ? horizon->get<std::vector<double>>()
                                      : std::vector<double>{horizon->get<double>()};
    if (s.horizon.size() > 1 && s.horizon.size() != s.frames.size())
      throw std::runtime_error(path.string() + ": horizon has " + std::to_string(s.horizon.size()) +
                               " values for " + std::to_string(s.frames.size()) +
                               " labelled frames; one for all or one each");
    s.free = about.value("source", std::string()).find("CC BY") != std::string::npos;
    if (about.value("stills", false))
      become_stills(s);
  } catch (const nlohmann::json::exception& problem) {
    throw std::runtime_error(path.string() + ": not the description of a sequence: " + problem.what());
  }
}

Sequence open_folder(const std::string& folder) {
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
  describe(s, fs::path(folder) / "sequence.json");
  return s;
}

void select(Sequence& s, const Selection& selection) {
  if (selection.every > 1 && s.source)
    throw std::runtime_error(s.folder + ": frames of a rendered sequence cannot be left out");
  for (auto* list : {&s.frames, &s.labels}) {
    std::vector<std::string> taken;
    for (std::size_t i = 0; i < list->size(); i += static_cast<std::size_t>(selection.every))
      taken.push_back((*list)[i]);
    if (selection.limit > 0 && taken.size() > static_cast<std::size_t>(selection.limit))
      taken.resize(static_cast<std::size_t>(selection.limit));
    *list = taken;
  }
  if (s.horizon.size() > 1) {
    std::vector<double> taken;
    for (std::size_t i = 0; i < s.horizon.size() && taken.size() < s.frames.size();
         i += static_cast<std::size_t>(selection.every))
      taken.push_back(s.horizon[i]);
    s.horizon = taken;
  }
}

} // namespace

Sequence open_sequence(const std::string& folder, const Selection& selection) {
  Sequence sequence = is_rendered(folder) ? rendered_sequence(folder) : open_folder(folder);
  select(sequence, selection);
  return sequence;
}

std::vector<Sequence> sequences_in(const std::string& folder, const Selection& selection) {
  if (!fs::is_directory(folder))
    throw std::runtime_error(folder + ": no such folder");
  std::vector<Sequence> found;
  for (const auto& entry : fs::directory_iterator(folder))
    if (fs::exists(entry.path() / "sequence.json") && fs::is_directory(entry.path() / "frames"))
      if (Sequence s = open_sequence(entry.path().string(), selection); !s.stills)
        found.push_back(std::move(s));
  if (found.empty())
    throw std::runtime_error(folder + ": no folder in it holds a sequence (frames/, labels/, sequence.json)");
  std::sort(found.begin(), found.end(), [](const Sequence& a, const Sequence& b) { return a.name < b.name; });
  return found;
}

Sample Sequence::read(std::size_t index) const {
  if (source)
    return source(index);
  Sample sample;
  sample.picture = Picture::read(frames[index]);
  if (!horizon.empty())
    sample.picture.set_vanishing_row(static_cast<std::int32_t>(
        std::lround(256 * horizon[horizon.size() > 1 ? index : 0] * sample.picture.size().height)));
  sample.labels = cv::imread(labels[index], cv::IMREAD_GRAYSCALE);
  if (sample.labels.empty())
    throw std::runtime_error(labels[index] + ": not a readable picture");
  if (sample.labels.size() != sample.picture.size())
    throw std::runtime_error(labels[index] + ": " + size_text(sample.labels.size()) +
                             " pixels, its frame has " + size_text(sample.picture.size()) +
                             "; labels need the frame's size");
  const fs::path range = fs::path(folder) / "depth" / fs::path(labels[index]).filename();
  if (fs::exists(range))
    sample.depth = cv::imread(range.string(), cv::IMREAD_ANYDEPTH);
  return sample;
}

} // namespace terrainseg::eval
