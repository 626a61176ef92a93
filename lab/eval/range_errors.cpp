// SPDX-License-Identifier: LGPL-2.1-or-later
#include "lab/eval/range_errors.hpp"

#include <algorithm>
#include <cmath>

#include "lab/eval/statistics.hpp"

namespace terrainseg::eval {
namespace {

/// The value that `share` of them do not exceed: no mean of two, so that an infinite one stays one.
double rank(std::vector<double>& values, double share) {
  const auto place = values.begin() + std::lround(share * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), place, values.end());
  return *place;
}

} // namespace

void RangeErrors::add(double truth, double measured) {
  const auto end = std::find_if(ends.begin(), ends.end(), [truth](double e) { return truth < e; });
  if (!(truth > 0) || end == ends.end() || std::isnan(measured))
    return;
  Span& span = spans_[static_cast<std::size_t>(end - ends.begin())];
  span.errors.push_back(100 * std::abs(measured - truth) / truth);
  span.too_long += measured > too_long * truth;
}

void RangeErrors::add(const RangeErrors& others) {
  for (std::size_t i = 0; i < spans; ++i) {
    const Span& other = others.spans_[i];
    spans_[i].errors.insert(spans_[i].errors.end(), other.errors.begin(), other.errors.end());
    spans_[i].too_long += other.too_long;
  }
}

std::optional<RangeFigures> RangeErrors::figures(std::size_t span) const {
  std::vector<double> errors = spans_[span].errors;
  if (errors.empty())
    return std::nullopt;
  const double share = 100 * static_cast<double>(spans_[span].too_long) / static_cast<double>(errors.size());
  return RangeFigures{errors.size(), rank(errors, 0.5), rank(errors, 0.9), share};
}

std::string RangeErrors::name(std::size_t span) {
  const std::string end = number(ends[span], 0) + " m";
  return span == 0 ? "under " + end : number(ends[span - 1], 0) + " - " + end;
}

} // namespace terrainseg::eval
