// SPDX-License-Identifier: LGPL-2.1-or-later
// Whether one run is better than another: a paired test over frames.
#pragma once

#include <cstdint>
#include <ostream>
#include <vector>

#include "lab/eval/figures.hpp"

namespace terrainseg::eval {

struct Comparison {
  double mean_difference = 0; ///< of the second minus the first, percent points
  double low = 0, high = 0;   ///< 95 % interval of the mean difference (bootstrap over blocks of frames)
  double p = 1;               ///< two-sided sign-flip test over the same blocks
  int pairs = 0, better = 0, worse = 0;
  int blocks = 0;
  /// Fewer blocks cannot make p less than 0.05, whatever they hold.
  bool too_few() const { return blocks < 6; }
};

/// Neighbouring frames are no independent witnesses: differences are pooled over blocks of `block` frames
/// before they are shuffled; stills are independent: blocks of one. Deterministic. Needs as many values in
/// `a` as in `b`.
Comparison compare(const std::vector<double>& a, const std::vector<double>& b, int block = 5);

/// Pairs runs of the same sequence and input and prints a table. Throws std::runtime_error when nothing can
/// be paired.
void write_comparison(std::ostream& out, const std::vector<Figures>& first,
                      const std::vector<Figures>& second);

} // namespace terrainseg::eval
