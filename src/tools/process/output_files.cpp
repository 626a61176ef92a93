// SPDX-License-Identifier: LGPL-2.1-or-later
#include "tools/process/output_files.hpp"

#include "tools/process/conflicts.hpp"

namespace terrainseg::process {

namespace fs = std::filesystem;

OutputFiles::Folders::~Folders() {
  std::error_code not_empty;
  for (const fs::path& folder : all)
    fs::remove(folder, not_empty);
}

/// The folder of an output if it is not the common one.
std::optional<Fault> OutputFiles::make_folder(const fs::path& folder) {
  if (folder == naming_.record().parent_path())
    return std::nullopt;
  std::error_code error;
  fs::create_directories(folder, error);
  folders_.all.push_back(folder);
  if (error)
    return cannot("make the folder", folder.string(), error.value());
  return std::nullopt;
}

/// The record's temporary file is opened first: its lock reserves the name for all outputs.
std::optional<Fault> OutputFiles::open() {
  std::error_code error;
  if (const fs::path folder = naming_.record().parent_path(); !folder.empty())
    fs::create_directories(folder, error);
  if (error)
    return cannot("make the folder of", naming_.record().string(), error.value());
  if (auto fault = summary_.open(naming_.record()))
    return fault;
  // Another run may have processed another input with this name since the batch was checked.
  if (auto problem = foreign_files(naming_, input_, options_))
    return Fault{Cause::unwritable, *problem};
  for (int i = 0; i < output_count; ++i) {
    if (!options_.wanted[i])
      continue;
    const fs::path path = naming_.output(static_cast<Output>(i));
    if (auto fault = make_folder(path.parent_path()))
      return fault;
    if (auto fault = files_[i].open(path))
      return fault;
  }
  return std::nullopt;
}

std::array<int, output_count> OutputFiles::descriptors() const {
  std::array<int, output_count> all;
  for (int i = 0; i < output_count; ++i)
    all[i] = files_[i].fd();
  return all;
}

/// Writes a record under its name. Its temporary file is created again, so the name stays reserved.
std::optional<Fault> OutputFiles::write_record(const Record& record, const fs::path& path) {
  summary_.write(record.to_json());
  if (auto fault = summary_.commit(path))
    return fault;
  return summary_.open(naming_.record());
}

std::optional<Fault> OutputFiles::name_files(Record& record, bool partial) {
  const fs::path folder = naming_.record().parent_path();
  for (int i = 0; i < output_count; ++i) {
    if (!options_.wanted[i])
      continue;
    const fs::path path = naming_.output(static_cast<Output>(i), partial);
    record.outputs[i] = {path.lexically_relative(folder).string(), files_[i].size()};
    if (auto fault = make_folder(path.parent_path()))
      return fault;
    if (auto fault = files_[i].commit(path))
      return fault;
  }
  return std::nullopt;
}

/// The partial files of an earlier attempt are removed when all outputs are complete.
void OutputFiles::remove_partial() const {
  std::error_code ignored;
  for (int i = 0; i < output_count; ++i)
    fs::remove(naming_.output(static_cast<Output>(i), true), ignored);
  fs::remove(naming_.output(Output::bag, true).parent_path(), ignored); // fails if it contains other files
  fs::remove(naming_.record(true), ignored);
}

std::optional<Fault> OutputFiles::keep(Record& record) {
  const bool partial = record.cause != Cause::none;
  const fs::path path = naming_.record(partial);
  // Until the new record is written, no record may claim that these outputs are complete, but one must always
  // identify their input.
  Record announced = record;
  announced.problem = "its outputs are being renamed";
  announced.cause = Cause::interrupted; // the result if the process ends here
  if (auto fault = write_record(announced, path))
    return fault;
  if (auto fault = name_files(record, partial))
    return fault;
  if (auto fault = write_record(record, path))
    return fault;
  if (!partial)
    remove_partial();
  return std::nullopt;
}

} // namespace terrainseg::process
