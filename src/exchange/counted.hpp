// SPDX-License-Identifier: LGPL-2.1-or-later
// Numbers with their nouns, for messages.
#pragma once

#include <cstdint>
#include <string>

namespace terrainseg {

/// "1 frame", "2 frames", "0 frames". `noun` is a singular whose plural ends in s.
inline std::string counted(std::uint64_t count, const char* noun) {
  return std::to_string(count).append(" ").append(noun).append(count == 1 ? "" : "s");
}

} // namespace terrainseg
