// SPDX-License-Identifier: LGPL-2.1-or-later
// `terrainseg-eval SEQUENCE...`: measures, then writes tables, files and pictures.
#pragma once

#include "lab/eval/options.hpp"

namespace terrainseg::eval {

/// Throws std::runtime_error that names what could not be read, measured or written.
void evaluate(const EvalOptions& options);

} // namespace terrainseg::eval
