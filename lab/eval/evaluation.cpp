// SPDX-License-Identifier: LGPL-2.1-or-later
#include "lab/eval/evaluation.hpp"

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <optional>
#include <stdexcept>

#include "lab/eval/charts.hpp"
#include "lab/eval/leave_out.hpp"
#include "lab/eval/measurement.hpp"
#include "lab/eval/perturbations.hpp"
#include "lab/eval/ramp_baseline.hpp"
#include "lab/eval/report.hpp"

namespace terrainseg::eval {
namespace {

namespace fs = std::filesystem;

/// Four of the best, of the middle and of the worst frames, each at most once, by error.
void draw_sheet(const fs::path& folder, const Figures& f, const std::vector<Sample>& samples,
                const std::vector<cv::Mat1b>& masks) {
  std::vector<FrameFigures> order = f.frames;
  std::sort(order.begin(), order.end(), [](const auto& a, const auto& b) { return a.error < b.error; });
  const int count = static_cast<int>(order.size()), across = std::min(count, 4);
  std::vector<Tile> tiles;
  for (const int i : frames_of_sheet(count)) {
    const FrameFigures& frame = order[static_cast<std::size_t>(i)];
    tiles.push_back(
        {judged(samples[frame.index].picture.bgr(), samples[frame.index].labels, masks[frame.index]),
         "frame " + std::to_string(frame.index) + ": " + number(frame.error) + " % wrong"});
  }
  save(folder / (f.sequence + "-sheet.jpg"), contact_sheet(tiles, across, 320));
}

void draw_error_plot(const fs::path& folder, const std::vector<Figures>& all, const std::string& sequence) {
  std::vector<Curve> curves;
  for (const Figures& f : all) {
    if (f.sequence != sequence || f.input != "as it is" || f.engine.find(',') != std::string::npos ||
        curves.size() == 6)
      continue;
    Curve line{f.engine, {}};
    for (const FrameFigures& frame : f.frames)
      line.points.emplace_back(static_cast<double>(frame.index), frame.error);
    curves.push_back(std::move(line));
  }
  save_chart(folder / (sequence + "-errors.chart.json"),
             {sequence + ": error by frame", "frame", "error %", "", curves});
}

void draw_caution_plot(const fs::path& folder, const std::vector<Figures>& all) {
  std::vector<Curve> curves;
  for (const Figures& f : all) {
    if (!f.engine.starts_with(caution_mark) || f.input != "as it is")
      continue;
    const auto line =
        std::find_if(curves.begin(), curves.end(), [&](const Curve& l) { return l.name == f.sequence; });
    Curve& l = line != curves.end() ? *line : curves.emplace_back(Curve{f.sequence, {}});
    l.points.emplace_back(f.ground.unsafe_share(), f.ground.error());
  }
  if (!curves.empty())
    save_chart(folder / "caution.chart.json",
               {"caution from -16 (right) to 16 (left): error against unsafe pixels", "unsafe %", "error %",
                "", curves});
}

void write_max_f(std::ostream& out, const std::vector<Figures>& all) {
  std::vector<std::string> done;
  for (const Figures& f : all) {
    if (!f.engine.starts_with(caution_mark) || std::find(done.begin(), done.end(), f.sequence) != done.end())
      continue;
    if (done.empty())
      out << "\n| MaxF over caution | MaxF | at | precision | recall |\n|---|---|---|---|---|\n";
    done.push_back(f.sequence);
    const Figures* best = &f;
    for (const Figures& g : all)
      if (g.sequence == f.sequence && g.engine.starts_with(caution_mark) && g.input == "as it is" &&
          g.ground.f_measure() > best->ground.f_measure())
        best = &g;
    out << "| " << f.sequence << " | " << number(best->ground.f_measure()) << " | " << best->engine.substr(8)
        << " | " << number(best->ground.precision()) << " | " << number(best->ground.recall()) << " |\n";
  }
}

} // namespace

void evaluate(const EvalOptions& o) {
  if (!o.pictures.empty())
    fs::create_directories(o.pictures);
  std::vector<Figures> all;
  for (const std::string& folder : o.sequences) {
    const Sequence sequence = open_sequence(folder, o.selection);
    const std::vector<Sample> samples = read_all(sequence);
    std::optional<double> ramp;
    if (sequence.stills)
      ramp = best_ramp_error(labels_of(samples));
    for (const std::string& engine : o.engines) {
      std::cerr << sequence.name << ": " << engine << '\n';
      const bool draw = !o.pictures.empty() && engine == o.engines[0];
      std::vector<cv::Mat1b> masks;
      all.push_back(measure(sequence, samples, engine, "as it is", draw ? &masks : nullptr));
      all.back().best_ramp = ramp;
      if (draw)
        draw_sheet(o.pictures, all.back(), samples, masks);
    }
    if (!o.pictures.empty())
      draw_error_plot(o.pictures, all, sequence.name);
    for (const std::string& input : o.inputs) {
      std::cerr << sequence.name << ": " << o.engines[0] << ", " << input << '\n';
      std::vector<Sample> changed = samples;
      perturb(input, changed, sequence.stills);
      all.push_back(measure(sequence, changed, o.engines[0], input));
    }
  }
  if (!o.pictures.empty())
    draw_caution_plot(o.pictures, all);

  const auto open = [](const std::string& path) {
    std::ofstream file(path);
    if (!file)
      throw std::runtime_error(path + ": cannot be written");
    return file;
  };
  if (!o.json.empty()) {
    std::ofstream file = open(o.json);
    write_json(file, all, o.kinds);
  }
  if (!o.csv.empty()) {
    std::ofstream file = open(o.csv);
    write_csv(file, all);
  }
  std::ofstream file;
  if (!o.markdown.empty())
    file = open(o.markdown);
  std::ostream& out = o.markdown.empty() ? std::cout : file;
  std::vector<Figures> engines, stages, cautions, perturbed, plain, stills, of_first, of_others, as_it_is;
  bool any_stage = false;
  for (const Figures& f : all) {
    const bool swept = f.engine.starts_with(caution_mark),
               removed = !swept && f.engine.starts_with("default,");
    if (f.engine == o.engines[0])
      perturbed.push_back(f);
    if (f.input != "as it is")
      continue;
    as_it_is.push_back(f);
    (swept ? cautions : removed ? stages : engines).push_back(f);
    if (f.engine == "default")
      stages.push_back(f); // what they are compared with
    any_stage = any_stage || removed;
    if (!swept)
      plain.push_back(f);
    if (!f.stills || removed)
      continue;
    stills.push_back(f);
    (f.engine == o.engines[0] ? of_first : of_others).push_back(f);
  }
  // A report takes its tables from between these marks.
  const bool marks = !o.markdown.empty();
  const auto section = [&](const char* name, bool wanted, const auto& write) {
    if (!wanted)
      return;
    if (marks)
      out << "\n<!-- section " << name << " -->\n";
    write();
  };
  section("engines", true, [&] { write_matrix(out, engines, false); });
  section("things", true, [&] { write_things_matrix(out, engines); });
  section("stills-engines", !stills.empty() && o.engines.size() > 1,
          [&] { write_stills_matrix(out, stills); });
  section("stills", !stills.empty(), [&] { write_stills(out, of_first); });
  section("stills-others", !stills.empty() && o.engines.size() > 1, [&] { write_stills(out, of_others); });
  section("stages", any_stage, [&] { write_matrix(out, stages, false); });
  section("stage-things", any_stage, [&] { write_things_matrix(out, stages); });
  section("inputs", !o.inputs.empty(), [&] { write_matrix(out, perturbed, true); });
  section("caution", !cautions.empty(), [&] { write_matrix(out, cautions, false); });
  section("max-f", !cautions.empty(), [&] { write_max_f(out, all); });
  section("leave-out", o.leave_out, [&] { write_leave_out(out, as_it_is, o.kinds, o.unsafe_weight); });
  section("confidence", o.confidence, [&] { write_sureness(out, plain); });
  section("details", true, [&] { write_markdown(out, plain); });
}

} // namespace terrainseg::eval
