// SPDX-License-Identifier: LGPL-2.1-or-later
// Resolves the arguments to inputs that can be decoded.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "tools/process/faults.hpp"

namespace terrainseg::process {

/// Identifies a recording by its content without reading all of it. Does not change when a file is touched,
/// renamed, moved or copied. A change that keeps the length and all sampled blocks is not detected.
struct Identity {
  std::uint64_t bytes = 0; ///< of all files
  std::string fingerprint; ///< hexadecimal; empty = unknown (a stream, or an unreadable file)
  bool operator==(const Identity&) const = default;
};

struct Input {
  enum class Kind { file, images, uri };
  Kind kind = Kind::file;
  std::string label = {}; ///< as given by the user, for messages
  std::string stem = {};  ///< base name of the outputs: "drive", "monday/drive"; empty if there is a fault
  std::filesystem::path path = {}; ///< of a file; of a URI all of it, with the password that the label omits
  std::vector<std::filesystem::path> images = {}; ///< files of a sequence, in order
  Fault fault = {};                               ///< why it cannot be processed at all

  /// Identifies the content; unknown for a stream.
  Identity identity() const;
  /// Identity and modification times of the files, to detect changes; empty for a stream.
  std::string state() const;
  /// The location in a unique spelling: the absolute path without links, or the URI.
  std::string place() const;
};

/// How outputs are named. A name depends only on its input: if two inputs would get the same name, the run is
/// refused.
enum class Names : std::uint8_t {
  base, ///< drive; for an input in a given folder the path from that folder: monday/drive
  path, ///< the path as given, without leading "/", "./" and "../"
  hash, ///< as base, with eight hexadecimal digits of the SHA-256 of the path as given
};

/// The result of find_inputs().
struct Found {
  std::vector<Input> inputs;
  std::vector<std::string> notes; ///< files in folders that were left out, a line per folder
};

/// Returns the text without user and password of the URIs in it, for logs and records.
std::string without_credentials(std::string text);

/// Expands files, folders and numbered patterns. Missing files stay in the list with a problem, and are
/// reported in order. A file that is given twice is one input. Folders are searched recursively; links to
/// folders are not followed.
Found find_inputs(const std::vector<std::string>& arguments, Names names = Names::base);

inline constexpr int most_shards = 1'000'000;

/// A part of one list of inputs, for tasks that do not communicate.
struct Shard {
  int index = 1; ///< 1..count
  int count = 1;
};

/// The inputs of a shard. The shard of an input depends only on its path as given and the number of shards: a
/// list that grows between two tasks loses no input.
std::vector<Input> share_of(const Shard& shard, std::vector<Input> inputs);

} // namespace terrainseg::process
