// SPDX-License-Identifier: LGPL-2.1-or-later
// The files of one run: opened together under temporary names, and kept together or not at all.
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
  /// Of every file; -1 where it is not wanted.
  std::array<int, output_count> descriptors() const;
  /// Gives the files their names, those of a partial input when the record has a problem, and writes the
  /// record last.
  [[nodiscard]] std::optional<Fault> keep(Record& record);

 private:
  std::optional<Fault> make_folder(const std::filesystem::path& folder);
  std::optional<Fault> write_record(const Record& record, const std::filesystem::path& path);
  std::optional<Fault> name_files(Record& record, bool partial);
  void remove_partial() const;

  const Input& input_;
  const Naming& naming_;
  const Options& options_;
  /// Of outputs that are more than one file; those that are empty when the files are gone are removed.
  struct Folders {
    std::vector<std::filesystem::path> all;
    ~Folders();
  } folders_;
  AtomicFile summary_;
  std::array<AtomicFile, output_count> files_;
};

} // namespace terrainseg::process
