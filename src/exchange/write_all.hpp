// SPDX-License-Identifier: LGPL-2.1-or-later
// write() for files that must not be lost.
#pragma once

#include <unistd.h>

#include <cerrno>
#include <cstdint>
#include <span>

namespace terrainseg {

/// Writes all bytes; continues after interruptions and short writes. Returns 0 or the errno.
inline int write_all(int fd, std::span<const std::uint8_t> bytes) {
  while (!bytes.empty()) {
    const ssize_t count = ::write(fd, bytes.data(), bytes.size());
    if (count >= 0)
      bytes = bytes.subspan(static_cast<std::size_t>(count));
    else if (errno != EINTR)
      return errno;
  }
  return 0;
}

} // namespace terrainseg
