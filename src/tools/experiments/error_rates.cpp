// SPDX-License-Identifier: LGPL-2.1-or-later
// Table 2 and figures 12 to 14: what the pyramid and the bit shift cost in error and save in time.
#include <algorithm>
#include <map>
#include <stdexcept>

#include "tools/experiments/parts.hpp"
#include "tools/experiments/report.hpp"
#include "tools/experiments/subject.hpp"

namespace terrainseg::experiments {

namespace {

constexpr int levels = 7, shifts = 8; // 0..6, 0..7

Settings paper_settings(int level, int shift, int window_bottom) {
  Settings s = Settings::of(Preset::paper);
  s.pyramid_levels = level;
  s.bit_shift = shift;
  s.window_bottom = window_bottom;
  return s;
}

std::unique_ptr<Subject> unmodified(int window_bottom) {
  reference::ReferenceSettings s;
  s.window.bottom = window_bottom;
  return reference_subject(s);
}

std::string both(const Score& score) {
  return number(score.error(), 1) + " / " + number(score.unsafe_share(), 1);
}

/// The best of the "everything below row r" baselines, chosen with the labels in hand.
struct RowBaselines {
  std::map<int, Score> by_percent;
  void add(const Shot& shot) {
    for (int percent = 30; percent <= 80; percent += 5)
      by_percent[percent].add(row_subject(percent / 100.0)->label(shot), shot.labels);
  }
  std::pair<int, Score> best() const {
    return *std::min_element(by_percent.begin(), by_percent.end(), [](const auto& a, const auto& b) {
      return a.second.error() < b.second.error();
    });
  }
};

/// The least of some runs: what the work costs with the caches to itself.
double least_time(Subject& subject, const std::vector<cv::Mat>& pictures, int runs) {
  std::vector<double> times;
  for (int i = 0; i < runs + 3; ++i) {
    const Shot shot{pictures[static_cast<std::size_t>(i) % pictures.size()], {}, {}};
    const double start = processor_milliseconds();
    subject.label(shot);
    const double end = processor_milliseconds();
    if (i >= 3)
      times.push_back(end - start);
  }
  return Spread::of(times).least;
}

} // namespace

std::string error_rates(const Context& context) {
  Table table({"sequence", "unmodified", "pyramid, 1/32", "pyramid and b = 3", "default",
               "best row, with the labels"});
  for (const auto& material : open_material(context.data, context.limit)) {
    context.tell("error rates: " + material->name);
    Settings standard = Settings::of(Preset::standard);
    standard.window_bottom = material->window_bottom;
    const std::unique_ptr<Subject> subjects[] = {
        unmodified(material->window_bottom),
        filter_subject(paper_settings(5, 0, material->window_bottom), Input::bgr, material->fps),
        filter_subject(paper_settings(5, 3, material->window_bottom), Input::bgr, material->fps),
        filter_subject(standard, Input::i420, material->fps)};
    Score scores[std::size(subjects)];
    RowBaselines rows;
    for (int i = 0; i < material->size; ++i) {
      const Shot shot = material->shot(i);
      for (std::size_t k = 0; k < std::size(subjects); ++k)
        scores[k].add(subjects[k]->label(shot), shot.labels);
      rows.add(shot);
    }
    const auto [percent, row] = rows.best();
    table.add({material->name, both(scores[0]), both(scores[1]), both(scores[2]), both(scores[3]),
               both(row) + " (" + number(percent / 100.0, 2) + ")"});
  }
  return "## Error rates (Table 2)\n\nError in % of the labelled pixels / obstacle pixels of the bottom "
         "third that are "
         "called traversable, in %. The first three from B G R, the default from I420.\n\n" +
         table.text();
}

std::string scale_and_shift(const Context& context) {
  context.tell("time over level and shift");
  const std::vector<cv::Mat> pictures = speed_pictures(context.data);
  double time[levels][shifts];
  for (int level = 0; level < levels; ++level)
    for (int shift = 0; shift < shifts; ++shift)
      time[level][shift] =
          least_time(*filter_subject(paper_settings(level, shift, 0), Input::bgr, 0), pictures, 41);
  const double unmodified_time = least_time(*unmodified(0), pictures, 41);
  const double default_time =
      least_time(*filter_subject(Settings::of(Preset::standard), Input::bgr, 0), pictures, 41);

  double error[levels][shifts] = {}, unmodified_error = 0;
  int sequences = 0;
  for (const auto& material : open_material(context.data, context.limit)) {
    context.tell("error over level and shift: " + material->name);
    std::vector<std::unique_ptr<Subject>> subjects;
    for (int level = 0; level < levels; ++level)
      for (int shift = 0; shift < shifts; ++shift)
        subjects.push_back(
            filter_subject(paper_settings(level, shift, material->window_bottom), Input::bgr, 0));
    subjects.push_back(unmodified(material->window_bottom));
    std::vector<Score> scores(subjects.size());
    for (int i = 0; i < material->size; ++i) {
      const Shot shot = material->shot(i);
      for (std::size_t k = 0; k < subjects.size(); ++k)
        scores[k].add(subjects[k]->label(shot), shot.labels);
    }
    for (int level = 0; level < levels; ++level)
      for (int shift = 0; shift < shifts; ++shift)
        error[level][shift] += scores[static_cast<std::size_t>(level * shifts + shift)].error();
    unmodified_error += scores.back().error();
    ++sequences;
  }

  std::vector<std::string> head{"level"};
  for (int shift = 0; shift < shifts; ++shift)
    head.push_back("b = " + std::to_string(shift));
  Table times(head), errors(head);
  for (int level = 0; level < levels; ++level) {
    std::vector<std::string> time_row{std::to_string(level)}, error_row{std::to_string(level)};
    for (int shift = 0; shift < shifts; ++shift) {
      error[level][shift] /= sequences;
      time_row.push_back(
          number(time[level][shift], 2) + " (" +
          number(unmodified_time / time[level][shift], unmodified_time < 10 * time[level][shift] ? 1 : 0) +
          "x)");
      error_row.push_back(number(error[level][shift], 1));
    }
    times.add(time_row);
    errors.add(error_row);
  }

  const auto over_levels = [&](int shift, const char* name, bool right) {
    Curve curve{name, {}, right};
    for (int level = 0; level < levels; ++level)
      curve.points.emplace_back(level, right ? error[level][shift] : time[level][shift]);
    return curve;
  };
  const auto over_shifts = [&](int level, const char* name, bool right) {
    Curve curve{name, {}, right};
    for (int shift = 0; shift < shifts; ++shift)
      curve.points.emplace_back(shift, right ? error[level][shift] : time[level][shift]);
    return curve;
  };
  save(context.out + "/figure12.png",
       chart("Paper preset, b = 0, 1920x1080", "pyramid level", "ms a frame", "error %",
             {over_levels(0, "time", false), over_levels(0, "error", true)}));
  save(context.out + "/figure13.png",
       chart("Paper preset, no pyramid, 1920x1080", "bit shift b", "ms a frame", "error %",
             {over_shifts(0, "time", false), over_shifts(0, "error", true)}));
  save(context.out + "/figure14.png",
       chart("Paper preset, both, 1920x1080", "pyramid level", "ms a frame", "error %",
             {over_levels(1, "time, b = 1", false), over_levels(3, "time, b = 3", false),
              over_levels(4, "time, b = 4", false), over_levels(1, "error, b = 1", true),
              over_levels(3, "error, b = 3", true), over_levels(4, "error, b = 4", true)}));
  return "## Pyramid level and bit shift (figures 12 to 14)\n\nMilliseconds a frame, 1920x1080 B G R, one "
         "thread, least processor time "
         "of 41 runs, and in brackets how many times faster than the unmodified algorithm in the same run (" +
         number(unmodified_time, 1) + " ms; default preset on the same pictures " + number(default_time, 2) +
         " ms, " + number(unmodified_time / default_time, 0) + "x).\n\n" + times.text() +
         "\nMean error over the sequences, % (unmodified: " + number(unmodified_error / sequences, 1) +
         ").\n\n" + errors.text() + "\nCharts: figure12.png, figure13.png, figure14.png.\n";
}

} // namespace terrainseg::experiments
