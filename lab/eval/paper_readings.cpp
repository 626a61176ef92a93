// SPDX-License-Identifier: LGPL-2.1-or-later
// How much each reading of an ambiguous or wrong place in the paper matters.
#include <cmath>

#include "lab/eval/engines.hpp"
#include "lab/eval/figures.hpp"
#include "lab/eval/paper_parts.hpp"
#include "lab/eval/table.hpp"
#include "lab/reference/paper_reading.hpp"

namespace terrainseg::eval {

namespace {

using namespace reference;

struct Variant {
  std::string name;
  Readings readings;
};

std::vector<Variant> variants() {
  std::vector<Variant> all{{"as the paper preset reads it", {}}};
  const auto add = [&](const std::string& name, auto change) {
    Variant v{name, {}};
    change(v.readings);
    all.push_back(v);
  };
  add("level for about 60 cells (3)", [](Readings& r) { r.levels = 3; });
  add("no pyramid, b = 0", [](Readings& r) { r.levels = r.bit_shift = 0; });
  add("b = 4", [](Readings& r) { r.bit_shift = 4; });
  add("bins stand for their lower edge", [](Readings& r) { r.bins = BinRule::lower_edge; });
  add("window upright, 64 x 128", [](Readings& r) { r.upright_window = true; });
  add("no pre-filter", [](Readings& r) { r.window_sigma = 0; });
  add("pre-filter may keep less than half", [](Readings& r) { r.keep_half = false; });
  add("trained at 1/32 however few the samples", [](Readings& r) { r.finer_when_few = false; });
  add("centres from the colour cube", [](Readings& r) { r.centres = CentreRule::color_cube; });
  add("another seed", [](Readings& r) { r.seed = 7; });
  add("K = 1, N = 5", [](Readings& r) { r.training_models = 1; });
  add("variance floor 1, no quantisation variance", [](Readings& r) {
    r.variance_floor = 1;
    r.quantisation_variance = false;
  });
  add("variance floor 64", [](Readings& r) { r.variance_floor = 64; });
  add("no mass cap", [](Readings& r) { r.mass_cap = 0; });
  add("mass cap of 1 frame", [](Readings& r) { r.mass_cap = 1; });
  add("first match instead of nearest", [](Readings& r) { r.match = MatchRule::first; });
  add("no horizon", [](Readings& r) { r.horizon = HorizonRule::off; });
  add("(11) as printed: first minimal row", [](Readings& r) { r.horizon = HorizonRule::first_minimum; });
  add("(11) lowest minimal row, never null", [](Readings& r) { r.horizon = HorizonRule::lowest_minimum; });
  add("(12) as printed: ground above the row", [](Readings& r) { r.horizon = HorizonRule::flipped; });
  add("(10) as printed: 2 sigma^2", [](Readings& r) { r.horizon_by_variance = true; });
  add("(10) without a least variance", [](Readings& r) { r.horizon_floor = 0; });
  add("threshold 2 sigma", [](Readings& r) { r.threshold = 2; });
  add("threshold 4 sigma", [](Readings& r) { r.threshold = 4; });
  return all;
}

struct Tally {
  Counts counts;
  std::vector<double> horizon_off;
  double clusters = 0, frames = 0, nulls = 0, with_horizon = 0;
};

void count_horizon(Tally& tally, int said, const cv::Mat1b& labels) {
  const int truth = true_horizon(labels);
  if (truth < 0)
    return;
  tally.with_horizon += 1;
  if (said < 0)
    tally.nulls += 1;
  else
    tally.horizon_off.push_back(100.0 * std::abs(said - truth) / labels.rows);
}

} // namespace

std::string readings(const Context& context) {
  const std::vector<Variant> all = variants();
  std::vector<std::vector<Tally>> tallies;
  std::vector<std::string> head{"reading", "mean error %", "unsafe %"};
  double apart = 0, compared = 0;
  for (const Sequence& sequence : paper_sequences(context.data, context.selection)) {
    context.tell("readings: " + sequence.name);
    head.push_back(sequence.name);
    std::vector<PaperReading> subjects;
    for (Variant variant : all) {
      variant.readings.window_bottom = sequence.window_bottom;
      subjects.emplace_back(variant.readings);
    }
    Settings paper = Settings::of(Preset::paper);
    paper.window_bottom = sequence.window_bottom;
    const auto filter = make_filter(paper, 0, PixelFormat::BGR);
    std::vector<Tally> tally(all.size());
    for (std::size_t i = 0; i < sequence.size(); ++i) {
      const Sample sample = sequence.read(i);
      const cv::Mat3b bgr = sample.picture.bgr();
      for (std::size_t k = 0; k < all.size(); ++k) {
        tally[k].counts += count_pixels(subjects[k].process(bgr), sample.labels);
        tally[k].clusters += subjects[k].live_clusters();
        tally[k].frames += 1;
        if (all[k].readings.horizon != HorizonRule::off)
          count_horizon(tally[k], subjects[k].horizon_row(), sample.labels);
        if (k == 0) {
          apart += cv::countNonZero(filter->look(sample.picture, i).mask != subjects[0].mask());
          compared += static_cast<double>(sample.labels.total());
        }
      }
    }
    tallies.push_back(tally);
  }
  head.insert(head.end(), {"horizon off by, median % of height", "null %", "clusters alive"});
  Table table(head);
  for (std::size_t k = 0; k < all.size(); ++k) {
    double error = 0, unsafe = 0, clusters = 0, frames = 0, nulls = 0, with_horizon = 0;
    std::vector<double> off;
    std::vector<std::string> row{all[k].name, "", ""};
    for (const auto& tally : tallies) {
      const Tally& t = tally[k];
      error += t.counts.error() / static_cast<double>(tallies.size());
      unsafe += t.counts.unsafe_share() / static_cast<double>(tallies.size());
      clusters += t.clusters;
      frames += t.frames;
      nulls += t.nulls;
      with_horizon += t.with_horizon;
      off.insert(off.end(), t.horizon_off.begin(), t.horizon_off.end());
      row.push_back(number(t.counts.error(), 1));
    }
    row[1] = number(error, 1);
    row[2] = number(unsafe, 1);
    row.push_back(off.empty() ? "" : number(spread_of(off)->median, 1));
    row.push_back(with_horizon > 0 ? number(100 * nulls / with_horizon, 0) : "");
    row.push_back(number(clusters / frames, 2));
    table.add(row);
  }
  return "## Readings of the text\n\nThe paper's pipeline in doubles with one place read otherwise at a "
         "time; error in % "
         "per sequence. Against the filter's integer paper preset the first row differs in " +
         number(100 * apart / compared, 2) + " % of the pixels.\n\n" + table.text();
}

} // namespace terrainseg::eval
