// SPDX-License-Identifier: LGPL-2.1-or-later
#include "tools/process/outputs.hpp"

#include <glib.h>
#include <limits.h>
#include <sys/stat.h>
#include <unistd.h>

#include <map>
#include <utility>

#include "tools/process/handles.hpp"
#include "tools/process/manifest.hpp"

namespace terrainseg::process {
namespace {

namespace fs = std::filesystem;

using FileNumber = std::pair<dev_t, ino_t>;

/// The identity of the file at a path, after links; nothing if there is none.
std::optional<FileNumber> number_of(const fs::path& path) {
  struct stat status;
  if (stat(path.c_str(), &status) != 0)
    return std::nullopt;
  return FileNumber{status.st_dev, status.st_ino};
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

} // namespace terrainseg::process
