// SPDX-License-Identifier: LGPL-2.1-or-later
// Where the ground was in an earlier frame: robust alignment of points of the ground, inverse compositional
// (the derivatives are those of this frame, so that one set of points serves every earlier frame).
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "kernels/point_fit.hpp"
#include "motion/normal_equations.hpp"
#include "motion/plane_motion.hpp"

namespace terrainseg {

/// A high-passed picture: width x height bytes without gaps, 1..255.
struct PassedView {
  const std::uint8_t* pixels = nullptr;
  int width = 0, height = 0;
  const std::uint8_t* row(int y) const { return pixels + static_cast<std::ptrdiff_t>(y) * width; }
};

/// A point of the ground that is followed.
struct GroundPoint {
  std::int32_t across = 0, below = 0; ///< position, as PixelMap::at() takes it
  std::int32_t value = 0;             ///< grey level, Q8
  /// Derivatives by a b c e d h and by G's last element, in 1 / f, Q11 of a grey level.
  std::array<std::int32_t, most_unknowns> derivative{};
};

/// Points, each number of theirs in a list of its own: what is done with them is done with many at once.
class GroundPoints {
 public:
  void reserve(std::size_t points); ///< forgets the points where there is no room for so many
  std::size_t room() const { return room_; }
  void clear() { size_ = 0; }
  std::size_t size() const { return size_; }
  void add(const GroundPoint& point);
  GroundPoint operator[](std::size_t i) const;

  const std::int32_t* below() const { return list(1); }
  kernels::PointLists all() const { return {list(0), list(1), list(2), static_cast<int>(size_)}; }
  /// Every fourth point, the first among them.
  kernels::PointLists few() const {
    const std::int32_t* lists = few_.data();
    return {lists, lists + few_room(), lists + 2 * few_room(), static_cast<int>((size_ + every - 1) / every)};
  }
  /// By the first unknown; each next one lies room() further.
  const std::int32_t* derivatives() const { return list(3); }

 private:
  const std::int32_t* list(std::size_t k) const { return numbers_.data() + k * room_; }
  static constexpr std::size_t every = 4;
  std::size_t few_room() const { return room_ / every; }

  std::size_t size_ = 0, room_ = 0;
  std::vector<std::int32_t> numbers_, few_;
};

/// Which points are followed.
struct PointRule {
  int block = 12;      ///< 1..16: one point at most in block x block pixels, that of the greatest slope
  int least_slope = 6; ///< |horizontal| + |vertical| difference over two pixels must exceed it
};

inline constexpr int fewest_points = 24;

class PointSelection {
 public:
  /// Fills `points` from the rows from a tenth below the vanishing line on where `ground` (a byte for each
  /// `cell` x `cell` pixels, which divide the picture) is not 0. Of equal slopes the upper left one.
  void select(const PassedView& picture, const GroundCamera& view, std::span<const std::uint8_t> ground,
              int cell, const PointRule& rule, GroundPoints& points);

 private:
  bool spread(std::span<const std::uint8_t> ground, int row, int cell, int columns);
  std::vector<std::uint16_t> keys_, order_;
  std::vector<std::uint8_t> ground_;
};

/// How well a motion explains an earlier frame.
struct Residual {
  int mean = 0;     ///< mean of min(|difference|, 40), Q8 of a grey level
  int contrast = 0; ///< mean of min(|grey level - 128|, 40), Q8: what unrelated pictures differ by is more
  int points = 0;   ///< that lie inside the earlier frame
};

class Alignment {
 public:
  /// Room for that many points, so that later calls need none.
  void reserve(std::size_t points);

  /// Takes `motion` nearer to how `points` moved since `earlier`, at most `iterations` times. False, and
  /// `motion` as it was, where fewer than 24 points have an answer or the motion grows without bound.
  bool refine(const GroundPoints& points, const PassedView& earlier, const GroundCamera& view, int iterations,
              PlaneMotion& motion);

  struct LineFit {
    std::int64_t sigma = 0;  ///< Q24: the last element less 1; the vanishing line is wrong by -f sigma / t.z
    std::int64_t weight = 0; ///< information on sigma over the variance of the differences; 0 = no answer
  };
  /// The same with the seventh unknown, which says how wrong the vanishing line is.
  LineFit fit_line(const GroundPoints& points, const PassedView& earlier, const GroundCamera& view,
                   int iterations, const PlaneMotion& motion);

  Residual residual(const GroundPoints& points, const PassedView& earlier, const GroundCamera& view,
                    const PlaneMotion& motion);

 private:
  /// Differences in Q8 of a grey level; returns the number of points inside.
  int measure(const GroundPoints& points, const PassedView& earlier, const PixelMap& map);
  /// Of the first `count` differences, robust: Q8. Uses the memory of the weights.
  std::int32_t spread(std::size_t count);
  enum class Step : std::uint8_t { failed, small, large };
  template <int unknowns>
  Step step(const GroundPoints& points, const PassedView& earlier, const GroundCamera& view,
            PlaneMotion& motion, std::int64_t& information);

  std::vector<std::int32_t> differences_, weights_; ///< of which there is room for whole vectors
};

} // namespace terrainseg
