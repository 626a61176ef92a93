// SPDX-License-Identifier: LGPL-2.1-or-later
// Whether a frame can be read, and a mask written.
#pragma once

#include <string>

#include "terrainseg/frame.hpp"
#include "terrainseg/mask_target.hpp"

namespace terrainseg {

/// What is wrong with a frame and what to do, or an empty text.
std::string flaw_of(const Frame& frame);

/// The same of a mask target for such a frame; an empty target has no flaw.
std::string flaw_of(const MaskTarget& target, const Frame& frame, int mask_level);

} // namespace terrainseg
