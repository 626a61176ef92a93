// SPDX-License-Identifier: LGPL-2.1-or-later
// How well a straight boundary does that never looks at the picture.
#pragma once

#include <vector>

#include <opencv2/core.hpp>

namespace terrainseg::eval {

/// Mean over the frames of the percent of labelled pixels that "ground below the row a + b |x - centre|" gets
/// wrong, for the best a and b of a fixed grid: an upper bound, fitted to the labels it is scored on. Row and
/// offset are shares of the height and of half the width; frames may differ in size. Looks at every fourth
/// row and column.
double best_ramp_error(const std::vector<cv::Mat1b>& labels);

} // namespace terrainseg::eval
