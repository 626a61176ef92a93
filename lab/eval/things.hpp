// SPDX-License-Identifier: LGPL-2.1-or-later
// Obstacles that stand in the open, counted one by one.
#pragma once

#include <opencv2/core.hpp>

namespace terrainseg::eval {

struct Things {
  int count = 0;  ///< connected pieces of label 0 with ground around and above them
  int missed = 0; ///< those of which half or more is called traversable
  Things& operator+=(const Things& other);
  double missed_share() const; ///< percent; 0 when there are none
};

/// The things of one frame. A thing is an 8-connected piece of label_obstacle of at least 40 pixels at 640
/// columns (in proportion to the area at other widths) that touches no edge of the frame, with 80 % or more
/// of ground (labels 1 and 2) both in the ring around it and in the part of the ring above its top row. The
/// ring is as wide as half the thing's height, at least 3 pixels and a 40th of the frame's width.
/// `traversable` is not 0 where the mask says so; both are of one size.
Things count_things(const cv::Mat1b& labels, const cv::Mat1b& traversable);

} // namespace terrainseg::eval
