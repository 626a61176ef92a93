// SPDX-License-Identifier: LGPL-2.1-or-later
// Ignored regions: parts of the frame that are neither learned nor labelled (the rover's own bonnet, say).
#pragma once

#include <cstdint>
#include <span>

#include "terrainseg/frame.hpp"

namespace terrainseg {

/// Sets the cells of a row-by-row grid whose centres lie in a region to `value`.
void fill_ignored(std::span<const Rectangle> ignored, int level, int width, int height, std::uint8_t value,
                  std::uint8_t* cells);

/// Gives ignored parts of the mask the value 128; returns how many of their pixels were traversable.
/// `mask_level`: the mask is 2^level times smaller than the frame.
std::uint64_t mark_ignored(std::span<const Rectangle> ignored, int mask_level, const MutablePlane& mask,
                           int width, int height);

} // namespace terrainseg
