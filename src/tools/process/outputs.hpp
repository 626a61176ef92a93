// SPDX-License-Identifier: LGPL-2.1-or-later
// Files that appear whole or not at all, and the record that says so.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "tools/process/cause.hpp"
#include "tools/process/faults.hpp"
#include "tools/process/inputs.hpp"
#include "tools/process/options.hpp"

namespace terrainseg::process {

/// A file under a temporary name (FINAL.part, in the final folder) that is given its own name when it is
/// whole. Destroyed before that it is deleted; a killed process leaves the .part file, which the next run
/// reuses. Locked, so that two runs never write the same file.
class AtomicFile {
 public:
  AtomicFile() = default;
  ~AtomicFile();
  AtomicFile(const AtomicFile&) = delete;
  AtomicFile& operator=(const AtomicFile&) = delete;

  /// Creates the temporary file; on failure says why.
  [[nodiscard]] std::optional<Fault> open(const std::filesystem::path& final_path);
  int fd() const { return fd_; } ///< -1 when not open
  const std::filesystem::path& final_path() const { return final_path_; }
  /// Appends; remembers the first failure for commit().
  void write(const std::string& text);
  /// Hands what was appended to the system; false when that failed, now or before.
  bool flush();
  /// Everything on disk (fsync), then renamed to `path`, which must lie on the same file system.
  [[nodiscard]] std::optional<Fault> commit(const std::filesystem::path& path);
  std::uint64_t size() const;

 private:
  void discard();
  std::filesystem::path final_path_, part_path_;
  int fd_ = -1;
  int failure_ = 0; ///< errno of the first failed write
  std::string buffer_;
};

/// A file without a name, which is gone with the process.
class ScratchFile {
 public:
  ScratchFile() = default;
  ~ScratchFile();
  ScratchFile(const ScratchFile&) = delete;
  ScratchFile& operator=(const ScratchFile&) = delete;
  /// In a folder, on its disk; false where that file system has no such files.
  bool open(const std::filesystem::path& folder);
  std::string path() const; ///< by which this process opens it again

 private:
  int fd_ = -1;
};

/// The name of a file while it is being written.
std::filesystem::path part_of(const std::filesystem::path& final_path);

/// Names of the outputs of an input: DIR/STEM.annotated.mp4, or DIR/annotated.mp4 when the stem is empty.
class Naming {
 public:
  Naming(std::filesystem::path folder, std::string stem)
      : folder_(std::move(folder)), stem_(std::move(stem)) {}
  std::filesystem::path output(Output kind, bool partial = false) const;
  std::filesystem::path record(bool partial = false) const;

 private:
  std::filesystem::path named(const std::string& suffix, const char* bare, bool partial) const;
  std::filesystem::path folder_;
  std::string stem_;
};

/// What was done with one input: the content of NAME.summary.json.
struct Record {
  std::string input;
  std::string place; ///< of the input: Input::place()
  Identity identity;
  std::string settings; ///< everything that shapes the outputs, as one line
  std::string problem;  ///< empty = complete
  Cause cause = Cause::none;
  std::uint64_t frames = 0;
  int width = 0, height = 0;         ///< of the first frame
  double seconds = 0;                ///< that it took
  std::uint64_t traversable_sum = 0; ///< permille, summed over the frames
  std::uint64_t blocked = 0;         ///< frames in which the way ahead was blocked
  std::uint64_t horizon_frames = 0;  ///< frames with a horizon
  double filter_milliseconds = 0;    ///< median of what terrainseg itself took for a frame
  int still_rows = 0;                ///< at the bottom, under the training window, that never changed
  std::vector<std::string> warnings; ///< of this project's elements, each once
  struct Written {
    std::string file;
    std::uint64_t bytes = 0;
  };
  std::array<std::optional<Written>, output_count> outputs;

  double fps() const { return seconds > 0 ? static_cast<double>(frames) / seconds : 0; }
  double traversable() const {
    return frames ? static_cast<double>(traversable_sum) / (1000.0 * static_cast<double>(frames)) : 0;
  }
  std::string to_json() const;
};

/// What a record says about the input that its files were made from.
struct Origin {
  std::string place;
  Identity identity;
};

/// Nothing when the file is no record of this tool.
std::optional<Origin> read_origin(const std::filesystem::path& record);

/// The settings that an input is processed with, as Record::settings.
std::string describe(const Options& options, const Input& input);

/// True when the record of an earlier run says that these outputs of this very input are whole, were made
/// with these settings, and the files are still there with the sizes they had.
bool is_complete(const Naming& naming, const Input& input, const Options& options);

/// Makes the folder and tries to write in it. Cause::disk: it may pass (a full disk, no memory).
std::optional<Fault> prepare_folder(const std::filesystem::path& folder);

} // namespace terrainseg::process
