// SPDX-License-Identifier: LGPL-2.1-or-later
#include "lab/eval/written_masks.hpp"

#include <filesystem>
#include <fstream>
#include <stdexcept>
#include <utility>

#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "exchange/counted.hpp"

namespace terrainseg::eval {
namespace {

namespace fs = std::filesystem;

/// What a line of terrainextract says beside the mask.
Answer without_mask(const nlohmann::json& line) {
  Answer answer;
  answer.knows_horizon = true;
  answer.confidence = line.at("confidence").get<int>();
  if (const auto& row = line.at("horizon").at("row"); !row.is_null())
    answer.horizon = row.get<double>() / line.at("height").get<double>();
  return answer;
}

std::vector<Answer> read_estimates(const fs::path& path) {
  std::vector<Answer> answers;
  std::ifstream file(path);
  for (std::string line; std::getline(file, line);)
    try {
      answers.push_back(without_mask(nlohmann::json::parse(line)));
    } catch (const nlohmann::json::exception& problem) {
      throw std::runtime_error(path.string() + ", line " + std::to_string(answers.size() + 1) +
                               ": not what terrainextract writes: " + problem.what());
    }
  return answers;
}

class WrittenMasks : public Engine {
 public:
  WrittenMasks(fs::path folder, const Sequence& sequence)
      : folder_(std::move(folder)), sequence_(sequence), estimates_(folder_ / "estimates.ndjson") {
    if (fs::exists(estimates_)) {
      answers_ = read_estimates(estimates_);
      if (answers_.size() < sequence.size())
        throw std::runtime_error(estimates_.string() + ": " + counted(answers_.size(), "line") + " for " +
                                 counted(sequence.size(), "frame"));
    }
  }
  using Engine::look;
  Answer look(const Picture& picture, std::size_t index, const cv::Mat1b&) override {
    const fs::path path = folder_ / fs::path(sequence_.labels[index]).filename();
    const cv::Mat1b mask = cv::imread(path.string(), cv::IMREAD_GRAYSCALE);
    if (mask.empty())
      throw std::runtime_error(path.string() + ": missing or not a picture");
    Answer answer = answers_.empty() ? Answer() : answers_[index];
    cv::resize(mask, answer.mask, picture.size(), 0, 0, cv::INTER_NEAREST);
    return answer;
  }

 private:
  fs::path folder_;
  const Sequence& sequence_;
  fs::path estimates_;
  std::vector<Answer> answers_;
};

} // namespace

std::unique_ptr<Engine> written_masks(const std::string& folder, const Sequence& sequence) {
  const fs::path own = fs::path(folder) / sequence.name;
  return std::make_unique<WrittenMasks>(fs::is_directory(own) ? own : fs::path(folder), sequence);
}

} // namespace terrainseg::eval
