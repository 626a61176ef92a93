// SPDX-License-Identifier: LGPL-2.1-or-later
// Finds files that a run would overwrite, before it writes anything.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "tools/process/inputs.hpp"
#include "tools/process/options.hpp"

namespace terrainseg::process {

/// Returns a line with both names for each conflict in the whole batch: an output that is an input (by path,
/// symbolic link or hard link); two inputs whose outputs have the same name, also if only upper and lower
/// case differ; existing files that were not made from this input. Empty: no conflict.
std::vector<std::string> find_conflicts(const std::vector<Input>& inputs, const Options& options);

/// Sets a permanent problem for inputs whose output names the file system does not accept.
void refuse_long_names(std::vector<Input>& inputs, const Options& options);

/// Returns why the existing files of its outputs' names must not be replaced; nothing if there are none, or
/// if their record says that they were made from this input.
std::optional<std::string> foreign_files(const Input& input, const Options& options);

} // namespace terrainseg::process
