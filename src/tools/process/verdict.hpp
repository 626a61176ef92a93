// SPDX-License-Identifier: LGPL-2.1-or-later
// What is wrong with an input, when its pipeline has stopped.
#pragma once

#include <cstdint>

#include "tools/process/complaints.hpp"
#include "tools/process/faults.hpp"
#include "tools/process/inputs.hpp"
#include "tools/process/options.hpp"
#include "tools/process/source.hpp"

namespace terrainseg::process {

/// A run that is over.
struct Ended {
  const Input& input;
  const Options& options;
  const Source& source;
  const Complaints& complaints;
  std::uint64_t frames; ///< that came out of terrainseg
  GstClockTime end;     ///< of the last of them
  gint64 duration;      ///< of the file, by its demuxer; 0 and less: unknown
  bool changed;         ///< the input is not the file any more that it was before
};

/// Why not a single frame came.
Fault why_empty(const Ended& run);

/// What is wrong with an input of which frames came; no cause: it is whole.
Fault damage_of(const Ended& run);

} // namespace terrainseg::process
