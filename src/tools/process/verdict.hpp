// SPDX-License-Identifier: LGPL-2.1-or-later
// Decides whether an input was processed completely, after its pipeline has stopped.
#pragma once

#include <cstdint>

#include "tools/process/complaints.hpp"
#include "tools/process/faults.hpp"
#include "tools/process/inputs.hpp"
#include "tools/process/options.hpp"
#include "tools/process/source.hpp"

namespace terrainseg::process {

/// The facts about a stopped run.
struct Ended {
  const Input& input;
  const Options& options;
  const Source& source;
  const Complaints& complaints;
  std::uint64_t frames; ///< frames that terrainseg output
  GstClockTime end;     ///< end of the last frame
  gint64 duration;      ///< of the file, from its demuxer; 0 or less = unknown
  bool changed;         ///< the input was replaced or modified
};

/// Why there was no frame.
Fault why_empty(const Ended& run);

/// What is wrong with an input that gave frames. No cause: it is complete.
Fault damage_of(const Ended& run);

} // namespace terrainseg::process
