// SPDX-License-Identifier: LGPL-2.1-or-later
#include "tools/process/outputs.hpp"

#include <fcntl.h>
#include <limits.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>
#include <utility>

#include "exchange/write_all.hpp"
#include "tools/process/handles.hpp"
#include "tools/process/manifest.hpp"

namespace terrainseg::process {
namespace {

namespace fs = std::filesystem;
using nlohmann::ordered_json;

constexpr std::size_t buffer_limit = 64 * 1024;

/// fsync of the folder, so that the rename reaches the disk.
void sync_folder(const fs::path& file) {
  const fs::path folder = file.has_parent_path() ? file.parent_path() : fs::path(".");
  const int fd = open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (fd >= 0) {
    fsync(fd);
    close(fd);
  }
}

using FileNumber = std::pair<dev_t, ino_t>;

/// The identity of the file at a path, after links; nothing if there is none.
std::optional<FileNumber> number_of(const fs::path& path) {
  struct stat status;
  if (stat(path.c_str(), &status) != 0)
    return std::nullopt;
  return FileNumber{status.st_dev, status.st_ino};
}

bool same_file(int fd, const fs::path& path) {
  struct stat status;
  return fstat(fd, &status) == 0 && number_of(path) == FileNumber{status.st_dev, status.st_ino};
}

/// Reads a record; the result is not an object if the file is none.
nlohmann::json read_record(const fs::path& path) {
  std::error_code error;
  if (!fs::is_regular_file(path, error))
    return {};
  std::ifstream file(path);
  return nlohmann::json::parse(file, nullptr, false);
}

/// The settings of an input, as in Record::settings.
std::string describe(const Options& options, const Input& input) {
  std::string text = "preset=" + (options.preset.empty() ? std::string("default") : options.preset);
  for (const auto& [name, value] : options.settings) {
    text.append(" ").append(name).append("=").append(value);
    // A calibration is identified by its content, not only by its name.
    const bool calibration = name == "camera-info" || name == "mount";
    if (const std::string content = calibration ? sha256_of(value) : ""; !content.empty())
      text += "@" + content.substr(0, 16);
  }
  if (options.wants(Output::annotated))
    text += " quality=" + std::to_string(options.quality);
  if (options.json_mask)
    text += " json-mask";
  if (options.max_frames)
    text += " frames=" + std::to_string(options.max_frames);
  if (input.kind == Input::Kind::images)
    text += " fps=" + std::to_string(options.fps_numerator) + "/" + std::to_string(options.fps_denominator);
  return text;
}

bool is_there(const fs::path& path) {
  struct stat status;
  return lstat(path.c_str(), &status) == 0;
}

/// A name without differences of case and Unicode form, which some file systems ignore.
std::string folded(const fs::path& path) {
  std::error_code error;
  const std::string whole = (fs::weakly_canonical(path.parent_path(), error) / path.filename()).string();
  if (!g_utf8_validate(whole.c_str(), static_cast<gssize>(whole.size()), nullptr))
    // NOLINTNEXTLINE(performance-no-automatic-move)
    return whole;
  const CharPointer normal(g_utf8_normalize(whole.c_str(), -1, G_NORMALIZE_ALL));
  return take(g_utf8_casefold(normal.get(), -1));
}

/// All names that the outputs of an input may get, temporary and final.
std::vector<fs::path> written_paths(const Input& input, const Options& options) {
  const Naming naming(options, input);
  std::vector<fs::path> paths = {naming.record(), naming.record(true)};
  for (const Output kind : options.outputs())
    for (const bool partial : {false, true})
      paths.push_back(naming.output(kind, partial));
  for (std::size_t i = 0, count = paths.size(); i < count; ++i)
    paths.push_back(part_of(paths[i]));
  return paths;
}

/// The inputs of a batch, by file identity.
class InputFiles {
 public:
  explicit InputFiles(const std::vector<Input>& inputs) {
    for (const Input& input : inputs) {
      if (input.kind == Input::Kind::file)
        add(input.path, input.label);
      for (const fs::path& image : input.images)
        add(image, image.string());
    }
  }
  /// The input that writing to `path` would overwrite.
  const std::string* at(const fs::path& path, const std::string& key) const {
    if (const auto number = number_of(path))
      if (const auto found = numbers_.find(*number); found != numbers_.end())
        return &found->second;
    const auto found = names_.find(key);
    return found != names_.end() ? &found->second : nullptr;
  }

 private:
  void add(const fs::path& path, const std::string& label) {
    if (const auto number = number_of(path))
      numbers_.emplace(*number, label);
    names_.emplace(folded(path), label);
  }
  std::map<FileNumber, std::string> numbers_;
  std::map<std::string, std::string> names_;
};

/// Conflicts of one input's outputs with the other inputs' outputs.
std::optional<std::string> clash_of(const Input& input, const Options& options, const InputFiles& files,
                                    std::map<std::string, const Input*>& claimed) {
  for (const fs::path& path : written_paths(input, options)) {
    const std::string key = folded(path);
    if (const std::string* victim = files.at(path, key))
      return "the output " + path.string() + " of " + input.label + " would replace the input " + *victim +
             "; choose another --output-dir";
    if (const auto [other, fresh] = claimed.emplace(key, &input); !fresh && other->second != &input)
      return input.label + " and " + other->second->label + " would both be written as " + path.string() +
             "; distinguish them with --names hash or --names path";
  }
  return std::nullopt;
}

/// Conflicts of a manifest.
std::optional<std::string> manifest_clash(const fs::path& manifest, const InputFiles& files,
                                          const std::map<std::string, const Input*>& claimed) {
  for (const fs::path& path : {manifest, part_of(manifest)}) {
    const std::string key = folded(path);
    if (const std::string* victim = files.at(path, key))
      return "the manifest " + path.string() + " would replace the input " + *victim;
    if (const auto found = claimed.find(key); found != claimed.end())
      return "the manifest " + path.string() + " would be written as an output of " + found->second->label;
  }
  if (is_there(manifest) && !is_manifest(manifest))
    return "the manifest " + manifest.string() +
           " would replace a file that is not a manifest; choose another name";
  return std::nullopt;
}

} // namespace

std::string sha256_of(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  if (!file)
    return {};
  const std::unique_ptr<GChecksum, Releaser<g_checksum_free>> sum(g_checksum_new(G_CHECKSUM_SHA256));
  std::array<char, 64 * 1024> buffer;
  while (file.read(buffer.data(), buffer.size()) || file.gcount() > 0)
    g_checksum_update(sum.get(), reinterpret_cast<const guchar*>(buffer.data()), file.gcount());
  return file.bad() ? "" : g_checksum_get_string(sum.get());
}

fs::path part_of(const fs::path& final_path) {
  fs::path path = final_path;
  return path += ".part";
}

void AtomicFile::discard() {
  if (fd_ < 0)
    return;
  unlink(part_path_.c_str());
  close(fd_);
  fd_ = -1;
}

void AtomicFile::open(const fs::path& final_path) {
  discard();
  part_path_ = part_of(final_path);
  std::error_code ignored;
  if (fs::is_directory(final_path, ignored))
    throw cannot("write", final_path.string(), EISDIR);
  // The owner of a .part file may rename or delete it between open() and flock(): then it is opened again.
  for (int attempt = 0; attempt < 100; ++attempt) {
    const int fd = ::open(part_path_.c_str(), O_RDWR | O_CREAT | O_CLOEXEC | O_NOFOLLOW, 0666);
    if (fd < 0)
      throw cannot("write", part_path_.string(), errno);
    if (flock(fd, LOCK_EX | LOCK_NB) != 0 && errno == EWOULDBLOCK) {
      close(fd);
      throw Fault{Cause::disk, "cannot write " + part_path_.string() + ": another run is writing it"};
    }
    if (!same_file(fd, part_path_)) {
      close(fd);
      continue;
    }
    fd_ = fd;
    failure_ = 0;
    buffer_.clear();
    if (ftruncate(fd, 0) != 0)
      throw cannot("write", part_path_.string(), errno);
    return;
  }
  throw cannot("lock", part_path_.string(), EAGAIN);
}

void AtomicFile::write(const std::string& text) {
  buffer_ += text;
  if (buffer_.size() >= buffer_limit)
    flush();
}

bool AtomicFile::flush() {
  if (failure_ == 0)
    failure_ = write_all(fd_, {reinterpret_cast<const std::uint8_t*>(buffer_.data()), buffer_.size()});
  buffer_.clear();
  return failure_ == 0;
}

void AtomicFile::commit(const fs::path& path) {
  if (flush() && fsync(fd_) != 0 && errno != EINVAL) // EINVAL: a special file, which needs no fsync
    failure_ = errno;
  const bool written = failure_ == 0;
  if (written && rename(part_path_.c_str(), path.c_str()) != 0)
    failure_ = errno;
  if (failure_ != 0) {
    discard();
    throw cannot(written ? "rename to" : "write", path.string(), failure_);
  }
  close(fd_);
  fd_ = -1;
  sync_folder(path);
}

std::uint64_t AtomicFile::size() const {
  struct stat status;
  return fd_ >= 0 && fstat(fd_, &status) == 0 ? static_cast<std::uint64_t>(status.st_size) + buffer_.size()
                                              : 0;
}

fs::path Naming::named(const OutputKind& kind, bool partial) const {
  const std::string tail = std::string(partial ? "partial." : "") + (stem_.empty() ? kind.bare : kind.suffix);
  return folder_ / (stem_.empty() ? tail : stem_ + "." + tail);
}

std::string Record::to_json() const {
  ordered_json json;
  json["tool"] = "terrainseg-process";
  json["version"] = TERRAINSEG_VERSION;
  json["input"] = {
      {"name", input}, {"place", place}, {"bytes", identity.bytes}, {"fingerprint", identity.fingerprint}};
  json["settings"] = settings;
  json["complete"] = !fault;
  json["problem"] = fault ? ordered_json(fault.text) : ordered_json();
  json["cause"] = fault ? ordered_json(name_of(fault.cause)) : ordered_json();
  json["frames"] = frames;
  json["width"] = width;
  json["height"] = height;
  json["seconds"] = seconds;
  json["fps"] = fps();
  json["filter_milliseconds"] = filter_milliseconds;
  json["traversable"] = traversable();
  json["blocked_frames"] = blocked;
  json["horizon_frames"] = horizon_frames;
  json["still_rows"] = still_rows;
  json["warnings"] = warnings;
  ordered_json files = ordered_json::object();
  for (int i = 0; i < output_count; ++i)
    if (!outputs[i].file.empty())
      files[output_kinds[i].name] = {{"file", outputs[i].file}, {"bytes", outputs[i].bytes}};
  json["outputs"] = files;
  // File names are bytes; invalid UTF-8 must not stop the run.
  return json.dump(2, ' ', false, ordered_json::error_handler_t::replace) + "\n";
}

Record record_of(const Input& input, const Options& options) {
  Record record;
  record.input = input.label;
  record.place = input.place();
  record.identity = input.identity();
  record.settings = describe(options, input);
  return record;
}

std::optional<Record> read_origin(const fs::path& record) {
  const nlohmann::json json = read_record(record);
  try {
    const auto& input = json.at("input");
    // Refuses numbers such as 1e300.
    const auto& bytes = input.at("bytes").get_ref<const nlohmann::json::number_unsigned_t&>();
    Record record;
    record.place = input.at("place");
    record.identity = {bytes, input.at("fingerprint")};
    return record;
  } catch (const nlohmann::json::exception&) {
    return std::nullopt;
  }
}

bool is_complete(const Input& input, const Options& options) {
  const Naming naming(options, input);
  const nlohmann::json json = read_record(naming.record());
  try {
    if (!json.at("complete").get<bool>() || json.at("version") != TERRAINSEG_VERSION ||
        json.at("settings") != describe(options, input))
      return false;
    for (const Output kind : options.outputs()) {
      std::error_code error;
      const std::uint64_t bytes = fs::file_size(naming.output(kind), error);
      if (error || json.at("outputs").at(names_of(kind).name).at("bytes") != bytes)
        return false;
    }
    const Identity identity = input.identity();
    return !identity.fingerprint.empty() && json.at("input").at("bytes") == identity.bytes &&
           json.at("input").at("fingerprint") == identity.fingerprint;
  } catch (const nlohmann::json::exception&) { // a record with other types
    return false;
  }
}

std::vector<std::string> find_conflicts(const std::vector<Input>& inputs, const Options& options) {
  const InputFiles files(inputs);
  std::map<std::string, const Input*> claimed;
  std::vector<std::string> conflicts;
  for (const Input& input : inputs) {
    if (input.fault) // no outputs
      continue;
    auto conflict = clash_of(input, options, files, claimed);
    if (!conflict)
      conflict = foreign_files(input, options);
    if (conflict)
      conflicts.push_back(*conflict);
  }
  if (!options.manifest.empty())
    if (auto conflict = manifest_clash(options.manifest, files, claimed))
      conflicts.push_back(*conflict);
  return conflicts;
}

void refuse_long_names(std::vector<Input>& inputs, const Options& options) {
  fs::path folder = options.output_dir;
  std::error_code error;
  while (!fs::exists(folder, error) && folder.has_parent_path())
    folder = folder.parent_path();
  const long told = pathconf(folder.empty() ? "." : folder.c_str(), _PC_NAME_MAX);
  const std::size_t most = told > 0 ? static_cast<std::size_t>(told) : NAME_MAX;
  for (Input& input : inputs) {
    if (input.fault)
      continue;
    for (const fs::path& path : written_paths(input, options)) {
      bool fits = path.native().size() < PATH_MAX;
      for (const fs::path& part : path)
        fits = fits && part.native().size() <= most;
      if (!fits)
        input.fault = {Cause::unwritable, "its outputs would have names of more than " +
                                              std::to_string(most) + " bytes, or " +
                                              std::to_string(PATH_MAX) +
                                              " with their folders; choose a shorter one with --name"};
    }
  }
}

std::optional<std::string> foreign_files(const Input& input, const Options& options) {
  const Naming naming(options, input);
  std::optional<Identity> identity; // computed only if needed, because it reads the file
  for (const bool partial : {false, true}) {
    std::optional<fs::path> there;
    for (const Output kind : options.outputs())
      if (const fs::path path = naming.output(kind, partial); !there && is_there(path))
        there = path;
    const fs::path record = naming.record(partial);
    if (is_there(record))
      there = record;
    if (!there)
      continue;
    const auto origin = read_origin(record);
    const std::string remedy = "; move it away or choose another --output-dir";
    if (!origin)
      return there->string() + " already exists, and no record says that it was made from " + input.label +
             remedy;
    if (origin->place == input.place())
      continue;
    if (!identity)
      identity = input.identity();
    if (identity->fingerprint.empty() || !(origin->identity == *identity))
      return there->string() + " was made from " + origin->place + ", not from " + input.label + remedy;
  }
  return std::nullopt;
}

void prepare_folder(const fs::path& folder) {
  const std::string name = "the output folder " + folder.string();
  std::error_code error;
  fs::create_directories(folder, error);
  if (error.value() == ENOENT) // no folder can be created there, as in /proc
    throw Fault{Cause::unwritable, cannot("make", name, ENOENT).text};
  if (error)
    throw cannot("make", name, error.value());
  std::string probe = (folder / ".terrainseg-process-XXXXXX").string();
  const int fd = mkstemp(probe.data());
  if (fd < 0)
    throw cannot("write in", name, errno);
  close(fd);
  unlink(probe.c_str());
}

OutputFiles::Folders::~Folders() {
  std::error_code not_empty;
  for (const fs::path& folder : all)
    fs::remove(folder, not_empty);
}

/// The folder of an output if it is not the common one.
void OutputFiles::make_folder(const fs::path& folder) {
  if (folder == naming_.record().parent_path())
    return;
  std::error_code error;
  fs::create_directories(folder, error);
  folders_.all.push_back(folder);
  if (error)
    throw cannot("make the folder", folder.string(), error.value());
}

/// The record's temporary file is opened first: its lock reserves the name for all outputs.
OutputFiles::OutputFiles(const Input& input, const Options& options)
    : options_(options), naming_(options, input) {
  std::error_code error;
  if (const fs::path folder = naming_.record().parent_path(); !folder.empty())
    fs::create_directories(folder, error);
  if (error)
    throw cannot("make the folder of", naming_.record().string(), error.value());
  summary_.open(naming_.record());
  // Another run may have processed another input with this name since the batch was checked.
  if (auto problem = foreign_files(input, options))
    throw Fault{Cause::unwritable, *problem};
  for (const Output kind : options_.outputs()) {
    const fs::path path = naming_.output(kind);
    make_folder(path.parent_path());
    (*this)[kind].open(path);
  }
}

/// Writes a record under its name. Its temporary file is created again, so the name stays reserved.
void OutputFiles::write_record(const Record& record, const fs::path& path) {
  summary_.write(record.to_json());
  summary_.commit(path);
  summary_.open(naming_.record());
}

void OutputFiles::keep(Record& record) {
  const bool partial{record.fault};
  const fs::path path = naming_.record(partial);
  // Until the new record is written, no record may claim that these outputs are complete, but one must always
  // identify their input.
  Record announced = record;
  announced.fault = {Cause::interrupted,
                     "its outputs are being renamed"}; // the result if the process ends here
  write_record(announced, path);
  for (const Output kind : options_.outputs()) {
    const fs::path output = naming_.output(kind, partial);
    AtomicFile& file = (*this)[kind];
    record.outputs[static_cast<std::size_t>(kind)] = {output.lexically_relative(path.parent_path()).string(),
                                                      file.size()};
    make_folder(output.parent_path());
    file.commit(output);
  }
  write_record(record, path);
  if (partial)
    return;
  // The partial files of an earlier attempt are removed when all outputs are complete.
  std::error_code ignored;
  for (int i = 0; i < output_count; ++i)
    fs::remove(naming_.output(static_cast<Output>(i), true), ignored);
  fs::remove(naming_.output(Output::bag, true).parent_path(), ignored); // fails if it contains other files
  fs::remove(naming_.record(true), ignored);
}

} // namespace terrainseg::process
