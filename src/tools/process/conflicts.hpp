// SPDX-License-Identifier: LGPL-2.1-or-later
// What a run would destroy, found before its first byte is written.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "tools/process/inputs.hpp"
#include "tools/process/options.hpp"
#include "tools/process/outputs.hpp"

namespace terrainseg::process {

/// The outputs of one input, under the name the options choose.
Naming naming_of(const Options& options, const Input& input);

/// One line for each clash in the whole batch, naming both sides: an output that is an input, under whatever
/// path, symlink or hard link; two inputs with outputs of one name, also where only the case of letters tells
/// them apart; files in the folder that were not made from this input. Empty: nothing is in the way.
std::vector<std::string> find_conflicts(const std::vector<Input>& inputs, const Options& options);

/// Gives inputs whose outputs would have names that their file system does not take a problem that lasts.
void refuse_long_names(std::vector<Input>& inputs, const Options& options);

/// Why the files that lie under these names must not be replaced; nothing when there are none, or when their
/// record says that they were made from this very input.
std::optional<std::string> foreign_files(const Naming& naming, const Input& input, const Options& options);

} // namespace terrainseg::process
