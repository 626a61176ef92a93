// SPDX-License-Identifier: LGPL-2.1-or-later
// Stage A: the octave pyramid (paper, section 3.1, equations (1) and (2)).
#pragma once

#include <memory>

#include "coarse/grid.hpp"
#include "terrainseg/frame.hpp"

namespace terrainseg {

class Workers;

/// The levels to build. Level k is 2^k times smaller than the frame; sizes are rounded up at every step.
struct PyramidPlan {
  int coarsest = 5;     ///< 0..6: the level of the grid; all three components are built down to it
  int finest_color = 5; ///< finest level at which all three components are kept, <= coarsest
  int finest_luma = 2;  ///< finest level at which the first component is kept, <= finest_color
  /// The levels 1 to `sparse_luma` of the first component, and 1 to `sparse_color` of the others, use every
  /// second row of the level below, without a vertical filter. Of level 0, one of 2^sparse_luma rows is read.
  /// Not above the finest level that is kept. R, G, B together follow sparse_luma.
  int sparse_luma = 0, sparse_color = 0;
  bool operator==(const PyramidPlan&) const = default;
};

/// Three planar components per level, Y U V or R G B. Each reduction is separable 1-4-6-4-1 with reflect-101
/// borders and one rounding (s + 128) >> 8: the bits of 8-bit cv::pyrDown. Subsampled chroma starts at the
/// level whose size it has (4:2:0: level 1); 4:2:2 chroma is reduced vertically only to reach level 1; level
/// 0 repeats chroma samples. Of samples of more than 8 bits the upper 8 are read; grey has chroma of 128.
///
/// The frame is read at most once, from the top: each row is reduced through all levels while it is in the
/// cache. Of levels that the plan does not keep, only a few rows are in memory.
class Pyramid {
 public:
  Pyramid();
  ~Pyramid();

  /// Builds all planned levels from a frame. Allocates only when size, format, plan or the number of workers
  /// differ from the last call. Workers compute bands of rows; the result is the same.
  void build(const Frame& frame, const PyramidPlan& plan, Workers* workers = nullptr);

  int width(int level) const;
  int height(int level) const;
  /// Component 0..2 at a kept level. Level 0 of a component that is planar, of bytes and not subsampled is
  /// the frame's own plane.
  Plane plane(int level, int component) const;
  /// A level at which all three components are kept.
  Grid grid(int level) const {
    return {{plane(level, 0), plane(level, 1), plane(level, 2)}, width(level), height(level), level};
  }

 private:
  struct State;
  std::unique_ptr<State> state_;
};

} // namespace terrainseg
