// SPDX-License-Identifier: LGPL-2.1-or-later
// How good a choice is where it was not made: kinds of place are left out one by one.
#pragma once

#include <ostream>
#include <regex>
#include <string>
#include <vector>

#include "lab/eval/figures.hpp"

namespace terrainseg::eval {

/// Sequences whose name `pattern` is found in are of that kind of place.
struct KindRule {
  std::string kind;
  std::regex pattern;
};

/// "KIND=REGEX", case does not matter. Throws std::runtime_error that says what is wrong.
KindRule parse_kind_rule(const std::string& text);

/// The rules for the names that this project's data have.
const std::vector<KindRule>& usual_kinds();

/// What sequence.json states, else the first of `rules` that fits the name, else the name: a kind of its own.
std::string kind_of(const Figures& figures, const std::vector<KindRule>& rules);

/// A kind of place, and the engine that is the best on all others.
struct LeftOut {
  std::string kind, chosen;
  int sets = 0;
  double error = 0, unsafe = 0;                   ///< percent, of the chosen engine on this kind
  double baseline_error = 0, baseline_unsafe = 0; ///< of the first engine
};

/// `all` are runs of the same sequences with several engines, the first of which is the baseline. Of the
/// engines that ran on everything the one with the least mean over kinds of error + unsafe_weight * unsafe is
/// the best; the first of equals. Throws std::runtime_error where there are fewer than two kinds or engines.
std::vector<LeftOut> leave_out(const std::vector<Figures>& all, const std::vector<KindRule>& rules,
                               double unsafe_weight);

/// A row per kind and the mean of the kinds; then the means of each engine, in the order of `all`.
void write_leave_out(std::ostream& out, const std::vector<Figures>& all, const std::vector<KindRule>& rules,
                     double unsafe_weight);

} // namespace terrainseg::eval
