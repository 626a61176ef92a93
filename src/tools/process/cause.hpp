// SPDX-License-Identifier: LGPL-2.1-or-later
// The causes why an input is not complete, as scripts see them.
#pragma once

#include <cstdint>

namespace terrainseg::process {

enum class Cause : std::uint8_t {
  none,
  damaged,     ///< its content, or a part of it, cannot be decoded
  unsupported, ///< no video in it, or no decoder for it
  stalled,     ///< the decoder delivered no frame for the time of --stall-timeout
  crashed,     ///< the process that decodes it crashed
  unwritable,  ///< the name or the folder of an output is not writable
  changed,     ///< it was modified or replaced while it was read
  missing,     ///< does not exist, or is not readable
  disk,        ///< an output could not be written
  resources,   ///< no memory, threads or descriptors; an internal error of the pipeline
  interrupted, ///< by a signal
};

/// The name of a cause in records and manifests.
inline const char* name_of(Cause cause) {
  constexpr const char* names[] = {"none",    "damaged",    "unsupported", "stalled",
                                   "crashed", "unwritable", "changed",     "missing",
                                   "disk",    "resources",  "interrupted"};
  return names[static_cast<int>(cause)];
}

/// Whether the same command may succeed later without a change of the input.
inline bool may_pass_later(Cause cause) {
  return cause >= Cause::changed;
}

} // namespace terrainseg::process
