// SPDX-License-Identifier: LGPL-2.1-or-later
// Why an input is not whole, as far as a script must tell.
#pragma once

#include <cstdint>

namespace terrainseg::process {

enum class Cause : std::uint8_t {
  none,
  damaged,     ///< what is in it cannot be decoded, or not all of it
  unsupported, ///< no video in it, or no decoder for it
  stalled,     ///< the decoder gave nothing for the time of --stall-timeout
  crashed,     ///< what decodes it crashed
  unwritable,  ///< an output has a name or a place that cannot be written
  changed,     ///< it was written to or replaced while it was read
  missing,     ///< not there, or not readable
  disk,        ///< an output could not be written
  resources,   ///< no memory, threads or descriptors; a bug of the pipeline
  interrupted, ///< by a signal
};

/// Its name in records and manifests.
inline const char* name_of(Cause cause) {
  constexpr const char* names[] = {"none",    "damaged",    "unsupported", "stalled",
                                   "crashed", "unwritable", "changed",     "missing",
                                   "disk",    "resources",  "interrupted"};
  return names[static_cast<int>(cause)];
}

/// Whether the same command may succeed later without anybody changing the input.
inline bool may_pass_later(Cause cause) {
  return cause >= Cause::changed;
}

} // namespace terrainseg::process
