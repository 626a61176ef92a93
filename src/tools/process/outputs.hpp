// SPDX-License-Identifier: LGPL-2.1-or-later
// Files that appear completely or not at all, the record of an input, and the files that a run would
// overwrite.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "tools/process/faults.hpp"
#include "tools/process/inputs.hpp"
#include "tools/process/options.hpp"

namespace terrainseg::process {

/// A file with a temporary name (FINAL.part, in the final folder) that is renamed when it is complete. The
/// destructor deletes an incomplete file. A killed process leaves the .part file, which the next run reuses.
/// Locked, so that two runs never write the same file. Throws Fault.
class AtomicFile {
 public:
  AtomicFile() = default;
  ~AtomicFile() { discard(); }
  AtomicFile(const AtomicFile&) = delete;
  AtomicFile& operator=(const AtomicFile&) = delete;

  /// Creates the temporary file.
  void open(const std::filesystem::path& final_path);
  int fd() const { return fd_; } ///< -1 if not open
  /// Appends. Stores the first error for commit().
  void write(const std::string& text);
  /// Flushes the buffer to the system. Returns false after an error of this or an earlier write.
  bool flush();
  /// Flushes to disk (fsync), then renames to `path`, which must be on the same file system.
  void commit(const std::filesystem::path& path);
  std::uint64_t size() const;

 private:
  void discard();
  std::filesystem::path part_path_;
  int fd_ = -1;
  int failure_ = 0; ///< errno of the first failed write
  std::string buffer_;
};

/// The SHA-256 of a file, hexadecimal; empty if it cannot be read.
std::string sha256_of(const std::filesystem::path& file);

/// Temporary name of a file while it is written.
std::filesystem::path part_of(const std::filesystem::path& final_path);

/// Names of the outputs of an input: DIR/STEM.annotated.mp4, or DIR/annotated.mp4 if the stem is empty.
class Naming {
 public:
  Naming(std::filesystem::path folder, std::string stem)
      : folder_(std::move(folder)), stem_(std::move(stem)) {}
  Naming(const Options& options, const Input& input)
      : Naming(options.output_dir, options.name.value_or(input.stem)) {}
  std::filesystem::path output(Output kind, bool partial = false) const {
    return named(names_of(kind), partial);
  }
  std::filesystem::path record(bool partial = false) const {
    return named({"", "summary.json", "summary.json"}, partial);
  }

 private:
  std::filesystem::path named(const OutputKind& kind, bool partial) const;
  std::filesystem::path folder_;
  std::string stem_;
};

/// The result for an input: the content of NAME.summary.json.
struct Record {
  std::string input;
  std::string place; ///< of the input: Input::place()
  Identity identity;
  std::string settings; ///< all settings that influence the outputs, as one line
  Fault fault;          ///< none = complete
  std::uint64_t frames = 0;
  int width = 0, height = 0;         ///< of the first frame
  double seconds = 0;                ///< processing time
  std::uint64_t traversable_sum = 0; ///< permille, summed over the frames
  std::uint64_t blocked = 0;         ///< number of frames with the flag `blocked`
  std::uint64_t horizon_frames = 0;  ///< frames with a horizon
  double filter_milliseconds = 0;    ///< median time of terrainseg for a frame
  int still_rows = 0;                ///< rows at the bottom, below the training window, that never changed
  std::vector<std::string> warnings; ///< warnings of this project's elements, without repetitions
  struct Written {
    std::string file; ///< empty = not written
    std::uint64_t bytes = 0;
  };
  std::array<Written, output_count> outputs;

  double fps() const { return seconds > 0 ? static_cast<double>(frames) / seconds : 0; }
  double traversable() const {
    return frames ? static_cast<double>(traversable_sum) / (1000.0 * static_cast<double>(frames)) : 0;
  }
  std::string to_json() const;
};

/// Result of an input.
struct Outcome {
  enum class Kind {
    complete,
    partial,     ///< the input is damaged; the decoded part is in the partial files
    failed,      ///< no output
    interrupted, ///< by the user; no output
    skipped,     ///< complete by an earlier run
  };
  static constexpr int kinds = 5;
  Kind kind = Kind::failed;
  Record record; ///< record.fault: the cause if not complete
  bool kept() const { return kind == Kind::complete || kind == Kind::partial; }
};

/// The place and the identity of the input of a record. Returns nothing if the file is not a record of this
/// tool.
std::optional<Record> read_origin(const std::filesystem::path& record);

/// The record of an input before it is processed.
Record record_of(const Input& input, const Options& options);

/// Whether the record of an earlier run says that these outputs of this input are complete and were made with
/// these settings, and the files exist with the recorded sizes.
bool is_complete(const Input& input, const Options& options);

/// Returns a line with both names for each conflict in the whole batch: an output that is an input (by path,
/// symbolic link or hard link); two inputs whose outputs have the same name, also if only upper and lower
/// case differ; existing files that were not made from this input. Empty: no conflict.
std::vector<std::string> find_conflicts(const std::vector<Input>& inputs, const Options& options);

/// Sets a permanent problem for inputs whose output names the file system does not accept.
void refuse_long_names(std::vector<Input>& inputs, const Options& options);

/// Returns why the existing files of its outputs' names must not be replaced; nothing if there are none, or
/// if their record says that they were made from this input.
std::optional<std::string> foreign_files(const Input& input, const Options& options);

/// Creates the folder and writes a test file. Throws Fault; Cause::disk: temporary (full disk, no memory).
void prepare_folder(const std::filesystem::path& folder);

/// The output files of an input: opened together under temporary names, and completed together or not at all.
/// Throws Fault.
class OutputFiles {
 public:
  OutputFiles(const Input& input, const Options& options);
  AtomicFile& operator[](Output kind) { return files_[static_cast<std::size_t>(kind)]; }
  /// Renames the files to their final names, or to the names of a partial input if the record has a fault.
  /// Writes the record last.
  void keep(Record& record);

 private:
  void make_folder(const std::filesystem::path& folder);
  void write_record(const Record& record, const std::filesystem::path& path);

  const Options& options_;
  const Naming naming_;
  /// Folders of outputs with several files; removed if they become empty.
  struct Folders {
    std::vector<std::filesystem::path> all;
    ~Folders();
  } folders_;
  AtomicFile summary_;
  std::array<AtomicFile, output_count> files_;
};

} // namespace terrainseg::process
