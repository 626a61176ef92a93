// SPDX-License-Identifier: LGPL-2.1-or-later
#include "lab/eval/options.hpp"

#include <algorithm>
#include <stdexcept>

#include "lab/eval/engines.hpp"
#include "lab/eval/perturbations.hpp"

namespace terrainseg::eval {
namespace {

using tools::OptionContext, tools::Word, tools::Words, tools::parse;

const std::vector<std::string> stages_changed{
    "texture=false",     "exposure=false",      "row-prior=false",        "local-reference=false",
    "geodesic=false",    "second-look=false",   "connected-ground=false", "light-ahead=false",
    "upright=false",     "long-lines=false",    "odd-spots=false",        "near-spots=false",
    "far-spots=false",   "stone-field=false",   "window-guard=false",     "vivid-colors=false",
    "motion=off",        "ground-behind=false", "refine=false",           "doubtful=-96",
    "negatives=off",     "temporal=off",        "free-space=false",       "learned-models=4",
    "training-models=1", "forget-shift=0"};

const std::vector<std::string> baselines{"default", "paper", "reference", "rows", "ramp", "mean-mask"};

constexpr const char* summary =
    "Accuracy on labelled sequences.\n\n"
    "Other commands:\n"
    "  terrainseg-eval compare FIRST.json SECOND.json   whether a change helps\n"
    "  terrainseg-eval tuning                           the tuned constants of the default pipeline\n"
    "  terrainseg-eval metres [--help]                  how right ranges in metres are\n"
    "  terrainseg-eval paper|figures [--help]           the paper's experiments\n\n"
    "A SEQUENCE is a folder with frames/NNNN.{png,jpg}, labels/NNNN.png (0 obstacle, 1 terrain driven on, 2 "
    "other\n"
    "ground, 3 sky, 255 not labelled) and sequence.json (fps, window_bottom, stills, kind,\n"
    "horizon); or rendered, "
    "without any data:\n"
    "  scene:KIND:LIGHT[:SEED]   twelve places, ten frames of each, 0.3 s apart\n"
    "  scene:KIND:LIGHT:MOTION[@WIDTHxHEIGHT][#FIRST[-LAST]]   drives of 90 frames at 30 Hz, one per seed "
    "(101-106),\n"
    "                            scored from frame 60 on\n"
    "KIND is road, trail, corridor or plain, LIGHT day, dusk, drift or sun (+wet: with puddles), MOTION\n"
    "straight, turn, bumpy or still.\n"
    "With \"stills\": true each frame is shown four times, its last mask scored, and all forgotten.\n"
    "docs/accuracy.md explains the figures.";

Selection selection_of(int limit, int every) {
  if (limit < 0 || every < 1)
    throw UsageError("--limit and --every take a number of frames, 1 or more");
  return {limit, every};
}

/// The options of the evaluation as GLib sees them.
struct EvalEntries {
  Words sequences, engines, inputs, kinds;
  Word json, csv, markdown, pictures;
  gboolean ablation = FALSE, with_baselines = FALSE, sweep = FALSE, confidence = FALSE, leave_out = FALSE;
  double unsafe_weight = 0;
  int limit = 0, every = 1;

  OptionContext context() {
    const GOptionEntry entries[] = {
        {"engine", 0, 0, G_OPTION_ARG_STRING_ARRAY, &engines.list,
         "Engine to measure; may be repeated (default: default)", "NAME"},
        {"ablation", 0, 0, G_OPTION_ARG_NONE, &ablation, "Also measure the default with each stage removed",
         nullptr},
        {"baselines", 0, 0, G_OPTION_ARG_NONE, &with_baselines,
         "Also measure paper, reference, rows, ramp and mean-mask", nullptr},
        {"perturb", 0, 0, G_OPTION_ARG_STRING_ARRAY, &inputs.list,
         "Also measure on changed input; may be repeated; all = every change", "NAME"},
        {"caution-sweep", 0, 0, G_OPTION_ARG_NONE, &sweep,
         "Also measure the default at five values of caution: precision, recall and MaxF", nullptr},
        {"confidence", 0, 0, G_OPTION_ARG_NONE, &confidence,
         "Also report the share of right labels by the value of the confidence map", nullptr},
        {"leave-out", 0, 0, G_OPTION_ARG_NONE, &leave_out,
         "Also report, for each kind of place, the engine that is best on all other kinds, and its result",
         nullptr},
        {"kind", 0, 0, G_OPTION_ARG_STRING_ARRAY, &kinds.list,
         "Kind of the sequences whose name matches; may be repeated, the first match counts (default: the "
         "names "
         "of the project's own data)",
         "KIND=REGEX"},
        {"unsafe-weight", 0, 0, G_OPTION_ARG_DOUBLE, &unsafe_weight,
         "The best engine is that with the smallest error + WEIGHT x unsafe (default: 0)", "WEIGHT"},
        {"limit", 0, 0, G_OPTION_ARG_INT, &limit, "Only the first N frames of each sequence", "N"},
        {"every", 0, 0, G_OPTION_ARG_INT, &every, "Only every Nth frame", "N"},
        {"json", 0, 0, G_OPTION_ARG_FILENAME, &json.text, "Write the figures of every run and frame", "FILE"},
        {"csv", 0, 0, G_OPTION_ARG_FILENAME, &csv.text, "Write the figures of every run, one line each",
         "FILE"},
        {"markdown", 0, 0, G_OPTION_ARG_FILENAME, &markdown.text,
         "Write the figures as tables (default: to standard output)", "FILE"},
        {"pictures", 0, 0, G_OPTION_ARG_FILENAME, &pictures.text,
         "Write contact sheets of the best, median and worst frames, and charts for draw_charts.py",
         "FOLDER"},
        {G_OPTION_REMAINING, 0, 0, G_OPTION_ARG_FILENAME_ARRAY, &sequences.list, nullptr, nullptr},
        {nullptr, 0, 0, G_OPTION_ARG_NONE, nullptr, nullptr, nullptr}};
    OptionContext made(g_option_context_new("SEQUENCE..."));
    g_option_context_add_main_entries(made.get(), entries, nullptr);
    g_option_context_set_summary(made.get(), summary);
    std::string more = std::string("Engines:\n") + engine_help + "\nChanged input:";
    for (const std::string& name : perturbation_names())
      more += " " + name;
    more += "\n\nExit code: 0 done, 1 something could not be read or measured, 2 wrong usage.";
    g_option_context_set_description(made.get(), more.c_str());
    return made;
  }
};

std::vector<std::string> engines_of(const EvalEntries& e) {
  std::vector<std::string> wanted = e.engines.all();
  if (e.with_baselines)
    wanted.insert(wanted.end(), baselines.begin(), baselines.end());
  if (wanted.empty())
    wanted.push_back("default");
  if (e.ablation)
    for (const std::string& stage : stages_changed)
      wanted.push_back("default," + stage);
  if (e.sweep)
    for (int caution = -16; caution <= 16; caution += 8)
      wanted.push_back(caution_mark + std::to_string(caution));
  std::vector<std::string> once;
  for (const std::string& engine : wanted)
    if (std::find(once.begin(), once.end(), engine) == once.end())
      once.push_back(engine);
  return once;
}

std::vector<KindRule> kinds_of(const EvalEntries& e) {
  if (e.kinds.all().empty())
    return usual_kinds();
  std::vector<KindRule> rules;
  try {
    for (const std::string& text : e.kinds.all())
      rules.push_back(parse_kind_rule(text));
  } catch (const std::runtime_error& problem) {
    throw UsageError(problem.what());
  }
  return rules;
}

/// A wrong word must not end a run after hours. Leaves the tuned constants as the source has them.
void check_names(const EvalOptions& o) {
  try {
    for (const std::string& engine : o.engines)
      if (engine.starts_with("default") || engine.starts_with("paper")) {
        tune(engine);
        filter_settings(engine, 0);
      }
    tune("default");
    for (const std::string& input : o.inputs)
      check_perturbation(input);
  } catch (const std::runtime_error& problem) {
    throw UsageError(problem.what());
  }
}

} // namespace

std::string eval_help() {
  g_set_prgname("terrainseg-eval");
  EvalEntries entries;
  g_autofree char* text = g_option_context_get_help(entries.context().get(), TRUE, nullptr);
  return text;
}

EvalOptions parse_eval_options(const std::vector<std::string>& words) {
  EvalEntries e;
  parse(e.context().get(), words, "terrainseg-eval");
  EvalOptions o;
  o.sequences = e.sequences.all();
  if (o.sequences.empty())
    throw UsageError("no SEQUENCE is given");
  o.engines = engines_of(e);
  for (const std::string& name : e.inputs.all())
    if (name == "all")
      o.inputs.insert(o.inputs.end(), perturbation_names().begin(), perturbation_names().end());
    else
      o.inputs.push_back(name);
  o.json = e.json.value();
  o.csv = e.csv.value();
  o.markdown = e.markdown.value();
  o.pictures = e.pictures.value();
  o.selection = selection_of(e.limit, e.every);
  o.confidence = e.confidence;
  o.leave_out = e.leave_out;
  o.kinds = kinds_of(e);
  o.unsafe_weight = e.unsafe_weight;
  check_names(o);
  return o;
}

MetresOptions parse_metres_options(const std::vector<std::string>& words) {
  constexpr int most_places = 100;
  MetresOptions o;
  Word csv;
  Words others;
  const GOptionEntry entries[] = {
      {"places", 0, 0, G_OPTION_ARG_INT, &o.places, "Rendered places of each kind (default: 3)", "N"},
      {"csv", 0, 0, G_OPTION_ARG_FILENAME, &csv.text, "The same figures, one line each", "FILE"},
      {G_OPTION_REMAINING, 0, 0, G_OPTION_ARG_STRING_ARRAY, &others.list, nullptr, nullptr},
      {nullptr, 0, 0, G_OPTION_ARG_NONE, nullptr, nullptr, nullptr}};
  const OptionContext context(g_option_context_new(nullptr));
  g_option_context_add_main_entries(context.get(), entries, nullptr);
  g_option_context_set_summary(
      context.get(),
      "Errors of ranges in metres on rendered drives, by distance, as Markdown: what geometry, the\n"
      "filter's boundary and the attitude have in them. docs/metres.md explains the figures.");
  parse(context.get(), words, "terrainseg-eval metres");
  if (!others.all().empty())
    throw UsageError(others.all().front() + ": not an option");
  if (o.places < 1 || o.places > most_places)
    throw UsageError("--places takes 1 to 100 places");
  o.csv = csv.value();
  return o;
}

PaperOptions parse_paper_options(const std::vector<std::string>& words, bool with_parts) {
  Words only, others;
  Word data, out;
  int limit = 0;
  const GOptionEntry common[] = {
      {"data", 0, 0, G_OPTION_ARG_FILENAME, &data.text,
       "A folder of labelled sequences; without it scenes are rendered", "FOLDER"},
      {"out", 0, 0, G_OPTION_ARG_FILENAME, &out.text, "Where the results go (default: paper)", "FOLDER"},
      {"limit", 0, 0, G_OPTION_ARG_INT, &limit, "The first N frames of each sequence", "N"},
      {G_OPTION_REMAINING, 0, 0, G_OPTION_ARG_STRING_ARRAY, &others.list, nullptr, nullptr},
      {nullptr, 0, 0, G_OPTION_ARG_NONE, nullptr, nullptr, nullptr}};
  const GOptionEntry parts[] = {{"only", 0, 0, G_OPTION_ARG_STRING_ARRAY, &only.list,
                                 "table1, table2, curves, training or readings; more than once if wished",
                                 "PART"},
                                {nullptr, 0, 0, G_OPTION_ARG_NONE, nullptr, nullptr, nullptr}};
  const OptionContext context(g_option_context_new(nullptr));
  if (with_parts)
    g_option_context_add_main_entries(context.get(), parts, nullptr);
  g_option_context_add_main_entries(context.get(), common, nullptr);
  g_option_context_set_summary(context.get(), with_parts
                                                  ? "Tables and figures of the paper, as Markdown and charts."
                                                  : "Pictures after the paper's figures 4 to 9.");
  parse(context.get(), words, with_parts ? "terrainseg-eval paper" : "terrainseg-eval figures");
  if (!others.all().empty())
    throw UsageError(others.all().front() + ": not an option");
  PaperOptions o;
  o.data = data.value();
  o.out = out.value("paper");
  o.only = only.all();
  o.selection = selection_of(limit, 1);
  return o;
}

} // namespace terrainseg::eval
