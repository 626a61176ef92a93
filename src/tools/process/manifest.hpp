// SPDX-License-Identifier: LGPL-2.1-or-later
// What a run made, a line for each input, and the check that it is still there.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "tools/process/inputs.hpp"
#include "tools/process/options.hpp"
#include "tools/process/outputs.hpp"

namespace terrainseg::process {

/// JSON Lines: first the run, then its inputs as they end. Written as FILE.part, line by line; it has its
/// name when the run is over.
class Manifest {
 public:
  /// Creates the file and writes the run's line; `inputs` are those of this shard. Why it cannot, or nothing.
  std::optional<Fault> open(const Options& options, std::size_t inputs);
  bool is_open() const { return file_.fd() >= 0; }
  /// One input that was processed, in whole, in part or not at all, or skipped as complete. Reads the outputs
  /// again for their SHA-256.
  static std::string line(const Options& options, const Input& input, const Record& record, bool skipped,
                          bool kept);
  void write(const std::string& line);
  std::optional<Fault> close();

 private:
  AtomicFile file_;
};

/// True for a file that begins as a manifest does, which a new one may replace.
bool is_manifest(const std::filesystem::path& file);

/// What one or several manifests, one behind the other, promise, compared with what is there.
struct Check {
  std::vector<std::string>
      again; ///< missing or other outputs, inputs and shards without a line, what may pass
  std::vector<std::string> damaged; ///< inputs that are damaged for good
  std::size_t whole = 0;            ///< inputs of which every output is there, by length and SHA-256
};

/// Checks a manifest file, or standard input for "-"; inputs that are named must have a line in it. A text
/// when it cannot be read.
std::variant<Check, std::string> check_manifest(const Options& options, const std::vector<Input>& inputs);

} // namespace terrainseg::process
