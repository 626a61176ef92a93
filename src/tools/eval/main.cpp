// SPDX-License-Identifier: LGPL-2.1-or-later
// terrainseg-eval: accuracy on labelled sequences.
#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <stdexcept>
#include <string>
#include <vector>

#include <opencv2/core/utils/logger.hpp>
#include <opencv2/imgcodecs.hpp>

#include "tools/eval/comparison.hpp"
#include "tools/eval/engines.hpp"
#include "tools/eval/figures.hpp"
#include "tools/eval/perturbations.hpp"
#include "tools/eval/report.hpp"
#include "tools/eval/sequence.hpp"
#include "tools/experiments/experiments.hpp"

namespace terrainseg::eval {
namespace {

namespace fs = std::filesystem;

constexpr int exit_usage = 2;

void print_usage(std::ostream& out) {
  out << "terrainseg-eval - accuracy on labelled sequences\n\n"
         "usage: terrainseg-eval [OPTIONS] SEQUENCE...\n"
         "       terrainseg-eval compare FIRST.json SECOND.json\n"
         "       terrainseg-eval paper|figures [--help]      the paper's experiments\n\n"
         "A SEQUENCE is a folder with frames/NNNN.{png,jpg}, labels/NNNN.png (0 obstacle, 1 terrain driven "
         "on, 2 other\n"
         "ground, 3 sky, 255 not labelled) and sequence.json (fps, window_bottom); or rendered, without any "
         "data:\n"
         "scene:KIND:LIGHT[:SEED], KIND road, trail, corridor or plain, LIGHT day, dusk or drift, twelve "
         "places each.\n"
         "docs/accuracy.md explains the figures.\n\n"
         "  --engine NAME      what is measured, more than once if wished (default: default)\n"
      << engine_help
      << "  --ablation         adds the default with each stage removed\n"
         "  --baselines        adds paper, reference, rows, ramp and mean-mask\n"
         "  --perturb NAME     measures on changed input too, more than once if wished; all = every one of\n"
         "                    ";
  for (const std::string& name : perturbation_names())
    out << ' ' << name;
  out << "\n  --caution-sweep    adds the default at nine values of caution: precision, recall and MaxF\n"
         "  --limit N          the first N frames of each sequence\n"
         "  --json FILE        figures of every run, and of every frame\n"
         "  --markdown FILE    the same as tables (default: on the standard output)\n"
         "  --pictures FOLDER  contact sheets of the best, median and worst frames, and plots\n"
         "  --help\n\n"
         "Exit code: 0 done, 1 something could not be read or measured, 2 wrong usage.\n";
}

struct Options {
  std::vector<std::string> sequences, engines, inputs;
  std::string json, markdown, pictures;
  bool ablation = false, caution_sweep = false;
  int limit = 0;
};

const std::string caution_mark = "default,caution=";

const std::vector<std::string> stages_removed{
    "texture=false",    "exposure=false",    "row-prior=false",     "local-reference=false",
    "geodesic=false",   "second-look=false", "ground-behind=false", "refine=false",
    "doubtful=-96",     "negatives=off",     "temporal=off",        "free-space=false",
    "learned-models=2", "training-models=3", "forget-shift=0"};

class UsageError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

Options parse(const std::vector<std::string>& arguments) {
  Options o;
  const auto add_all = [](std::vector<std::string>& list, const std::vector<std::string>& more) {
    list.insert(list.end(), more.begin(), more.end());
  };
  for (std::size_t i = 0; i < arguments.size(); ++i) {
    const std::string& a = arguments[i];
    const auto value = [&]() -> const std::string& {
      if (++i >= arguments.size())
        throw UsageError(a + " needs a value");
      return arguments[i];
    };
    if (a == "--engine")
      o.engines.push_back(value());
    else if (a == "--perturb") {
      const std::string& name = value();
      if (name == "all")
        add_all(o.inputs, perturbation_names());
      else
        o.inputs.push_back(name);
    } else if (a == "--limit") {
      try {
        o.limit = std::stoi(value());
      } catch (const std::logic_error&) {
        throw UsageError("--limit needs a number of frames");
      }
    } else if (a == "--json")
      o.json = value();
    else if (a == "--markdown")
      o.markdown = value();
    else if (a == "--pictures")
      o.pictures = value();
    else if (a == "--ablation")
      o.ablation = true;
    else if (a == "--caution-sweep")
      o.caution_sweep = true;
    else if (a == "--baselines")
      add_all(o.engines, {"default", "paper", "reference", "rows", "ramp", "mean-mask"});
    else if (a.starts_with("--"))
      throw UsageError(a + ": no such option");
    else
      o.sequences.push_back(a);
  }
  if (o.sequences.empty())
    throw UsageError("no SEQUENCE is given");
  if (o.engines.empty())
    o.engines.push_back("default");
  if (o.ablation)
    for (const std::string& stage : stages_removed)
      o.engines.push_back("default," + stage);
  if (o.caution_sweep)
    for (int caution = -32; caution <= 32; caution += 8)
      o.engines.push_back("default,caution=" + std::to_string(caution));
  std::vector<std::string> once;
  for (const std::string& engine : o.engines)
    if (std::find(once.begin(), once.end(), engine) == once.end())
      once.push_back(engine);
  o.engines = once;
  return o;
}

std::vector<Sample> read_all(const Sequence& sequence) {
  std::vector<Sample> samples;
  for (std::size_t i = 0; i < sequence.size(); ++i)
    samples.push_back(sequence.read(i));
  return samples;
}

std::vector<cv::Mat1b> labels_of(const std::vector<Sample>& samples) {
  std::vector<cv::Mat1b> labels;
  labels.reserve(samples.size());
  for (const Sample& s : samples)
    labels.push_back(s.labels);
  return labels;
}

Figures measure(const Sequence& sequence, const std::vector<Sample>& samples,
                const std::vector<cv::Mat1b>& labels, const std::string& engine, const std::string& input,
                std::vector<cv::Mat1b>* masks) {
  const auto running = make_engine(engine, sequence, labels);
  Scorer scorer(sequence.name, engine, input);
  for (std::size_t i = 0; i < samples.size(); ++i) {
    const Answer answer = running->look(samples[i].picture, i);
    scorer.add(answer, samples[i].labels);
    if (masks)
      masks->push_back(answer.mask);
  }
  return scorer.finish();
}

std::string one_digit(double value) {
  const std::string s = std::to_string(value);
  return s.substr(0, s.find('.') + 2);
}

void save(const fs::path& path, const cv::Mat& picture) {
  const bool jpeg = path.extension() == ".jpg";
  if (!cv::imwrite(path.string(), picture,
                   jpeg ? std::vector<int>{cv::IMWRITE_JPEG_QUALITY, 82} : std::vector<int>{}))
    throw std::runtime_error(path.string() + ": cannot be written");
}

/// Four of the best, of the middle and of the worst frames.
void draw_sheet(const fs::path& folder, const Figures& f, const std::vector<Sample>& samples,
                const std::vector<cv::Mat1b>& masks) {
  std::vector<FrameFigures> order = f.frames;
  std::sort(order.begin(), order.end(), [](const auto& a, const auto& b) { return a.error < b.error; });
  std::vector<Tile> tiles;
  const int count = static_cast<int>(order.size()), across = std::min(count, 4);
  for (const double place : {0.0, 0.5, 1.0}) {
    const int first = std::clamp(static_cast<int>(place * count) - (place > 0.9 ? across
                                                                    : place > 0 ? across / 2
                                                                                : 0),
                                 0, count - across);
    for (int k = 0; k < across; ++k) {
      const FrameFigures& frame = order[static_cast<std::size_t>(first + k)];
      tiles.push_back({judged(samples[frame.index].picture, samples[frame.index].labels, masks[frame.index]),
                       "frame " + std::to_string(frame.index) + ": " + one_digit(frame.error) + " % wrong"});
    }
  }
  save(folder / (f.sequence + "-sheet.jpg"), contact_sheet(tiles, across, 320));
}

void draw_error_plot(const fs::path& folder, const std::vector<Figures>& all, const std::string& sequence) {
  std::vector<Line> lines;
  for (const Figures& f : all) {
    if (f.sequence != sequence || f.input != "as it is" || f.engine.find(',') != std::string::npos ||
        lines.size() == 6)
      continue;
    Line line{f.engine, {}};
    for (const FrameFigures& frame : f.frames)
      line.points.emplace_back(static_cast<double>(frame.index), frame.error);
    lines.push_back(std::move(line));
  }
  save(folder / (sequence + "-errors.png"), line_plot(sequence + ": error by frame", "frame", "%", lines));
}

void draw_caution_plot(const fs::path& folder, const std::vector<Figures>& all) {
  std::vector<Line> lines;
  for (const Figures& f : all) {
    if (!f.engine.starts_with(caution_mark) || f.input != "as it is")
      continue;
    const auto line =
        std::find_if(lines.begin(), lines.end(), [&](const Line& l) { return l.name == f.sequence; });
    Line& l = line != lines.end() ? *line : lines.emplace_back(Line{f.sequence, {}});
    l.points.emplace_back(f.ground.unsafe_share(), f.ground.error());
  }
  if (!lines.empty())
    save(folder / "caution.png",
         line_plot("caution from -32 (right) to 32 (left): error against unsafe pixels", "unsafe, %",
                   "error %", lines));
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
    out << "| " << f.sequence << " | " << one_digit(best->ground.f_measure()) << " | "
        << best->engine.substr(8) << " | " << one_digit(best->ground.precision()) << " | "
        << one_digit(best->ground.recall()) << " |\n";
  }
}

void evaluate(const Options& o) {
  if (!o.pictures.empty())
    fs::create_directories(o.pictures);
  std::vector<Figures> all;
  for (const std::string& folder : o.sequences) {
    const Sequence sequence = open_sequence(folder, o.limit);
    const std::vector<Sample> samples = read_all(sequence);
    const std::vector<cv::Mat1b> labels = labels_of(samples);
    for (const std::string& engine : o.engines) {
      std::cerr << sequence.name << ": " << engine << '\n';
      const bool draw = !o.pictures.empty() && engine == o.engines[0];
      std::vector<cv::Mat1b> masks;
      all.push_back(measure(sequence, samples, labels, engine, "as it is", draw ? &masks : nullptr));
      if (draw)
        draw_sheet(o.pictures, all.back(), samples, masks);
    }
    if (!o.pictures.empty())
      draw_error_plot(o.pictures, all, sequence.name);
    for (const std::string& input : o.inputs) {
      std::cerr << sequence.name << ": " << o.engines[0] << ", " << input << '\n';
      std::vector<Sample> changed;
      changed.reserve(samples.size());
      for (const Sample& s : samples)
        changed.push_back({s.picture.clone(), s.labels.clone()});
      perturb(input, changed);
      all.push_back(measure(sequence, changed, labels_of(changed), o.engines[0], input, nullptr));
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
    write_json(file, all);
  }
  std::ofstream file;
  if (!o.markdown.empty())
    file = open(o.markdown);
  std::ostream& out = o.markdown.empty() ? std::cout : file;
  std::vector<Figures> engines, stages, cautions, perturbed, plain;
  for (const Figures& f : all) {
    const bool swept = f.engine.starts_with(caution_mark),
               removed = !swept && f.engine.starts_with("default,");
    if (f.engine == o.engines[0])
      perturbed.push_back(f);
    if (f.input != "as it is")
      continue;
    (swept ? cautions : removed ? stages : engines).push_back(f);
    if (!swept)
      plain.push_back(f);
  }
  // A report takes its tables from between these marks.
  const auto section = [&](const char* name, bool wanted, const auto& write) {
    if (!wanted)
      return;
    out << "\n<!-- section " << name << " -->\n";
    write();
  };
  section("engines", true, [&] { write_matrix(out, engines, false); });
  section("stages", !stages.empty(), [&] { write_matrix(out, stages, false); });
  section("inputs", !o.inputs.empty(), [&] { write_matrix(out, perturbed, true); });
  section("caution", !cautions.empty(), [&] { write_matrix(out, cautions, false); });
  section("max-f", !cautions.empty(), [&] { write_max_f(out, all); });
  section("details", true, [&] { write_markdown(out, plain); });
}

} // namespace
} // namespace terrainseg::eval

int main(int argc, char** argv) {
  using namespace terrainseg::eval;
  const std::vector<std::string> arguments(argv + 1, argv + argc);
  try {
    cv::utils::logging::setLogLevel(cv::utils::logging::LOG_LEVEL_SILENT);
    if (!arguments.empty() && (arguments[0] == "paper" || arguments[0] == "figures")) {
      const std::vector<std::string> rest(arguments.begin() + 1, arguments.end());
      if (std::count(rest.begin(), rest.end(), "--help") > 0)
        std::cout << terrainseg::experiments::usage;
      else if (arguments[0] == "paper")
        terrainseg::experiments::run_paper(rest);
      else
        terrainseg::experiments::run_figures(rest);
      return EXIT_SUCCESS;
    }
    if (arguments.empty() || std::count(arguments.begin(), arguments.end(), "--help") > 0) {
      print_usage(arguments.empty() ? std::cerr : std::cout);
      return arguments.empty() ? exit_usage : EXIT_SUCCESS;
    }
    if (arguments[0] == "compare") {
      if (arguments.size() != 3)
        throw UsageError("compare needs two JSON files");
      write_comparison(std::cout, read_json(arguments[1]), read_json(arguments[2]));
      return EXIT_SUCCESS;
    }
    evaluate(parse(arguments));
    return EXIT_SUCCESS;
  } catch (const UsageError& error) {
    std::cerr << "terrainseg-eval: " << error.what() << "; --help shows how\n";
    return exit_usage;
  } catch (const terrainseg::experiments::UsageError& error) {
    std::cerr << "terrainseg-eval: " << error.what() << '\n';
    return exit_usage;
  } catch (const std::exception& error) {
    std::cerr << "terrainseg-eval: " << error.what() << '\n';
    return EXIT_FAILURE;
  }
}
