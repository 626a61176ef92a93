// SPDX-License-Identifier: LGPL-2.1-or-later
// A list of the results of a run with a line per input, and its verification.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "tools/process/inputs.hpp"
#include "tools/process/options.hpp"
#include "tools/process/outputs.hpp"

namespace terrainseg::process {

// JSON Lines: the run, then its inputs in the order of completion. Written to FILE.part; renamed at the end
// of the run.

/// The run's line. `inputs` are those of this shard.
std::string manifest_head(const Options& options, std::size_t inputs);
/// The line of an input that was processed completely, partially or not at all, or skipped as complete. Reads
/// the outputs again for their SHA-256.
std::string manifest_line(const Options& options, const Input& input, const Outcome& outcome);

/// Whether a file begins like a manifest, so that a new one may replace it.
bool is_manifest(const std::filesystem::path& file);

/// Difference between one or several concatenated manifests and the existing files.
struct Check {
  std::vector<std::string>
      again; ///< missing or modified outputs, inputs and shards without a line, temporary problems
  std::vector<std::string> damaged; ///< permanently damaged inputs
  std::size_t whole = 0; ///< number of inputs whose outputs all have the recorded length and SHA-256
};

/// Verifies a manifest file, or standard input for "-". Each of the given inputs must have a line in it.
/// Throws EarlyExit if it cannot be read.
Check check_manifest(const Options& options, const std::vector<Input>& inputs);

} // namespace terrainseg::process
