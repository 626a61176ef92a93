// SPDX-License-Identifier: LGPL-2.1-or-later
// The words of a command line.
#pragma once

#include <string>
#include <vector>

#include "lab/eval/leave_out.hpp"
#include "lab/eval/sequence.hpp"
#include "tools/command_line.hpp"

namespace terrainseg::eval {

using tools::UsageError;

/// What `terrainseg-eval [OPTIONS] SEQUENCE...` is asked for.
struct EvalOptions {
  std::vector<std::string> sequences, engines, inputs; ///< engines: each once; inputs: perturbations
  std::string json, csv, markdown, pictures;           ///< where to; empty = nowhere
  Selection selection;
  bool confidence = false; ///< how right labels are by the confidence map
  bool leave_out = false;  ///< kinds of place, one by one
  std::vector<KindRule> kinds;
  double unsafe_weight = 0; ///< of a choice, beside the error
};

/// What `terrainseg-eval paper` and `terrainseg-eval figures` are asked for.
struct PaperOptions {
  std::string data, out = "paper"; ///< data empty = rendered scenes
  std::vector<std::string> only;
  Selection selection;
};

/// What `terrainseg-eval metres` is asked for.
struct MetresOptions {
  int places = 3;  ///< of each kind, 1..100
  std::string csv; ///< where to; empty = nowhere
};

/// `words` are those behind the program's name, or behind the subcommand. --help is printed, and ends the
/// program. Throws UsageError.
EvalOptions parse_eval_options(const std::vector<std::string>& words);
MetresOptions parse_metres_options(const std::vector<std::string>& words);
PaperOptions parse_paper_options(const std::vector<std::string>& words, bool with_parts);

/// What --help prints.
std::string eval_help();

/// The names of engines with the default preset at several values of caution start with this.
inline const std::string caution_mark = "default,caution=";

} // namespace terrainseg::eval
