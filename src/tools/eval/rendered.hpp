// SPDX-License-Identifier: LGPL-2.1-or-later
// Sequences without a data folder: rendered places with their truth.
#pragma once

#include <string>

#include "tools/eval/sequence.hpp"

namespace terrainseg::eval {

/// Whether `text` names a rendered sequence: scene:KIND:LIGHT[:SEED].
bool is_rendered(const std::string& text);

/// Ten frames, 0.3 s apart, of each of twelve places (SEED and the eleven seeds after it; default 101), which
/// are driven through straight, winding and bumpily in turn. 480 x 270; the labels are those of
/// scene::Label. `limit` > 0 takes the first frames only. Throws std::runtime_error that says what there is.
Sequence rendered_sequence(const std::string& text, int limit);

} // namespace terrainseg::eval
