// SPDX-License-Identifier: LGPL-2.1-or-later
// The paper's experiments, for `terrainseg-eval paper` and `terrainseg-eval figures`. What they say is
// discussed in docs/paper.md.
#pragma once

#include <string>
#include <vector>

namespace terrainseg::eval {

/// Tables 1 and 2, figures 11 to 14, and how much each reading of the text matters. Arguments are those
/// behind the subcommand. Throws UsageError, or std::runtime_error that names what is wrong.
void run_paper(const std::vector<std::string>& arguments);
/// Pictures after figures 4 to 9.
void run_figures(const std::vector<std::string>& arguments);

} // namespace terrainseg::eval
