// SPDX-License-Identifier: LGPL-2.1-or-later
// Inputs made worse on purpose: what other cameras, mounts and links do to a picture.
#pragma once

#include <string>
#include <vector>

#include "lab/eval/sequence.hpp"

namespace terrainseg::eval {

/// Names that perturb() knows, in the order of the reports.
const std::vector<std::string>& perturbation_names();

/// Throws std::runtime_error that lists the names when this is none of them.
void check_perturbation(const std::string& name);

/// Changes every picture, and the labels where geometry changes; the bottom edge stays where it is.
/// Deterministic. h264 needs GStreamer's x264enc behind OpenCV; `stills` have nothing in common, so that none
/// is predicted from the one before. Throws std::runtime_error that names what is wrong.
void perturb(const std::string& name, std::vector<Sample>& samples, bool stills = false);

} // namespace terrainseg::eval
