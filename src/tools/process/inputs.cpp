// SPDX-License-Identifier: LGPL-2.1-or-later
#include "tools/process/inputs.hpp"

#include <sys/stat.h>

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <cstring>
#include <map>
#include <optional>
#include <set>

#include "tools/process/options.hpp"

namespace terrainseg::process {
namespace {

namespace fs = std::filesystem;

constexpr const char* image_extensions[] = {".png", ".jpg", ".jpeg", ".bmp", ".ppm",
                                            ".pgm", ".pnm", ".webp", ".tif", ".tiff"};
constexpr const char* video_extensions[] = {".mp4",  ".m4v",  ".mov",   ".mkv",  ".webm", ".avi",  ".ts",
                                            ".mts",  ".m2ts", ".mpg",   ".mpeg", ".ogv",  ".ogg",  ".flv",
                                            ".wmv",  ".asf",  ".3gp",   ".y4m",  ".mxf",  ".h264", ".264",
                                            ".h265", ".hevc", ".mjpeg", ".mjpg", ".vob"};

template <std::size_t count>
bool has_extension(const fs::path& path, const char* const (&extensions)[count]) {
  std::string extension = path.extension().string();
  for (char& letter : extension)
    if (letter >= 'A' && letter <= 'Z')
      letter = static_cast<char>(letter - 'A' + 'a');
  return std::find(std::begin(extensions), std::end(extensions), extension) != std::end(extensions);
}

bool ends_with(const std::string& text, const std::string& end) {
  return text.size() >= end.size() && text.compare(text.size() - end.size(), end.size(), end) == 0;
}

/// An output of this tool in the folder it reads from is no input of the next run.
bool is_own_output(const fs::path& path) {
  for (const OutputKind& kind : output_kinds)
    if (ends_with(path.filename().string(), kind.suffix))
      return true;
  return false;
}

bool before(const fs::path& a, const fs::path& b) {
  return strverscmp(a.c_str(), b.c_str()) < 0;
}

Input failed(const std::string& label, const std::string& problem) {
  Input input;
  input.label = label;
  input.path = label;
  input.problem = problem;
  return input;
}

Input sequence(const std::string& label, const std::string& stem, std::vector<fs::path> images) {
  Input input;
  input.kind = Input::Kind::images;
  input.label = label;
  input.stem = stem;
  input.images = std::move(images);
  return input;
}

Input file(const fs::path& path) {
  if (has_extension(path, image_extensions))
    return sequence(path.string(), path.stem().string(), {path});
  Input input;
  input.label = path.string();
  input.path = path;
  input.stem = path.stem().string();
  return input;
}

std::string folder_name(const fs::path& folder) {
  std::error_code error;
  const fs::path whole = fs::weakly_canonical(folder, error);
  const std::string name = whole.filename().string();
  return name.empty() ? "root" : name;
}

void add_folder(const fs::path& folder, std::vector<Input>& inputs) {
  std::vector<fs::path> videos, images;
  std::error_code error;
  for (fs::directory_iterator entry(folder, error), end; !error && entry != end; entry.increment(error)) {
    const fs::path& path = entry->path();
    std::error_code ignored;
    if (path.filename().string().starts_with(".") || !fs::is_regular_file(path, ignored) ||
        is_own_output(path))
      continue;
    if (has_extension(path, video_extensions))
      videos.push_back(path);
    else if (has_extension(path, image_extensions))
      images.push_back(path);
  }
  if (error) {
    inputs.push_back(failed(folder.string(), "cannot read the folder: " + error.message()));
    return;
  }
  if (videos.empty() && images.empty()) {
    inputs.push_back(failed(folder.string(), "there is no video and no image in this folder"));
    return;
  }
  std::sort(videos.begin(), videos.end(), before);
  std::sort(images.begin(), images.end(), before);
  for (const fs::path& video : videos)
    inputs.push_back(file(video));
  if (!images.empty())
    inputs.push_back(sequence(folder.string(), folder_name(folder), std::move(images)));
}

/// A file name with one number in it: PREFIX %0WIDTHd SUFFIX.
struct Pattern {
  std::string prefix, suffix;
  int width = 1;
};

std::optional<Pattern> read_pattern(const std::string& name) {
  const std::size_t percent = name.find('%');
  if (percent == std::string::npos)
    return std::nullopt;
  std::size_t end = percent + 1;
  Pattern pattern{name.substr(0, percent), {}, 1};
  if (end < name.size() && name[end] == '0')
    ++end;
  const std::size_t digits = end;
  while (end < name.size() && name[end] >= '0' && name[end] <= '9')
    ++end;
  if (end > digits)
    std::from_chars(name.data() + digits, name.data() + end, pattern.width);
  if (end >= name.size() || name[end] != 'd')
    return std::nullopt;
  pattern.suffix = name.substr(end + 1);
  if (pattern.suffix.find('%') != std::string::npos)
    return std::nullopt;
  return pattern;
}

std::optional<std::uint64_t> number_in(const std::string& name, const Pattern& pattern) {
  if (name.size() <= pattern.prefix.size() + pattern.suffix.size() || !name.starts_with(pattern.prefix) ||
      !ends_with(name, pattern.suffix))
    return std::nullopt;
  const char* begin = name.data() + pattern.prefix.size();
  const char* end = name.data() + name.size() - pattern.suffix.size();
  std::uint64_t number = 0;
  const auto [stopped, error] = std::from_chars(begin, end, number);
  const bool padded = end - begin == pattern.width || (end - begin > pattern.width && *begin != '0');
  if (error != std::errc() || stopped != end || !padded)
    return std::nullopt;
  return number;
}

void add_pattern(const fs::path& argument, const Pattern& pattern, std::vector<Input>& inputs) {
  const fs::path folder = argument.has_parent_path() ? argument.parent_path() : fs::path(".");
  std::map<std::uint64_t, fs::path> numbered;
  std::error_code error;
  for (fs::directory_iterator entry(folder, error), end; !error && entry != end; entry.increment(error))
    if (const auto number = number_in(entry->path().filename().string(), pattern))
      numbered[*number] = argument.has_parent_path() ? entry->path() : entry->path().filename();
  if (numbered.empty()) {
    inputs.push_back(failed(argument.string(),
                            error ? "cannot read the folder: " + error.message() : "no file matches it"));
    return;
  }
  std::vector<fs::path> images;
  images.reserve(numbered.size());
  for (const auto& [number, path] : numbered)
    images.push_back(path);
  inputs.push_back(sequence(argument.string(), folder_name(folder), std::move(images)));
}

bool is_uri(const std::string& argument) {
  const std::size_t colon = argument.find("://");
  return colon != std::string::npos && colon > 0 &&
         std::all_of(argument.begin(), argument.begin() + colon, [](char c) {
           return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '+' ||
                  c == '-' || c == '.';
         });
}

Input from_uri(const std::string& uri) {
  Input input;
  input.kind = Input::Kind::uri;
  input.label = uri;
  const std::string place = uri.substr(0, uri.find_first_of("?#"));
  for (const char letter : place.substr(place.find_last_of('/') + 1))
    input.stem += (letter & 0x80) || std::isalnum(static_cast<unsigned char>(letter)) || strchr("-_.", letter)
                      ? letter
                      : '_';
  if (has_extension(input.stem, video_extensions))
    input.stem = fs::path(input.stem).stem().string();
  if (input.stem.find_first_not_of('.') == std::string::npos)
    input.stem = "stream";
  return input;
}

void add(const std::string& argument, std::vector<Input>& inputs) {
  const fs::path path(argument);
  std::error_code error;
  const fs::file_status status = fs::status(path, error);
  if (fs::is_directory(status))
    return add_folder(path, inputs);
  if (fs::exists(status)) {
    inputs.push_back(file(path));
    return;
  }
  if (is_uri(argument)) {
    inputs.push_back(from_uri(argument));
    return;
  }
  if (const auto pattern = read_pattern(path.filename().string()))
    return add_pattern(path, *pattern, inputs);
  inputs.push_back(failed(argument, status.type() == fs::file_type::not_found
                                        ? "there is no such file or folder"
                                        : error.message()));
}

void drop_repeated(std::vector<Input>& inputs) {
  std::set<std::string> seen;
  std::erase_if(inputs, [&](const Input& input) {
    std::error_code error;
    std::string key = input.kind == Input::Kind::uri ? input.label
                      : input.kind == Input::Kind::images
                          ? fs::weakly_canonical(input.images.front(), error).string()
                          : fs::weakly_canonical(input.path, error).string();
    return !seen.insert(key).second;
  });
}

/// clip.mp4 and clip.avi must not write the same files: names that occur twice get more of the path.
void make_stems_differ(std::vector<Input>& inputs) {
  const auto clashes = [&inputs] {
    std::map<std::string, int> uses;
    for (const Input& input : inputs)
      ++uses[input.stem];
    return uses;
  };
  auto uses = clashes();
  for (Input& input : inputs)
    if (uses[input.stem] > 1 && input.kind == Input::Kind::file)
      input.stem = input.path.filename().string();
  uses = clashes();
  for (Input& input : inputs) {
    if (uses[input.stem] <= 1)
      continue;
    const fs::path& place = input.kind == Input::Kind::images ? input.images.front() : input.path;
    const fs::path folder = place.parent_path();
    const fs::path above = input.kind == Input::Kind::images ? folder / ".." : folder;
    input.stem = folder_name(above.empty() ? fs::path(".") : above) + "_" + input.stem;
  }
  std::set<std::string> taken;
  for (Input& input : inputs) {
    const std::string stem = input.stem;
    for (int number = 2; !taken.insert(input.stem).second; ++number)
      input.stem = stem + "-" + std::to_string(number);
  }
}

} // namespace

Input::Identity Input::identity() const {
  Identity identity;
  const auto take = [&identity](const fs::path& each) {
    struct stat status;
    if (stat(each.c_str(), &status) != 0)
      return;
    identity.bytes += static_cast<std::uint64_t>(status.st_size);
    identity.changed = std::max<std::int64_t>(identity.changed, status.st_mtim.tv_sec * 1'000'000'000LL +
                                                                    status.st_mtim.tv_nsec);
  };
  if (kind == Kind::file)
    take(path);
  for (const fs::path& image : images)
    take(image);
  return identity;
}

std::vector<Input> find_inputs(const std::vector<std::string>& arguments) {
  std::vector<Input> inputs;
  for (const std::string& argument : arguments)
    add(argument, inputs);
  drop_repeated(inputs);
  make_stems_differ(inputs);
  return inputs;
}

} // namespace terrainseg::process
