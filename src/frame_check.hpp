// SPDX-License-Identifier: LGPL-2.1-or-later
// Whether a frame can be read.
#pragma once

#include <string>

#include "terrainseg/frame.hpp"

namespace terrainseg {

/// What is wrong with a frame and what to do, or an empty text.
std::string flaw_of(const Frame& frame);

} // namespace terrainseg
