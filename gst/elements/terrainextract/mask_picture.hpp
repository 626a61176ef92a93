// SPDX-License-Identifier: LGPL-2.1-or-later
// A mask as a picture of any size.
#pragma once

#include <cstdint>
#include <vector>

#include "terrainseg/estimate.hpp"

namespace terrainseg {

/// Draws the mask of an estimate as a picture of the whole frame, nearest neighbour. Keeps its tables:
/// nothing is allocated while the sizes stay.
class MaskScaler {
 public:
  /// `width` x `height` bytes into `target`. Where the frame is not covered by the mask the picture is 128.
  void draw(const Estimate& estimate, const MutablePlane& target, int width, int height);

  /// True when the picture of this size is the mask itself.
  static bool is_identity(const Estimate& estimate, int width, int height);

 private:
  std::vector<std::int32_t> columns_; ///< mask column of every picture column, -1 = not covered
};

} // namespace terrainseg
