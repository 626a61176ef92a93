// SPDX-License-Identifier: LGPL-2.1-or-later
// Motion of the ground since an earlier frame: robust inverse compositional alignment of points on the ground
// (S. Baker, I. Matthews, "Lucas-Kanade 20 years on", IJCV 56, 2004). The derivatives are those of the
// current frame, so one set of points serves every earlier frame.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "kernels/point_fit.hpp"
#include "motion/plane_motion.hpp"

namespace terrainseg {

/// A high-pass filtered picture, 1..255.
using PassedView = kernels::Picture;

/// A tracked point of the ground.
struct GroundPoint {
  std::int32_t across = 0, below = 0; ///< position in the units of PointMap::at()
  std::int32_t value = 0;             ///< grey level, Q8
  /// Derivatives by a b c e d h and by the last element of G, in 1 / f, Q11 of a grey level.
  std::array<std::int32_t, most_unknowns> derivative{};
};

/// Tracked points as a structure of arrays, so that loops over them can be vectorised.
class GroundPoints {
 public:
  GroundCamera view;                ///< of the picture that they are in
  void reserve(std::size_t points); ///< clears the points when the capacity has to grow
  std::size_t room() const { return room_; }
  void clear() { size_ = 0; }
  std::size_t size() const { return size_; }
  void add(const GroundPoint& point);
  GroundPoint operator[](std::size_t i) const;

  const std::int32_t* below() const { return list(1); }
  kernels::PointLists all() const { return {list(0), list(1), list(2), static_cast<int>(size_)}; }
  /// Every fourth point, starting with the first.
  kernels::PointLists few() const {
    const std::int32_t* lists = few_.data();
    return {lists, lists + few_room(), lists + 2 * few_room(), static_cast<int>((size_ + every - 1) / every)};
  }
  /// Derivatives by the first unknown. Those by each further unknown follow at a distance of room().
  const std::int32_t* derivatives() const { return list(3); }

 private:
  const std::int32_t* list(std::size_t k) const { return numbers_.data() + k * room_; }
  static constexpr std::size_t every = 4;
  std::size_t few_room() const { return room_ / every; }

  std::size_t size_ = 0, room_ = 0;
  std::vector<std::int32_t> numbers_, few_;
};

/// Selects the points to track.
struct PointRule {
  int block = 12;      ///< 1..16: at most one point per block x block pixels, the one with the largest slope
  int least_slope = 6; ///< |horizontal| + |vertical| difference over two pixels must exceed it
};

inline constexpr int fewest_points = 24;

class PointSelection {
 public:
  /// Fills `points`. Searches the rows from one tenth of the way below the vanishing line down, where
  /// `ground` is not 0 (one byte per `cell` x `cell` pixels; `cell` is 1 or 4 and divides the picture's
  /// size). Of equal slopes, takes the upper left point.
  void select(const PassedView& picture, const GroundCamera& view, std::span<const std::uint8_t> ground,
              int cell, const PointRule& rule, GroundPoints& points);

 private:
  bool spread(std::span<const std::uint8_t> ground, int row, int cell, int columns);
  std::vector<std::uint16_t> keys_, order_;
  std::vector<std::uint8_t> ground_;
};

/// How well a motion explains an earlier frame. With hardly any point inside it, as badly as possible.
struct Residual {
  int mean = 40 << 8; ///< mean of min(|difference|, 40), Q8 of a grey level
  int contrast = 0;   ///< mean of min(|grey level - 128|, 40), Q8; unrelated pictures differ by more
  int points = 0;     ///< number of points inside the earlier frame
};

class Alignment {
 public:
  /// Reserves memory for `points` points, so that later calls do not allocate.
  void reserve(std::size_t points);

  /// Refines `motion`, the motion of `points` since `earlier`, with at most `iterations` iterations. Returns
  /// false and leaves `motion` unchanged when fewer than 24 points lie inside the earlier frame or the
  /// iteration diverges.
  bool refine(const GroundPoints& points, const PassedView& earlier, int iterations, PlaneMotion& motion);

  struct LineFit {
    std::int64_t sigma = 0;  ///< Q24: the last element minus 1; the vanishing line is off by -f sigma / t.z
    std::int64_t weight = 0; ///< information on sigma divided by the variance of the differences; 0 = no
                             ///< result
  };
  /// The same with a seventh unknown: the error of the vanishing line.
  LineFit fit_line(const GroundPoints& points, const PassedView& earlier, int iterations,
                   const PlaneMotion& motion);

  Residual residual(const GroundPoints& points, const PassedView& earlier, const PlaneMotion& motion);

 private:
  /// Computes differences in Q8 of a grey level. Returns the number of points inside the earlier frame.
  int measure(const kernels::PointLists& points, const PassedView& earlier, const GroundCamera& view,
              const PlaneMotion& motion);
  /// Robust spread of the first `count` differences, Q8, of which `inside` are of points inside.
  std::int32_t spread(int count, int inside) const;
  enum class Step : std::uint8_t { failed, small, large };
  template <int unknowns>
  Step step(const GroundPoints& points, const PassedView& earlier, PlaneMotion& motion,
            std::int64_t& information);

  std::vector<std::int32_t> differences_, weights_; ///< padded to whole vectors
};

} // namespace terrainseg
