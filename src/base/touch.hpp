// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <cstdint>

namespace terrainseg {

/// Reads one byte of each half cache line, from the first to the last: the processor's own prefetch follows
/// this sequence, but not the scattered reads of the work that comes after it. It follows one load
/// instruction: unrolled, or with an unsigned index, which costs an instruction more, the pyramid of 1080p is
/// 8 to 40 % slower; with one byte of each line 3 %.
inline void touch(const std::uint8_t* bytes, std::ptrdiff_t count) {
  constexpr std::ptrdiff_t half_line = 32;
  for (std::ptrdiff_t i = 0; i < count; i += half_line)
    static_cast<void>(*static_cast<const volatile std::uint8_t*>(bytes + i));
}

} // namespace terrainseg
