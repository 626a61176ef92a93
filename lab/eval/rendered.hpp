// SPDX-License-Identifier: LGPL-2.1-or-later
// Sequences without a data folder: rendered places with their truth.
#pragma once

#include <string>
#include <vector>

#include "lab/eval/sequence.hpp"

namespace terrainseg::eval {

/// Whether `text` names a rendered sequence.
bool is_rendered(const std::string& text);

/// Two kinds, told by the text:
///  - scene:KIND:LIGHT[:SEED]: ten frames, 0.3 s apart, of each of twelve places (SEED and the eleven seeds
///  after
///    it; default 101), which are driven through straight, winding and bumpily in turn; 480 x 270.
///  - scene:KIND:LIGHT:MOTION[@WIDTHxHEIGHT][#FIRST[-LAST]]: drives of 90 frames at 30 Hz, one per seed from
///  FIRST
///    to LAST (default 101-106), each without memory of the one before; frames from 60 on are scored, and
///    things counted in every tenth of them. 640 x 360 unless a size is given.
/// The labels are those of scene::Label. Throws std::runtime_error that says what there is.
Sequence rendered_sequence(const std::string& text);

/// What the paper's experiments look at where there is no data: 60 frames, 0.2 s apart, of each of five
/// places; 640 x 360.
std::vector<Sequence> rendered_for_paper(const Selection& selection = {});

/// Twelve frames of a rendered trail.
Sequence rendered_trail(const cv::Size& size);

} // namespace terrainseg::eval
