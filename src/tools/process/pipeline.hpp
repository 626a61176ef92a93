// SPDX-License-Identifier: LGPL-2.1-or-later
// One input through one pipeline: decoder -> terrainseg -> tee -> an encoder or writer per output.
#pragma once

#include <atomic>
#include <cstdint>
#include <string>

#include "tools/process/inputs.hpp"
#include "tools/process/options.hpp"
#include "tools/process/outputs.hpp"

namespace terrainseg::process {

/// How far an input is; written by its pipeline, read by the display.
struct Progress {
  std::atomic<std::uint64_t> frames{0};
  std::atomic<int> permille{-1}; ///< done, 0..1000; -1 = length unknown
};

/// How an input ended.
struct Outcome {
  enum class Kind {
    complete,
    partial,     ///< the input is damaged; what could be decoded is in the partial files
    failed,      ///< nothing is kept
    interrupted, ///< by the user; nothing is kept
  };
  Kind kind = Kind::failed;
  Record record; ///< record.problem: the cause when not complete
};

/// Processes one input into the files that `naming` names, or, when the input is damaged, their partial
/// twins. Blocks until done; several calls may run in threads. `interrupted` ends it early.
Outcome process(const Input& input, const Naming& naming, const Options& options, Progress& progress,
                const std::atomic<int>& interrupted);

} // namespace terrainseg::process
