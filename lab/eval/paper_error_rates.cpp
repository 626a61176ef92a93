// SPDX-License-Identifier: LGPL-2.1-or-later
// Table 2 and figures 12 to 14: what the pyramid and the bit shift cost in error and save in time.
#include <algorithm>
#include <array>
#include <memory>

#include "lab/eval/charts.hpp"
#include "lab/eval/engines.hpp"
#include "lab/eval/measurement.hpp"
#include "lab/eval/paper_parts.hpp"
#include "lab/eval/parallel.hpp"
#include "lab/eval/table.hpp"

namespace terrainseg::eval {

namespace {

constexpr int levels = 7, shifts = 8; // 0..6, 0..7

std::string paper_engine(int level, int shift) {
  return "paper,input=BGR,pyramid-levels=" + std::to_string(level) + ",bit-shift=" + std::to_string(shift);
}

std::string both(const Counts& counts) {
  return number(counts.error(), 1) + " / " + number(counts.unsafe_share(), 1);
}

/// The figures of many engines over one sequence, in their order.
std::vector<Counts> counts_of(const std::vector<std::string>& engines, const Sequence& sequence) {
  const std::vector<Sample> samples = read_all(sequence);
  std::vector<Counts> counts(engines.size());
  for_each_in_parallel(engines.size(), [&](std::size_t i, std::size_t) {
    counts[i] = measure(sequence, samples, engines[i], "as it is").ground;
  });
  return counts;
}

/// Milliseconds: the least of some runs, what the work costs with the caches to itself.
double least_time(const std::string& engine, const std::vector<Picture>& pictures) {
  constexpr std::size_t warm_up = 3, runs = 41;
  const std::unique_ptr<Engine> running = make_engine(engine, {}, {});
  std::vector<double> times;
  for (std::size_t i = 0; i < warm_up + runs; ++i) {
    const Answer answer = running->look(pictures[i % pictures.size()], i);
    if (i >= warm_up)
      times.push_back(answer.milliseconds);
  }
  return *std::min_element(times.begin(), times.end());
}

} // namespace

std::string error_rates(const Context& context) {
  const std::vector<std::string> engines{"reference", paper_engine(5, 0), paper_engine(5, 3), "default",
                                         "rows"};
  Table table({"sequence", "unmodified", "pyramid, 1/32", "pyramid and b = 3", "default",
               "best row, with the labels"});
  for (const Sequence& sequence : paper_sequences(context.data, context.selection)) {
    context.tell("error rates: " + sequence.name);
    std::vector<std::string> row{sequence.name};
    for (const Counts& counts : counts_of(engines, sequence))
      row.push_back(both(counts));
    table.add(row);
  }
  return "## Error rates (Table 2)\n\nError in % of the labelled pixels / obstacle pixels of the bottom "
         "third that are called traversable, in %. The default from I420, the others from B "
         "G R.\n\n" +
         table.text();
}

std::string scale_and_shift(const Context& context) {
  context.tell("time over level and shift");
  const std::vector<Picture> pictures = speed_pictures(context.data);
  double time[levels][shifts];
  for (int level = 0; level < levels; ++level)
    for (int shift = 0; shift < shifts; ++shift)
      time[level][shift] = least_time(paper_engine(level, shift), pictures);
  const double unmodified_time = least_time("reference", pictures),
               default_time = least_time("default,input=BGR", pictures);

  double error[levels][shifts] = {}, unmodified_error = 0;
  int sequences = 0;
  std::vector<std::string> engines;
  for (int level = 0; level < levels; ++level)
    for (int shift = 0; shift < shifts; ++shift)
      engines.push_back(paper_engine(level, shift));
  engines.push_back("reference");
  for (const Sequence& sequence : paper_sequences(context.data, context.selection)) {
    context.tell("error over level and shift: " + sequence.name);
    const std::vector<Counts> counts = counts_of(engines, sequence);
    for (int level = 0; level < levels; ++level)
      for (int shift = 0; shift < shifts; ++shift)
        error[level][shift] += counts[static_cast<std::size_t>(level * shifts + shift)].error();
    unmodified_error += counts.back().error();
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
  const auto save = [&](const char* figure, const char* title, const char* x_name,
                        std::vector<Curve> curves) {
    save_chart(context.out + "/" + figure + ".chart.json",
               {title, x_name, "ms a frame", "error %", std::move(curves)});
  };
  save("figure12", "Paper preset, b = 0, 1920x1080", "pyramid level",
       {over_levels(0, "time", false), over_levels(0, "error", true)});
  save("figure13", "Paper preset, no pyramid, 1920x1080", "bit shift b",
       {over_shifts(0, "time", false), over_shifts(0, "error", true)});
  save("figure14", "Paper preset, both, 1920x1080", "pyramid level",
       {over_levels(1, "time, b = 1", false), over_levels(3, "time, b = 3", false),
        over_levels(4, "time, b = 4", false), over_levels(1, "error, b = 1", true),
        over_levels(3, "error, b = 3", true), over_levels(4, "error, b = 4", true)});
  return "## Pyramid level and bit shift (figures 12 to 14)\n\nMilliseconds a frame, 1920x1080 B G R, one "
         "thread, least processor time "
         "of 41 runs, and in brackets how many times faster than the unmodified algorithm in the same run (" +
         number(unmodified_time, 1) + " ms; default preset on the same pictures " + number(default_time, 2) +
         " ms, " + number(unmodified_time / default_time, 0) + "x).\n\n" + times.text() +
         "\nMean error over the sequences, % (unmodified: " + number(unmodified_error / sequences, 1) +
         ").\n\n" + errors.text() + "\nCharts: figure12.png, figure13.png, figure14.png (draw_charts.py).\n";
}

} // namespace terrainseg::eval
