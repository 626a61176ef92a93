// SPDX-License-Identifier: LGPL-2.1-or-later
// What the user named, turned into things that can be decoded.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

namespace terrainseg::process {

struct Input {
  enum class Kind { file, images, uri };
  Kind kind = Kind::file;
  std::string label;                         ///< as the user knows it, for messages
  std::string stem;                          ///< base name of the outputs, different for every input of a run
  std::filesystem::path path;                ///< of a file
  std::vector<std::filesystem::path> images; ///< of a sequence, in order
  std::string problem;                       ///< why it cannot even be tried; empty = it can

  /// Tells two versions of an input apart: bytes and the last change in nanoseconds, summed over a sequence.
  /// {0, 0} when unknown (a URI).
  struct Identity {
    std::uint64_t bytes = 0;
    std::int64_t changed = 0;
    bool operator==(const Identity&) const = default;
  };
  Identity identity() const;
};

/// Expands files, folders and numbered patterns. What does not exist stays in the list with its problem, so
/// that it is reported in its turn. The same file named twice is one input.
std::vector<Input> find_inputs(const std::vector<std::string>& arguments);

} // namespace terrainseg::process
