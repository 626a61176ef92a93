// SPDX-License-Identifier: LGPL-2.1-or-later
// Masks that a pipeline, or another program, has written.
#pragma once

#include <memory>
#include <string>

#include "lab/eval/engines.hpp"

namespace terrainseg::eval {

/// Masks of `sequence` in `folder` (or, where there is one, in its subfolder named as the sequence): PNG
/// named as the labels, at least 192 = traversable. A file `estimates.ndjson` beside them, as terrainextract
/// writes it, gives horizon and confidence: line n of frame n. Throws std::runtime_error that names the file.
std::unique_ptr<Engine> written_masks(const std::string& folder, const Sequence& sequence);

} // namespace terrainseg::eval
