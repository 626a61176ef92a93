// SPDX-License-Identifier: LGPL-2.1-or-later
// Numbers about numbers.
#pragma once

#include <optional>
#include <string>
#include <vector>

namespace terrainseg::eval {

/// How some values lie.
struct Spread {
  double least = 0, median = 0, p90 = 0, p99 = 0, largest = 0;
  double deviation = 0; ///< standard deviation
};

/// Nothing when there are no values. Percentiles are interpolated between neighbours.
std::optional<Spread> spread_of(std::vector<double> values);

/// Spearman's rank correlation; nothing when a side is constant or has fewer than three values.
std::optional<double> rank_correlation(const std::vector<double>& a, const std::vector<double>& b);

/// Milliseconds that this thread had a processor: other people's work does not count.
double processor_milliseconds();

/// A number with so many digits behind the point; "-" for nothing.
std::string number(double value, int digits = 1);
std::string number(const std::optional<double>& value, int digits = 1);

} // namespace terrainseg::eval
