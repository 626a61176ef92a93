// SPDX-License-Identifier: LGPL-2.1-or-later
// Figures as JSON, CSV and Markdown.
#pragma once

#include <ostream>
#include <string>
#include <vector>

#include "lab/eval/figures.hpp"
#include "lab/eval/leave_out.hpp"

namespace terrainseg::eval {

/// `kinds` give the kind of place of each sequence.
void write_json(std::ostream& out, const std::vector<Figures>& all, const std::vector<KindRule>& kinds);

/// One line per run, with a head; what was not measured is empty. Shares are in percent.
void write_csv(std::ostream& out, const std::vector<Figures>& all);

/// Reads what write_json() wrote: sequence, engine, input and each frame's error and unsafe share. Throws
/// std::runtime_error that names the file.
std::vector<Figures> read_json(const std::string& path);

/// One table per sequence and input: a row per engine.
void write_markdown(std::ostream& out, const std::vector<Figures>& all);

/// A matrix of "error / unsafe": engines (or inputs) down, sequences across.
void write_matrix(std::ostream& out, const std::vector<Figures>& all, bool by_input);

/// How right labels are by what the confidence map says of them: the mean of the sequences, and each; one
/// table per engine that has such a map. A step that a sequence has no cells in is left out of its mean.
void write_sureness(std::ostream& out, const std::vector<Figures>& all);

/// A matrix of the things missed: engines down, sequences across. Nothing when there are no things.
void write_things_matrix(std::ostream& out, const std::vector<Figures>& all);

/// Stills: one table per engine, a row per set. Errors are means over frames; the rows at the end are the
/// mean of the sets, and the frames of all sets of fewer than ten taken together. Nothing when there are no
/// stills.
void write_stills(std::ostream& out, const std::vector<Figures>& all);

/// Stills: a matrix of "error / terrain error", means over frames: sets down, engines across.
void write_stills_matrix(std::ostream& out, const std::vector<Figures>& all);

} // namespace terrainseg::eval
