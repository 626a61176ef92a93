// SPDX-License-Identifier: LGPL-2.1-or-later
// Splits one list of inputs between tasks that do not communicate.
#pragma once

#include <string>
#include <vector>

#include "tools/process/inputs.hpp"

namespace terrainseg::process {

inline constexpr int most_shards = 1'000'000;

struct Shard {
  int index = 1; ///< 1..count
  int count = 1;
};

/// Parses "I/N" with I in 1..N, or "auto": from the environment, either a Slurm array (SLURM_ARRAY_TASK_ID,
/// _MIN, _STEP and _COUNT) or a Kubernetes indexed Job (JOB_COMPLETION_INDEX, from 0, and
/// TERRAINSEG_SHARD_COUNT). Throws tools::UsageError if that is invalid.
Shard read_shard(const std::string& text);

/// The inputs of a shard. The shard of an input depends only on its path as given and the number of shards: a
/// list that grows between two tasks loses no input.
std::vector<Input> share_of(const Shard& shard, std::vector<Input> inputs);

} // namespace terrainseg::process
