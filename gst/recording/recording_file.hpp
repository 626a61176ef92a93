// SPDX-License-Identifier: LGPL-2.1-or-later
// The file of a recording: under a temporary name until it is whole, and never in place of another.
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "recording/little_endian.hpp"

namespace terrainseg {

/// What went wrong, for a person, and the errno behind it.
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

  /// `location`: a file NAME.mcap, or a folder that is made and becomes a bag of ROS 2: NAME/NAME_0.mcap with
  /// NAME/metadata.yaml. Until finish() the file is called *.part. Refuses where one of them is there.
  [[nodiscard]] std::optional<FileProblem> open(const std::string& location);
  /// Writes to a descriptor that stays its owner's, who also names the file.
  void open(int fd);

  /// False when something could not be written, now or before: see problem().
  bool write(recording::ByteView bytes);
  FileProblem problem() const;
  /// Everything on the disk, then under its own name; into a bag goes `metadata` as well.
  [[nodiscard]] std::optional<FileProblem> finish(const std::string& metadata);
  /// Leaves what was written under the temporary name.
  void abandon();

  /// The name of the file in its folder; empty for a descriptor.
  std::string name() const { return path_.filename().string(); }

 private:
  FileProblem failed(const std::string& what, const std::filesystem::path& path, int error) const;

  std::filesystem::path path_, part_, metadata_; ///< metadata_ is empty where it is no bag
  int fd_ = -1;
  int error_ = 0; ///< of the first write that failed
};

} // namespace terrainseg
