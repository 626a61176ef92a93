// SPDX-License-Identifier: LGPL-2.1-or-later
// An engine's way through a sequence.
#pragma once

#include <string>
#include <vector>

#include "lab/eval/figures.hpp"
#include "lab/eval/sequence.hpp"

namespace terrainseg::eval {

/// All frames of a sequence, decoded on all processors.
std::vector<Sample> read_all(const Sequence& sequence);

/// Labels of the samples, sharing their memory.
std::vector<cv::Mat1b> labels_of(const std::vector<Sample>& samples);

/// Shows an engine the samples of `sequence`, run by run, and scores its masks. Runs are spread over the
/// processors; the figures do not depend on how many there are, except milliseconds. `masks`, where given,
/// takes the mask of every scored frame at its index. Throws std::runtime_error that names what is wrong.
Figures measure(const Sequence& sequence, const std::vector<Sample>& samples, const std::string& engine,
                const std::string& input, std::vector<cv::Mat1b>* masks = nullptr);

} // namespace terrainseg::eval
