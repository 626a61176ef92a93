// SPDX-License-Identifier: LGPL-2.1-or-later
// Checks of frames and mask targets.
#pragma once

#include <string>

#include "terrainseg/frame.hpp"
#include "terrainseg/mask_target.hpp"

namespace terrainseg {

/// Returns the error of an invalid frame and its remedy, or an empty text.
std::string flaw_of(const Frame& frame);

/// Returns the error of a mask target for this frame, or an empty text. An empty target is valid.
std::string flaw_of(const MaskTarget& target, const Frame& frame, int mask_level);

} // namespace terrainseg
