// SPDX-License-Identifier: LGPL-2.1-or-later
// How far ranges of the boundary are off, by distance.
#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <string>
#include <vector>

namespace terrainseg::eval {

/// Columns whose true range lies in one span of distances.
struct RangeFigures {
  std::size_t columns = 0;
  double median = 0, p90 = 0; ///< |measured - true| / true, percent; infinite where free was told
  double too_long = 0;        ///< percent of the columns that read more than 20 % too long, or free
};

/// Gathers pairs of a true and a measured range.
class RangeErrors {
 public:
  /// Metres at which a span of distances ends; each begins where the one before ends.
  static constexpr std::array<double, 5> ends{2, 3, 5, 10, 20};
  static constexpr std::size_t spans = ends.size();
  /// A range this many times the true one is too long: a vehicle that stops by it stops too late.
  static constexpr double too_long = 1.2;

  /// Metres; `measured` may be infinite (free). What lies beyond the last span or was not measured (NaN) is
  /// left out.
  void add(double truth, double measured);
  void add(const RangeErrors& others);
  /// Nothing where no column was that far away.
  std::optional<RangeFigures> figures(std::size_t span) const;
  /// `2 - 3 m`.
  static std::string name(std::size_t span);

 private:
  struct Span {
    std::vector<double> errors; ///< percent
    std::size_t too_long = 0;
  };
  std::array<Span, spans> spans_;
};

} // namespace terrainseg::eval
