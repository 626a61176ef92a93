// SPDX-License-Identifier: LGPL-2.1-or-later
// One list of inputs, shared out among tasks that know nothing of each other.
#pragma once

#include <string>
#include <variant>
#include <vector>

#include "tools/process/inputs.hpp"

namespace terrainseg::process {

inline constexpr int most_shards = 1'000'000;

struct Shard {
  int index = 1; ///< 1..count
  int count = 1;
};

/// "I/N" with I in 1..N, or "auto": from the environment, Slurm's array (SLURM_ARRAY_TASK_ID, _MIN, _STEP and
/// _COUNT) or a Kubernetes indexed Job (JOB_COMPLETION_INDEX, counted from 0, with TERRAINSEG_SHARD_COUNT).
/// A text where it cannot be read.
std::variant<Shard, std::string> read_shard(const std::string& text);

/// The inputs of one shard. Which shard an input belongs to depends on the way it was written and the number
/// of shards alone: a list that grew between two tasks leaves nothing out.
std::vector<Input> share_of(const Shard& shard, std::vector<Input> inputs);

} // namespace terrainseg::process
