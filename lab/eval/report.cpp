// SPDX-License-Identifier: LGPL-2.1-or-later
#include "lab/eval/report.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>
#include <stdexcept>
#include <utility>

#include <nlohmann/json.hpp>

#include "exchange/counted.hpp"
#include "lab/eval/statistics.hpp"
#include "lab/eval/table.hpp"

namespace terrainseg::eval {
namespace {

std::optional<double> part(const std::optional<Spread>& spread, double Spread::*which) {
  return spread ? std::optional(*spread.*which) : std::nullopt;
}

/// Rounded to three decimals.
double rounded(double value) {
  return std::round(value * 1000) / 1000;
}

nlohmann::ordered_json json(const std::optional<double>& value) {
  return value ? nlohmann::ordered_json(rounded(*value)) : nullptr;
}

nlohmann::ordered_json json(const Counts& c) {
  return {{"error", rounded(c.error())},
          {"iou", rounded(c.iou())},
          {"precision", rounded(c.precision())},
          {"recall", rounded(c.recall())},
          {"f", rounded(c.f_measure())},
          {"unsafe", rounded(c.unsafe_share())},
          {"false_safe", rounded(c.false_safe_share())}};
}

std::string unsafe_text(const Counts& c) {
  return c.near_obstacles > 0 ? number(c.unsafe_share()) : "-";
}

std::string things_text(const Things& t) {
  return t.count > 0 ? number(t.missed_share()) + " of " + std::to_string(t.count) : "-";
}

std::vector<std::string> distinct(const std::vector<Figures>& all, std::string Figures::*member) {
  std::vector<std::string> values;
  for (const Figures& f : all)
    if (std::find(values.begin(), values.end(), f.*member) == values.end())
      values.push_back(f.*member);
  return values;
}

} // namespace

void write_json(std::ostream& out, const std::vector<Figures>& all, const std::vector<KindRule>& kinds) {
  nlohmann::ordered_json runs = nlohmann::ordered_json::array();
  for (const Figures& f : all) {
    std::vector<double> errors, unsafe;
    for (const FrameFigures& frame : f.frames) {
      errors.push_back(rounded(frame.error));
      unsafe.push_back(rounded(frame.unsafe));
    }
    runs.push_back(
        {{"sequence", f.sequence},
         {"engine", f.engine},
         {"input", f.input},
         {"kind", kind_of(f, kinds)},
         {"width", f.width},
         {"height", f.height},
         {"stills", f.stills},
         {"ground", json(f.ground)},
         {"terrain", json(f.terrain)},
         {"doubtful_as_ground", json(f.without_doubt_zone)},
         {"horizon",
          {{"median", json(part(f.horizon, &Spread::median))},
           {"p90", json(part(f.horizon, &Spread::p90))},
           {"null", json(f.horizon_null)}}},
         {"boundary", {{"within", json(f.boundary_within)}, {"over", json(f.boundary_over)}}},
         {"flicker", json(f.flicker)},
         {"frame_error",
          {{"median", json(part(f.frame_error, &Spread::median))},
           {"p90", json(part(f.frame_error, &Spread::p90))}}},
         {"mean_error", rounded(f.mean_error())},
         {"mean_terrain", rounded(f.mean_terrain_error())},
         {"best_ramp", json(f.best_ramp)},
         {"things", {{"count", f.things.count}, {"missed", f.things.missed}}},
         {"confidence_rank", json(f.confidence_rank)},
         {"milliseconds",
          {{"median", json(part(f.latency, &Spread::median))}, {"p99", json(part(f.latency, &Spread::p99))}}},
         {"frame_errors", errors},
         {"frame_unsafe", unsafe}});
  }
  const nlohmann::ordered_json document = {{"runs", std::move(runs)}};
  out << document.dump(-1, ' ', false, nlohmann::ordered_json::error_handler_t::replace) << '\n';
}

void write_csv(std::ostream& out, const std::vector<Figures>& all) {
  const auto cell = [](const std::optional<double>& value) { return value ? number(*value, 3) : ""; };
  const auto word = [](const std::string& s) { return s.find(',') == s.npos ? s : '"' + s + '"'; };
  out << "sequence,engine,input,frames,width,height,error,mean_error,p50_error,p90_error,unsafe,false_safe,"
         "precision,recall,iou,f,terrain_error,mean_terrain_error,best_ramp,things,things_missed,horizon_p50,"
         "horizon_p90,horizon_null,boundary_within,boundary_over,flicker,confidence_rank,ms_p50,ms_p99\n";
  for (const Figures& f : all) {
    out << word(f.sequence) << ',' << word(f.engine) << ',' << word(f.input) << ',' << f.frames.size() << ','
        << f.width << ',' << f.height;
    const std::optional<double> unsafe =
        f.ground.near_obstacles > 0 ? std::optional(f.ground.unsafe_share()) : std::nullopt;
    for (const std::optional<double>& value :
         {std::optional(f.ground.error()), std::optional(f.mean_error()),
          part(f.frame_error, &Spread::median), part(f.frame_error, &Spread::p90), unsafe,
          std::optional(f.ground.false_safe_share()), std::optional(f.ground.precision()),
          std::optional(f.ground.recall()), std::optional(f.ground.iou()),
          std::optional(f.ground.f_measure()), std::optional(f.terrain.error()),
          std::optional(f.mean_terrain_error()), f.best_ramp})
      out << ',' << cell(value);
    out << ',' << f.things.count << ',' << f.things.missed;
    for (const std::optional<double>& value :
         {part(f.horizon, &Spread::median), part(f.horizon, &Spread::p90), f.horizon_null, f.boundary_within,
          f.boundary_over, f.flicker, f.confidence_rank, part(f.latency, &Spread::median),
          part(f.latency, &Spread::p99)})
      out << ',' << cell(value);
    out << '\n';
  }
}

std::vector<Figures> read_json(const std::string& path) {
  std::ifstream file(path);
  if (!file)
    throw std::runtime_error(path + ": cannot be read");
  try {
    std::vector<Figures> all;
    const nlohmann::json document = nlohmann::json::parse(file);
    for (const auto& run : document.at("runs")) {
      Figures f;
      f.sequence = run.at("sequence");
      f.engine = run.at("engine");
      f.input = run.at("input");
      f.stills = run.value("stills", false);
      const std::vector<double> errors = run.at("frame_errors"), unsafe = run.at("frame_unsafe");
      for (std::size_t i = 0; i < errors.size(); ++i) {
        FrameFigures frame;
        frame.index = i;
        frame.error = errors[i];
        frame.unsafe = unsafe.at(i);
        f.frames.push_back(frame);
      }
      all.push_back(std::move(f));
    }
    return all;
  } catch (const std::exception&) {
    throw std::runtime_error(path + ": not the JSON that --json writes");
  }
}

void write_markdown(std::ostream& out, const std::vector<Figures>& all) {
  for (const std::string& sequence : distinct(all, &Figures::sequence))
    for (const std::string& input : distinct(all, &Figures::input)) {
      bool head = false;
      for (const Figures& f : all) {
        if (f.sequence != sequence || f.input != input)
          continue;
        if (!head)
          out << "\n**" << sequence << "**" << (input == "as it is" ? "" : ", " + input) << " ("
              << counted(f.frames.size(), "frame") << ", " << f.width << "x" << f.height << ")\n\n"
              << "| engine | error | p50 / p90 of frames | unsafe | false-safe | precision | recall | IoU | "
                 "F | terrain "
                 "error | things missed | horizon p50 / p90 (null) | boundary within 2 % (beyond) | flicker "
                 "| confidence "
                 "rank | ms p50 "
                 "/ p99 |\n|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|\n";
        head = true;
        out << "| " << f.engine << " | " << number(f.ground.error(), 2) << " | "
            << number(part(f.frame_error, &Spread::median)) << " / "
            << number(part(f.frame_error, &Spread::p90)) << " | " << number(f.ground.unsafe_share()) << " | "
            << number(f.ground.false_safe_share()) << " | " << number(f.ground.precision()) << " | "
            << number(f.ground.recall()) << " | " << number(f.ground.iou()) << " | "
            << number(f.ground.f_measure()) << " | " << number(f.terrain.error(), 2) << " | "
            << things_text(f.things) << " | " << number(part(f.horizon, &Spread::median)) << " / "
            << number(part(f.horizon, &Spread::p90)) << " (" << number(f.horizon_null, 0) << ") | "
            << number(f.boundary_within) << " (" << number(f.boundary_over) << ") | " << number(f.flicker, 2)
            << " | " << number(f.confidence_rank, 2) << " | " << number(part(f.latency, &Spread::median), 2)
            << " / " << number(part(f.latency, &Spread::p99), 2) << " |\n";
      }
    }
}

void write_matrix(std::ostream& out, const std::vector<Figures>& all, bool by_input) {
  const auto sequences = distinct(all, &Figures::sequence);
  std::string Figures::*row = by_input ? &Figures::input : &Figures::engine;
  out << "\n| error / unsafe, % |";
  for (const std::string& s : sequences)
    out << ' ' << s << " |";
  out << " mean |\n|---|";
  for (std::size_t i = 0; i <= sequences.size(); ++i)
    out << "---|";
  out << '\n';
  for (const std::string& name : distinct(all, row)) {
    out << "| " << name << " |";
    double error = 0, unsafe = 0;
    int count = 0;
    for (const std::string& s : sequences) {
      const auto f = std::find_if(all.begin(), all.end(),
                                  [&](const Figures& g) { return g.sequence == s && g.*row == name; });
      if (f == all.end()) {
        out << " - |";
        continue;
      }
      out << ' ' << number(f->ground.error(), 2) << " / " << number(f->ground.unsafe_share()) << " |";
      error += f->ground.error();
      unsafe += f->ground.unsafe_share();
      ++count;
    }
    out << ' ' << (count ? number(error / count, 2) + " / " + number(unsafe / count) : "-") << " |\n";
  }
}

namespace {

constexpr std::size_t small_set = 10; // sets of fewer frames are taken together

/// Figures of sets of stills taken together, frame by frame.
struct Together {
  std::size_t sets = 0, frames = 0;
  double error = 0, terrain = 0, other = 0, ramp = 0; ///< sums over frames
  Counts ground, driven;
  Things things;
  void add(const Figures& f) {
    const auto count = static_cast<double>(f.frames.size());
    ++sets;
    frames += f.frames.size();
    error += count * f.mean_error();
    terrain += count * f.mean_terrain_error();
    other += count * f.mean_other_missed();
    ramp += count * f.best_ramp.value_or(0);
    ground += f.ground;
    driven += f.terrain;
    things += f.things;
  }
};

/// Means over sets; a set without obstacles near or without things has no say in theirs.
struct MeanOfSets {
  int sets = 0, with_obstacles = 0, with_things = 0;
  double error = 0, terrain = 0, other = 0, pooled = 0, pooled_terrain = 0, unsafe = 0, things = 0, ramp = 0;
  void add(const Figures& f) {
    ++sets;
    error += f.mean_error();
    terrain += f.mean_terrain_error();
    other += f.mean_other_missed();
    pooled += f.ground.error();
    pooled_terrain += f.terrain.error();
    ramp += f.best_ramp.value_or(0);
    if (f.ground.near_obstacles > 0) {
      ++with_obstacles;
      unsafe += f.ground.unsafe_share();
    }
    if (f.things.count > 0) {
      ++with_things;
      things += f.things.missed_share();
    }
  }
};

void write_stills_row(std::ostream& out, const std::string& name, std::size_t frames,
                      const std::vector<std::string>& cells) {
  out << "| " << name << " | " << (frames > 0 ? std::to_string(frames) : "") << " |";
  for (const std::string& cell : cells)
    out << ' ' << cell << " |";
  out << '\n';
}

/// How well the confidence finds frames that are wrong by more than 30 percent.
void write_found(std::ostream& out, const std::vector<Figures>& all, const std::string& engine) {
  constexpr double wrong = 30;
  std::vector<const Figures*> runs;
  std::size_t frames = 0, bad = 0;
  for (const Figures& f : all)
    if (f.engine == engine) {
      runs.push_back(&f);
      frames += f.frames.size();
      bad += static_cast<std::size_t>(std::count_if(f.frames.begin(), f.frames.end(),
                                                    [](const FrameFigures& k) { return k.error > wrong; }));
    }
  if (const auto found = found_by_confidence(runs, wrong))
    out << "\n"
        << bad << " of " << counted(frames, "frame") << " are wrong by more than " << number(wrong, 0)
        << " %; area under the curve of the "
        << "confidence, each set counts the same: " << number(*found, 2) << '\n';
}

} // namespace

void write_stills(std::ostream& out, const std::vector<Figures>& all) {
  for (const std::string& engine : distinct(all, &Figures::engine)) {
    MeanOfSets mean;
    Together small;
    for (const Figures& f : all) {
      if (f.engine != engine || !f.stills)
        continue;
      if (mean.sets == 0)
        out << "\n**" << engine
            << "**\n\n| stills, % | frames | error | terrain error | other ground missed | best ramp | "
               "unsafe | "
               "things missed | error, pooled | terrain, pooled "
               "|\n|---|---|---|---|---|---|---|---|---|---|\n";
      write_stills_row(out, f.sequence, f.frames.size(),
                       {number(f.mean_error(), 2), number(f.mean_terrain_error(), 2),
                        number(f.mean_other_missed(), 2), number(f.best_ramp, 2), unsafe_text(f.ground),
                        things_text(f.things), number(f.ground.error(), 2), number(f.terrain.error(), 2)});
      mean.add(f);
      if (f.frames.size() < small_set)
        small.add(f);
    }
    if (mean.sets > 1)
      write_stills_row(out, "mean of " + std::to_string(mean.sets) + " sets", 0,
                       {number(mean.error / mean.sets, 2), number(mean.terrain / mean.sets, 2),
                        number(mean.other / mean.sets, 2), number(mean.ramp / mean.sets, 2),
                        mean.with_obstacles > 0 ? number(mean.unsafe / mean.with_obstacles) : "-",
                        mean.with_things > 0 ? number(mean.things / mean.with_things) : "-",
                        number(mean.pooled / mean.sets, 2), number(mean.pooled_terrain / mean.sets, 2)});
    if (const auto count = static_cast<double>(small.frames); small.sets > 1)
      write_stills_row(
          out, std::to_string(small.sets) + " sets of fewer than 10 frames together", small.frames,
          {number(small.error / count, 2), number(small.terrain / count, 2), number(small.other / count, 2),
           number(small.ramp / count, 2), unsafe_text(small.ground), things_text(small.things),
           number(small.ground.error(), 2), number(small.driven.error(), 2)});
  }
}

void write_sureness(std::ostream& out, const std::vector<Figures>& all) {
  constexpr std::size_t steps = Sureness::steps;
  const auto share = [](long long part, long long whole) {
    return 100 * static_cast<double>(part) / static_cast<double>(whole);
  };
  const auto range = [](std::string low, const std::string& high) {
    return low == high ? low : low.append("-").append(high);
  };
  const auto expected = [](int value) { return number(50 + 50 * value / 255.0, 0); };
  for (const std::string& engine : distinct(all, &Figures::engine)) {
    std::vector<std::string> head{engine}, promised{"labels expected to be right, %"};
    for (std::size_t i = 0; i < steps; ++i) {
      const int low = Sureness::from[i], high = Sureness::from[i + 1] - 1;
      head.push_back(range(std::to_string(low), std::to_string(high)));
      promised.push_back(range(expected(low), expected(high)));
    }
    std::array<double, steps> right{}, cells{};
    std::array<int, steps> with{};
    std::vector<std::vector<std::string>> rows;
    for (const Figures& f : all) {
      const Sureness& s = f.sureness;
      if (f.engine != engine || s.all() == 0)
        continue;
      rows.push_back({f.sequence + ", right, % (of its cells, %)"});
      for (std::size_t i = 0; i < steps; ++i) {
        const double part = share(s.cells[i], s.all());
        cells[i] += part;
        if (s.cells[i] > 0) {
          right[i] += share(s.right[i], s.cells[i]);
          ++with[i];
        }
        std::string cell = "-";
        if (s.cells[i] > 0)
          cell = number(share(s.right[i], s.cells[i]), 0).append(" (").append(number(part, 0)).append(")");
        rows.back().push_back(std::move(cell));
      }
    }
    if (rows.empty())
      continue;
    std::vector<std::string> truth{"labels that are right, %"}, all_cells{"of all cells, %"};
    for (std::size_t i = 0; i < steps; ++i) {
      truth.push_back(with[i] > 0 ? number(right[i] / with[i], 0) : "-");
      all_cells.push_back(number(cells[i] / static_cast<double>(rows.size()), 0));
    }
    Table table(head);
    table.add(promised);
    table.add(truth);
    table.add(all_cells);
    for (const auto& row : rows)
      table.add(row);
    out << '\n' << table.text();
    write_found(out, all, engine);
  }
}

void write_things_matrix(std::ostream& out, const std::vector<Figures>& all) {
  if (std::none_of(all.begin(), all.end(), [](const Figures& f) { return f.things.count > 0; }))
    return;
  const auto sequences = distinct(all, &Figures::sequence);
  std::vector<std::string> head{"things missed, %"};
  head.insert(head.end(), sequences.begin(), sequences.end());
  Table table(head);
  for (const std::string& engine : distinct(all, &Figures::engine)) {
    std::vector<std::string> row{engine};
    for (const std::string& sequence : sequences) {
      const auto f = std::find_if(all.begin(), all.end(), [&](const Figures& g) {
        return g.sequence == sequence && g.engine == engine;
      });
      row.push_back(f == all.end() ? "-" : things_text(f->things));
    }
    table.add(row);
  }
  out << '\n' << table.text();
}

void write_stills_matrix(std::ostream& out, const std::vector<Figures>& all) {
  const auto engines = distinct(all, &Figures::engine), sets = distinct(all, &Figures::sequence);
  double ramps = 0;
  out << "\n| error / terrain error, % |";
  for (const std::string& engine : engines)
    out << ' ' << engine << " |";
  out << " best ramp |\n|---|";
  for (std::size_t i = 0; i <= engines.size(); ++i)
    out << "---|";
  out << '\n';
  for (const std::string& set : sets) {
    out << "| " << set << " |";
    std::optional<double> ramp;
    for (const std::string& engine : engines) {
      const auto f = std::find_if(all.begin(), all.end(),
                                  [&](const Figures& g) { return g.sequence == set && g.engine == engine; });
      if (f == all.end()) {
        out << " - |";
        continue;
      }
      out << ' ' << number(f->mean_error(), 2) << " / " << number(f->mean_terrain_error(), 2) << " |";
      ramp = f->best_ramp;
    }
    out << ' ' << number(ramp, 2) << " |\n";
  }
  out << "| mean of " << sets.size() << " sets |";
  for (const std::string& engine : engines) {
    MeanOfSets mean;
    for (const Figures& f : all)
      if (f.engine == engine)
        mean.add(f);
    out << ' ' << number(mean.error / mean.sets, 2) << " / " << number(mean.terrain / mean.sets, 2) << " |";
    ramps = mean.ramp / mean.sets;
  }
  out << ' ' << number(ramps, 2) << " |\n";
}

} // namespace terrainseg::eval
