// SPDX-License-Identifier: LGPL-2.1-or-later
// The file of a recording. It has a temporary name until it is complete, and never replaces another file.
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "recording/little_endian.hpp"

namespace terrainseg {

/// An error message for the user, and its errno.
struct FileProblem {
  std::string text;
  int error;
};

class RecordingFile {
 public:
  RecordingFile() = default;
  ~RecordingFile() { abandon(); }
  RecordingFile(const RecordingFile&) = delete;
  RecordingFile& operator=(const RecordingFile&) = delete;

  /// `location` is a file NAME.mcap, or a folder that is created as a ROS 2 bag: NAME/NAME_0.mcap and
  /// NAME/metadata.yaml. The file is named *.part until finish(). Refuses existing files.
  [[nodiscard]] std::optional<FileProblem> open(const std::string& location);
  /// Writes to a descriptor. The caller closes it and names the file.
  void open(int fd);

  /// Returns false after an error of this or an earlier write: see problem().
  bool write(recording::ByteView bytes);
  FileProblem problem() const;
  /// Flushes to disk, then renames the file; in a bag it also writes `metadata`.
  [[nodiscard]] std::optional<FileProblem> finish(const std::string& metadata);
  /// Closes the file and keeps its temporary name.
  void abandon();

  /// Name of the file in its folder; empty for a descriptor.
  std::string name() const { return path_.filename().string(); }

 private:
  FileProblem failed(const std::string& what, const std::filesystem::path& path, int error) const;

  std::filesystem::path path_, part_, metadata_; ///< metadata_ is empty without a bag
  int fd_ = -1;
  int error_ = 0; ///< errno of the first failed write
};

} // namespace terrainseg
