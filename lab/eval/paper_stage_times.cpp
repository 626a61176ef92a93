// SPDX-License-Identifier: LGPL-2.1-or-later
// Table 1: the time of each stage.
#include <algorithm>
#include <chrono>
#include <stdexcept>
#include <utility>
#include <vector>

#include <opencv2/imgproc.hpp>

#include "lab/eval/paper_parts.hpp"
#include "lab/eval/statistics.hpp"
#include "lab/eval/table.hpp"
#include "lab/reference/reference_engine.hpp"
#include "terrainseg/segmenter.hpp"

namespace terrainseg::eval {

namespace {

using Clock = std::chrono::steady_clock;

constexpr int warm_up = 20, frames = 400, reference_frames = 60;

double since(Clock::time_point start) {
  return std::chrono::duration<double, std::micro>(Clock::now() - start).count();
}

void add_row(Table& table, const std::string& size, const std::string& what, const std::string& stage,
             std::vector<double> microseconds) {
  const Spread s = spread_of(std::move(microseconds)).value_or(Spread());
  table.add({size, what, stage, number(s.least, 1), number(s.median, 1), number(s.deviation, 1),
             number(s.p99, 1), number(s.largest, 1)});
}

void measure_filter(Table& table, const std::string& size, const std::string& what, const Settings& settings,
                    const std::vector<Picture>& pictures) {
  std::vector<Frame> input;
  input.reserve(pictures.size());
  for (const Picture& picture : pictures)
    input.push_back(picture.frame());
  Segmenter segmenter(settings);
  std::vector<std::vector<double>> stages(stage_count);
  std::vector<double> whole, processor;
  for (int i = 0; i < warm_up + frames; ++i) {
    Frame& frame = input[static_cast<std::size_t>(i) % input.size()];
    frame.pts = std::int64_t{i} * 33'333'333;
    const double before = processor_milliseconds();
    const Clock::time_point start = Clock::now();
    if (const Status status = segmenter.process(frame); !status.ok())
      throw std::runtime_error(status.message());
    const double time = since(start), busy = 1000 * (processor_milliseconds() - before);
    if (i < warm_up)
      continue;
    whole.push_back(time);
    processor.push_back(busy);
    for (std::size_t s = 0; s < stages.size(); ++s)
      stages[s].push_back(static_cast<double>(segmenter.stage_times()[s]) / 1000);
  }
  for (std::size_t s = 0; s < stages.size(); ++s)
    add_row(table, size, what, name_of(static_cast<Stage>(s)), stages[s]);
  add_row(table, size, what, "whole frame", whole);
  add_row(table, size, what, "whole frame, processor time", processor);
}

void measure_reference(Table& table, const std::string& size, const std::vector<Picture>& pictures) {
  std::vector<cv::Mat3b> bgr;
  bgr.reserve(pictures.size());
  for (const Picture& picture : pictures)
    bgr.push_back(picture.bgr());
  reference::ReferenceEngine engine;
  std::vector<std::vector<double>> stages(reference::reference_stage_count);
  std::vector<double> whole, processor;
  for (int i = 0; i < reference_frames; ++i) {
    const double before = processor_milliseconds();
    const Clock::time_point start = Clock::now();
    const auto& result = engine.process(bgr[static_cast<std::size_t>(i) % bgr.size()]);
    const double time = since(start), busy = 1000 * (processor_milliseconds() - before);
    if (i < 5)
      continue;
    whole.push_back(time);
    processor.push_back(busy);
    for (std::size_t s = 0; s < stages.size(); ++s)
      stages[s].push_back(static_cast<double>(result.stage_times[s]) / 1000);
  }
  for (std::size_t s = 0; s < stages.size(); ++s)
    add_row(table, size, "unmodified", name_of(static_cast<reference::ReferenceStage>(s)), stages[s]);
  add_row(table, size, "unmodified", "whole frame", whole);
  add_row(table, size, "unmodified", "whole frame, processor time", processor);
}

/// The paper times the shift of the picture by itself. Here it is part of clustering, where it costs nothing
/// that can be told apart; this is what it costs alone.
void measure_shift(Table& table, const std::string& size, const cv::Mat& picture, int levels) {
  cv::Mat coarse = picture;
  for (int i = 0; i < levels; ++i) {
    cv::Mat next;
    cv::pyrDown(coarse, next);
    coarse = next;
  }
  std::vector<std::uint8_t> shifted(coarse.total() * 3);
  std::vector<double> times;
  for (int i = 0; i < warm_up + frames; ++i) {
    const Clock::time_point start = Clock::now();
    for (std::size_t k = 0; k < shifted.size(); ++k)
      shifted[k] = coarse.data[k] >> 3;
    const double time = since(start);
    if (i >= warm_up && shifted[0] < 255) // reads what was written, so that it is written
      times.push_back(time);
  }
  add_row(table, size, "bit shift alone, b = 3", levels > 0 ? "coarse picture" : "whole picture", times);
}

} // namespace

std::string stage_times(const Context& context) {
  context.tell("stage times");
  const std::vector<Picture> full = speed_pictures(context.data);
  std::vector<Picture> smaller;
  smaller.reserve(full.size());
  for (const Picture& picture : full)
    smaller.push_back(picture.resized({1280, 720}));
  Table table({"frame", "what", "stage", "least, us", "median", "deviation", "99th percentile", "largest"});
  for (const auto& [size, pictures] :
       {std::pair{"1280x720", std::as_const(smaller)}, std::pair{"1920x1080", full}}) {
    measure_filter(table, size, "paper preset", Settings::of(Preset::paper), pictures);
    measure_shift(table, size, pictures.front().bgr(), 5);
    measure_shift(table, size, pictures.front().bgr(), 0);
    measure_filter(table, size, "default", Settings::of(Preset::standard), pictures);
    measure_reference(table, size, pictures);
  }
  return "## Time of each stage (Table 1)\n\nI420, one thread, " + std::to_string(frames) +
         " frames from a set of " + std::to_string(full.size()) + " pictures (" +
         (context.data.empty() ? "the rendered trail" : "photographs of an off-road robot") +
         "); the unmodified algorithm from B G R.\n\n" + table.text();
}

} // namespace terrainseg::eval
