// SPDX-License-Identifier: LGPL-2.1-or-later
#include "lab/eval/leave_out.hpp"

#include <algorithm>
#include <map>
#include <stdexcept>

#include "lab/eval/statistics.hpp"
#include "lab/eval/table.hpp"

namespace terrainseg::eval {
namespace {

constexpr int digits = 2;

struct Mean {
  double error = 0, unsafe = 0;
  int count = 0;

  void add(double of_error, double of_unsafe) {
    error += of_error;
    unsafe += of_unsafe;
    ++count;
  }
  Mean mean() const { return {error / std::max(count, 1), unsafe / std::max(count, 1), count}; }
};

/// Means over the sets of a kind, by kind.
using Kinds = std::map<std::string, Mean>;

struct Measured {
  std::string engine;
  Kinds kinds;

  /// Mean over kinds; `left_out` does not count.
  Mean without(const std::string& left_out) const {
    Mean all;
    for (const auto& [kind, of_sets] : kinds)
      if (kind != left_out)
        all.add(of_sets.error, of_sets.unsafe);
    return all.mean();
  }
};

double error_of(const Figures& f) {
  return f.stills ? f.mean_error() : f.ground.error();
}

/// Engines in the order of their first run; those that did not run on all the first one did are left out.
std::vector<Measured> by_engine(const std::vector<Figures>& all, const std::vector<KindRule>& rules) {
  std::vector<Measured> engines;
  std::vector<std::size_t> runs;
  for (const Figures& f : all) {
    auto own =
        std::find_if(engines.begin(), engines.end(), [&](const Measured& m) { return m.engine == f.engine; });
    if (own == engines.end()) {
      own = engines.insert(engines.end(), Measured{f.engine, {}});
      runs.push_back(0);
    }
    own->kinds[kind_of(f, rules)].add(error_of(f), f.ground.unsafe_share());
    ++runs[static_cast<std::size_t>(own - engines.begin())];
  }
  std::vector<Measured> complete;
  for (std::size_t i = 0; i < engines.size(); ++i)
    if (runs[i] == runs[0])
      complete.push_back(std::move(engines[i]));
  for (Measured& m : complete)
    for (auto& [kind, of_sets] : m.kinds)
      of_sets = of_sets.mean();
  return complete;
}

std::vector<std::string> row_of(const std::string& kind, const std::string& chosen, int sets,
                                const Mean& baseline, const Mean& now) {
  return {kind, std::to_string(sets),
          number(baseline.error, digits) + " / " + number(baseline.unsafe, digits),
          number(now.error, digits) + " / " + number(now.unsafe, digits), chosen};
}

} // namespace

KindRule parse_kind_rule(const std::string& text) {
  const std::size_t mark = text.find('=');
  if (mark == 0 || mark == std::string::npos)
    throw std::runtime_error(text + ": a kind of place is KIND=REGEX");
  try {
    return {text.substr(0, mark),
            std::regex(text.substr(mark + 1), std::regex::ECMAScript | std::regex::icase)};
  } catch (const std::regex_error& problem) {
    throw std::runtime_error(text + ": not a regular expression: " + problem.what());
  }
}

const std::vector<KindRule>& usual_kinds() {
  static const std::vector<KindRule> rules = [] {
    std::vector<KindRule> made;
    for (const char* rule :
         {"planets and snow=mars|lunar|moon|zhurong|snow|ice",
          "forest, trails, desert=off-?road|trail|forest|desert|robots",
          "indoors=indoor|corridor|flat|room|floor|lab|warehouse",
          "streets of other countries=india|campus|rain|rail", "drives in town=urban|kitti|town|city|street"})
      made.push_back(parse_kind_rule(rule));
    return made;
  }();
  return rules;
}

std::string kind_of(const Figures& figures, const std::vector<KindRule>& rules) {
  if (!figures.kind.empty())
    return figures.kind;
  const auto rule = std::find_if(rules.begin(), rules.end(), [&](const KindRule& r) {
    return std::regex_search(figures.sequence, r.pattern);
  });
  return rule == rules.end() ? figures.sequence : rule->kind;
}

std::vector<LeftOut> leave_out(const std::vector<Figures>& all, const std::vector<KindRule>& rules,
                               double unsafe_weight) {
  const std::vector<Measured> engines = by_engine(all, rules);
  if (engines.size() < 2 || engines[0].kinds.size() < 2)
    throw std::runtime_error(
        "to leave kinds of place out there must be two of them and two engines to choose from");
  std::vector<LeftOut> result;
  for (const auto& [kind, baseline] : engines[0].kinds) {
    const auto cost = [&, &left_out = kind](const Measured& m) {
      const Mean mean = m.without(left_out);
      return mean.error + unsafe_weight * mean.unsafe;
    };
    const auto best =
        std::min_element(engines.begin(), engines.end(),
                         [&](const Measured& a, const Measured& b) { return cost(a) < cost(b); });
    const Mean& now = best->kinds.at(kind);
    result.push_back({kind, best->engine, now.count, now.error, now.unsafe, baseline.error, baseline.unsafe});
  }
  return result;
}

void write_leave_out(std::ostream& out, const std::vector<Figures>& all, const std::vector<KindRule>& rules,
                     double unsafe_weight) {
  const std::vector<LeftOut> kinds = leave_out(all, rules, unsafe_weight);
  const std::vector<Measured> engines = by_engine(all, rules);
  Table table({"kind of place left out", "sets", "error / unsafe of " + engines[0].engine + ", %",
               "of the choice, %", "chosen on the other kinds"});
  Mean baseline, now;
  int sets = 0;
  for (const LeftOut& k : kinds) {
    table.add(
        row_of(k.kind, k.chosen, k.sets, {k.baseline_error, k.baseline_unsafe, 1}, {k.error, k.unsafe, 1}));
    baseline.add(k.baseline_error, k.baseline_unsafe);
    now.add(k.error, k.unsafe);
    sets += k.sets;
  }
  table.add(row_of("mean of the kinds", "", sets, baseline.mean(), now.mean()));
  Table means({"mean of the kinds, nothing left out", "error / unsafe, %"});
  for (const Measured& m : engines) {
    const Mean mean = m.without({});
    means.add({m.engine, number(mean.error, digits) + " / " + number(mean.unsafe, digits)});
  }
  out << '\n' << table.text() << '\n' << means.text();
}

} // namespace terrainseg::eval
