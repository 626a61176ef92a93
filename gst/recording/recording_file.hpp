// SPDX-License-Identifier: LGPL-2.1-or-later
// The file of a recording. It has a temporary name until it is complete, and never replaces another file.
#pragma once

#include <fcntl.h>
#include <glib.h>
#include <unistd.h>

#include <cerrno>
#include <filesystem>
#include <optional>
#include <string>
#include <utility>

#include "exchange/write_all.hpp"
#include "recording/little_endian.hpp"

namespace terrainseg {

namespace fs = std::filesystem;

inline std::string quoted(const fs::path& path) {
  return std::string("\"").append(path.string()).append("\"");
}

inline int create(const fs::path& path) {
  return ::open(path.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC | O_NOFOLLOW, 0666);
}

/// Returns 0 or the errno. Pipes and devices need no fsync.
inline int sync_file(int fd) {
  return fsync(fd) == 0 || errno == EINVAL || errno == EROFS ? 0 : errno;
}

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
  [[nodiscard]] std::optional<FileProblem> open(const std::string& location) {
    abandon();
    error_ = 0;
    path_ = location;
    metadata_.clear();
    if (path_.extension() != ".mcap") {
      if (!path_.has_filename()) // the name ends with a slash
        path_ = path_.parent_path();
      std::error_code error;
      fs::create_directories(path_, error);
      if (error)
        return failed("Cannot make the folder", path_, error.value());
      metadata_ = path_ / "metadata.yaml";
      path_ /= path_.filename().string() + "_0.mcap";
    }
    part_ = path_;
    part_ += ".part";
    for (const fs::path& path : {path_, metadata_}) {
      std::error_code ignored;
      if (!path.empty() && fs::exists(fs::symlink_status(path, ignored)))
        return FileProblem{quoted(path) + " already exists, and recordings never replace files. Choose "
                                          "another location or move it away",
                           EEXIST};
    }
    fd_ = create(part_);
    if (fd_ < 0 && errno == EEXIST)
      return FileProblem{quoted(part_) +
                             " already exists: another recording is writing it, or was killed. Choose "
                             "another location, or move the file away: it can be read up to its end",
                         EEXIST};
    if (fd_ < 0)
      return failed("Cannot write", part_, errno);
    return std::nullopt;
  }
  /// Writes to a descriptor. The caller closes it and names the file.
  void open(int fd) {
    abandon();
    error_ = 0;
    path_ = part_ = metadata_ = fs::path(); // of the previous recording
    fd_ = fd;
  }

  /// Returns false after an error of this or an earlier write: see problem().
  bool write(recording::ByteView bytes) {
    if (error_ == 0)
      error_ = write_all(fd_, bytes);
    return error_ == 0;
  }
  FileProblem problem() const {
    if (path_.empty())
      return {g_strerror(error_), error_};
    FileProblem problem = failed("Cannot write", part_, error_);
    problem.text += ". It can be read to where it ends";
    return problem;
  }
  /// Flushes to disk, then renames the file; in a bag it also writes `metadata`.
  [[nodiscard]] std::optional<FileProblem> finish(const std::string& metadata) {
    if (path_.empty()) {
      fd_ = -1;
      return std::nullopt;
    }
    const int fd = std::exchange(fd_, -1);
    error_ = sync_file(fd);
    close(fd);
    if (error_ != 0)
      return problem();
    if (rename(part_.c_str(), path_.c_str()) != 0)
      return failed("Cannot give its name to", path_, errno);
    if (metadata_.empty())
      return std::nullopt;
    const int list = create(metadata_);
    if (list < 0)
      return failed("Cannot write", metadata_, errno);
    int error = write_all(list, recording::bytes_of(metadata));
    if (error == 0)
      error = sync_file(list);
    close(list);
    return error == 0 ? std::nullopt : std::optional(failed("Cannot write", metadata_, error));
  }
  /// Closes the file and keeps its temporary name.
  void abandon() {
    if (fd_ >= 0 && !path_.empty())
      close(fd_);
    fd_ = -1;
  }

  /// Name of the file in its folder; empty for a descriptor.
  std::string name() const { return path_.filename().string(); }

 private:
  FileProblem failed(const std::string& what, const fs::path& path, int error) const {
    return {what + " " + quoted(path) + ": " + g_strerror(error), error};
  }

  std::filesystem::path path_, part_, metadata_; ///< metadata_ is empty without a bag
  int fd_ = -1;
  int error_ = 0; ///< errno of the first failed write
};

} // namespace terrainseg
