// SPDX-License-Identifier: LGPL-2.1-or-later
// The output files of an input: opened together under temporary names, and completed together or not at all.
#pragma once

#include <array>
#include <filesystem>
#include <optional>
#include <vector>

#include "tools/process/faults.hpp"
#include "tools/process/inputs.hpp"
#include "tools/process/options.hpp"
#include "tools/process/outputs.hpp"

namespace terrainseg::process {

class OutputFiles {
 public:
  OutputFiles(const Input& input, const Naming& naming, const Options& options)
      : input_(input), naming_(naming), options_(options) {}
  OutputFiles(const OutputFiles&) = delete;
  OutputFiles& operator=(const OutputFiles&) = delete;

  [[nodiscard]] std::optional<Fault> open();
  AtomicFile& operator[](Output kind) { return files_[static_cast<std::size_t>(kind)]; }
  /// File descriptors; -1 if the output is not written.
  std::array<int, output_count> descriptors() const;
  /// Renames the files to their final names, or to the names of a partial input if the record has a problem.
  /// Writes the record last.
  [[nodiscard]] std::optional<Fault> keep(Record& record);

 private:
  std::optional<Fault> make_folder(const std::filesystem::path& folder);
  std::optional<Fault> write_record(const Record& record, const std::filesystem::path& path);
  std::optional<Fault> name_files(Record& record, bool partial);
  void remove_partial() const;

  const Input& input_;
  const Naming& naming_;
  const Options& options_;
  /// Folders of outputs with several files; removed if they become empty.
  struct Folders {
    std::vector<std::filesystem::path> all;
    ~Folders();
  } folders_;
  AtomicFile summary_;
  std::array<AtomicFile, output_count> files_;
};

} // namespace terrainseg::process
