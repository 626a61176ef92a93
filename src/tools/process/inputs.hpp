// SPDX-License-Identifier: LGPL-2.1-or-later
// What the user named, turned into things that can be decoded.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "tools/process/cause.hpp"
#include "tools/process/fingerprint.hpp"

namespace terrainseg::process {

struct Input {
  enum class Kind { file, images, uri };
  Kind kind = Kind::file;
  std::string label;          ///< as the user knows it, for messages
  std::string stem;           ///< base name of the outputs: "drive", "monday/drive"; empty with a problem
  std::filesystem::path path; ///< of a file; of a URI all of it, with the password that the label omits
  std::vector<std::filesystem::path> images; ///< of a sequence, in order
  std::string problem;                       ///< why it cannot even be tried; empty = it can
  Cause cause = Cause::none;                 ///< of the problem

  /// What is in it; unknown for a stream.
  Identity identity() const;
  /// Which files it is and when they were last written, for a comparison; empty for a stream.
  std::string state() const;
  /// Where it is, the same however it was spelled: the whole path without links, or the URI.
  std::string place() const;
};

/// How outputs are named after their inputs. A name depends on the input alone, never on the rest of a list:
/// where two inputs would get the same one, the run is refused.
enum class Names : std::uint8_t {
  base, ///< drive; below a folder that was named the path from there: monday/drive
  path, ///< the path as it was written, without "/", "./" and "../" in front
  hash, ///< as base, with eight hexadecimal digits of the SHA-256 of the path as it was written
};

/// What find_inputs() found.
struct Found {
  std::vector<Input> inputs;
  std::vector<std::string> notes; ///< members of folders that were left out, a line for each folder
};

/// The text without user and password of the URIs in it: it goes into logs and records.
std::string without_credentials(std::string text);

/// Expands files, folders and numbered patterns. What does not exist stays in the list with its problem, so
/// that it is reported in its turn. The same file named twice is one input. Folders are searched to their
/// depths, links to folders are not followed.
Found find_inputs(const std::vector<std::string>& arguments, Names names = Names::base);

} // namespace terrainseg::process
