// SPDX-License-Identifier: LGPL-2.1-or-later
#include "tools/process/inputs.hpp"

#include <glib.h>
#include <sys/stat.h>

#include <algorithm>
#include <charconv>
#include <cstring>
#include <fstream>
#include <map>
#include <optional>
#include <set>
#include <span>
#include <sstream>
#include <utility>

#include "exchange/counted.hpp"
#include "tools/process/handles.hpp"
#include "tools/process/options.hpp"

namespace terrainseg::process {
namespace {

namespace fs = std::filesystem;

constexpr const char* image_extensions[] = {".png", ".jpg", ".jpeg", ".bmp", ".ppm",
                                            ".pgm", ".pnm", ".webp", ".tif", ".tiff"};
constexpr const char* video_extensions[] = {".mp4", ".m4v",  ".mov",  ".mkv",   ".webm", ".avi", ".ts",
                                            ".mts", ".m2ts", ".mpg",  ".mpeg",  ".ogv",  ".ogg", ".flv",
                                            ".wmv", ".asf",  ".3gp",  ".gif",   ".y4m",  ".mxf", ".h264",
                                            ".264", ".h265", ".hevc", ".mjpeg", ".mjpg", ".vob"};

bool has_extension(const fs::path& path, std::span<const char* const> extensions) {
  return std::ranges::count(extensions, take(g_ascii_strdown(path.extension().c_str(), -1))) > 0;
}

/// Outputs of an earlier run in the same folder are not inputs.
bool is_own_output(const fs::path& path) {
  const std::string name = path.filename().string();
  for (const OutputKind& kind : output_kinds)
    if (name == kind.bare || name.ends_with(std::string(".") + kind.suffix))
      return true;
  return false;
}

bool before(const fs::path& a, const fs::path& b) {
  return strverscmp(a.c_str(), b.c_str()) < 0;
}

Input failed(const std::string& label, const std::string& problem, Cause cause = Cause::missing) {
  return {.label = label, .path = label, .fault = {cause, problem}};
}

Input sequence(const std::string& label, const std::string& stem, std::vector<fs::path> images) {
  return {.kind = Input::Kind::images, .label = label, .stem = stem, .images = std::move(images)};
}

/// A video, or a picture, which is a sequence of one frame.
Input file(const fs::path& path, const std::string& stem) {
  if (has_extension(path, image_extensions))
    return sequence(path.string(), stem, {path});
  return {.label = path.string(), .stem = stem, .path = path};
}

/// As it was written; what "." and ".." mean.
std::string folder_name(const fs::path& folder) {
  std::error_code error;
  fs::path written = folder.lexically_normal();
  if (!written.has_filename())
    written = written.parent_path();
  if (std::string name = written.filename().string(); !name.empty() && name != "." && name != "..")
    return name;
  const std::string name = fs::weakly_canonical(folder, error).filename().string();
  return name.empty() ? "root" : name;
}

/// Tells of the files of a folder that are not inputs, in one line.
std::string note_of(const fs::path& folder, const std::vector<std::string>& left_out) {
  constexpr std::size_t shown = 5;
  std::string names;
  for (std::size_t i = 0; i < std::min(left_out.size(), shown); ++i)
    names += (i ? ", " : "") + left_out[i];
  return folder.string() + ": left out " + counted(left_out.size(), "member") +
         (left_out.size() == 1 ? " that is" : " that are") +
         " no video or image by the name, an output of this tool, hidden, or a link to a folder: " + names +
         (left_out.size() > shown ? ", ..." : "");
}

/// The content of a folder and its subfolders, by folder, in natural order.
struct Members {
  std::vector<fs::path> videos;
  std::map<fs::path, std::vector<fs::path>> images; ///< by folder
  std::vector<std::string> left_out;
};

/// A link to what is not there (a disk that is not mounted): an input that fails, not one that is left out.
bool is_dead_link(const fs::directory_entry& entry) {
  std::error_code error;
  return entry.is_symlink(error) && !entry.exists(error);
}

std::error_code read_folder(const fs::path& folder, Members& members) {
  std::error_code error;
  for (fs::recursive_directory_iterator entry(folder, error), end; !error && entry != end;
       entry.increment(error)) {
    const fs::path& path = entry->path();
    std::error_code ignored;
    const bool hidden = path.filename().string().starts_with(".");
    if (entry->is_directory(ignored)) {
      if (hidden)
        entry.disable_recursion_pending();
      else if (!entry->is_symlink(ignored))
        continue;
    } else if (!hidden && (entry->is_regular_file(ignored) || is_dead_link(*entry)) && !is_own_output(path)) {
      const bool video = has_extension(path, video_extensions);
      if (video || has_extension(path, image_extensions)) {
        (video ? members.videos : members.images[path.parent_path()]).push_back(path);
        continue;
      }
    }
    members.left_out.push_back(path.lexically_relative(folder).string());
  }
  return error;
}

void add_folder(const fs::path& given, Found& found) {
  const fs::path folder = given.has_filename() ? given : given.parent_path(); // "recordings/"
  Members members;
  if (const std::error_code error = read_folder(folder, members)) {
    found.inputs.push_back(failed(folder.string(), "cannot read the folder: " + error.message(),
                                  cause_of_reading(error.value())));
    return;
  }
  if (!members.left_out.empty())
    found.notes.push_back(note_of(folder, members.left_out));
  if (members.videos.empty() && members.images.empty()) {
    found.inputs.push_back(
        failed(folder.string(), "there is no video and no image in this folder", Cause::unsupported));
    return;
  }
  std::ranges::sort(members.videos, before);
  for (const fs::path& video : members.videos)
    found.inputs.push_back(file(video, video.lexically_relative(folder).replace_extension().string()));
  for (auto& [place, images] : members.images) {
    std::ranges::sort(images, before);
    const std::string name =
        place == folder ? folder_name(folder) : place.lexically_relative(folder).string();
    found.inputs.push_back(sequence(place.string(), name, std::move(images)));
  }
}

/// A file name with one number: PREFIX %0WIDTHd SUFFIX.
struct Pattern {
  std::string prefix, suffix;
  int width = 1; ///< where no digits are written
};

std::optional<Pattern> read_pattern(const std::string& name) {
  const std::size_t percent = name.find('%');
  if (percent == name.npos || name.find('%', percent + 1) != name.npos)
    return std::nullopt;
  const std::size_t digits = percent + 1 + (name[percent + 1] == '0'),
                    end = name.find_first_not_of("0123456789", digits);
  if (end == name.npos || name[end] != 'd')
    return std::nullopt;
  Pattern pattern{name.substr(0, percent), name.substr(end + 1)};
  std::from_chars(name.data() + digits, name.data() + end, pattern.width);
  return pattern;
}

std::optional<std::uint64_t> number_in(const std::string& name, const Pattern& pattern) {
  if (name.size() <= pattern.prefix.size() + pattern.suffix.size() || !name.starts_with(pattern.prefix) ||
      !name.ends_with(pattern.suffix))
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

Input numbered(const fs::path& argument, const Pattern& pattern) {
  const fs::path folder = argument.has_parent_path() ? argument.parent_path() : fs::path(".");
  std::map<std::uint64_t, fs::path> numbered;
  std::error_code error;
  for (fs::directory_iterator entry(folder, error), end; !error && entry != end; entry.increment(error))
    if (const auto number = number_in(entry->path().filename().string(), pattern))
      numbered[*number] = argument.has_parent_path() ? entry->path() : entry->path().filename();
  if (numbered.empty())
    return failed(argument.string(),
                  error ? "cannot read the folder: " + error.message() : "no file matches it");
  std::vector<fs::path> images;
  images.reserve(numbered.size());
  for (const auto& [number, path] : numbered)
    images.push_back(path);
  return sequence(argument.string(), folder_name(folder), std::move(images));
}

/// "x:y" alone is treated as a missing file.
bool is_uri(const std::string& argument) {
  return gst_uri_is_valid(argument.c_str()) &&
         (argument.find("://") != std::string::npos || argument.starts_with("file:/"));
}

Input from_uri(const std::string& uri) {
  Input input{.kind = Input::Kind::uri, .label = without_credentials(uri), .path = uri};
  const std::string place = input.label.substr(0, input.label.find_first_of("?#"));
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

/// The path of a file:// URI of this machine; nothing for other URIs.
std::optional<fs::path> local_path(const std::string& uri) {
  char* host = nullptr;
  const std::string path = take(g_filename_from_uri(uri.c_str(), &host, nullptr));
  const std::string machine = take(host);
  if (path.empty() || !(machine.empty() || machine == "localhost"))
    return std::nullopt;
  return fs::path(path);
}

/// What is not a folder.
Input single(const fs::path& path) {
  std::error_code error;
  const fs::file_status status = fs::status(path, error);
  if (fs::is_regular_file(status))
    return file(path, path.stem().string());
  if (fs::exists(status))
    return failed(path.string(), "this is a pipe or a device, not a file", Cause::unsupported);
  if (path == "-")
    return failed("-", "standard input cannot be read; write it to a file first", Cause::unsupported);
  if (const auto pattern = read_pattern(path.filename().string()))
    return numbered(path, *pattern);
  if (status.type() == fs::file_type::not_found)
    return failed(path.string(), "there is no such file or folder");
  return failed(path.string(), error.message(), cause_of_reading(error.value()));
}

void add(const std::string& argument, Found& found) {
  std::error_code ignored;
  const bool named_by_uri = !fs::exists(argument, ignored) && is_uri(argument);
  const auto path = named_by_uri ? local_path(argument) : fs::path(argument);
  if (path && fs::is_directory(*path, ignored))
    add_folder(*path, found);
  else
    found.inputs.push_back(path ? single(*path) : from_uri(argument));
}

/// The path as given, without extension and without components that leave the output folder.
std::string written_path(const Input& input) {
  if (input.kind == Input::Kind::uri)
    return input.stem;
  fs::path path = fs::path(input.label).lexically_normal();
  if (!path.has_filename())
    path = path.parent_path();
  if (read_pattern(path.filename().string()) && input.kind == Input::Kind::images && input.images.size() != 1)
    path = path.parent_path();
  else if (input.kind == Input::Kind::file || input.images.size() == 1)
    path.replace_extension();
  fs::path inside;
  for (const fs::path& part : path.relative_path())
    if (part != ".." && part != ".")
      inside /= part;
  return inside.empty() ? input.stem : inside.string();
}

std::string sha256(const std::string& text) {
  return take(
      g_compute_checksum_for_string(G_CHECKSUM_SHA256, text.data(), static_cast<gssize>(text.size())));
}

/// Evenly distributed in 0..count-1: the first 8 bytes of the SHA-256 of the path as given.
int shard_of(const Input& input, int count) {
  const std::string written =
      input.kind == Input::Kind::uri ? input.label : fs::path(input.label).lexically_normal().string();
  return static_cast<int>(std::stoull(sha256(written).substr(0, 16), nullptr, 16) %
                          static_cast<unsigned>(count));
}

constexpr std::uint64_t file_end = 64 * 1024; ///< bytes at each end of a recording
constexpr std::uint64_t image_end = 4 * 1024; ///< bytes at each end of an image
constexpr std::uint64_t block = 4 * 1024;
constexpr std::uint64_t blocks = 64;

/// Adds a file's length, both ends and `middle_blocks` blocks between them. Adds its length to `total`.
/// Returns false if it cannot be read.
bool take_file(GChecksum* sum, const fs::path& path, std::uint64_t end, std::uint64_t middle_blocks,
               std::uint64_t& total) {
  std::error_code error;
  if (!fs::is_regular_file(path, error))
    return false;
  const std::uint64_t size = fs::file_size(path, error);
  std::ifstream file(path, std::ios::binary);
  if (error || !file)
    return false;
  total += size;
  const std::string length = std::to_string(size) + "\n";
  g_checksum_update(sum, reinterpret_cast<const guchar*>(length.data()), static_cast<gssize>(length.size()));
  const auto take_bytes = [&file, sum](std::uint64_t begin, std::uint64_t count) {
    std::string bytes(count, '\0');
    file.seekg(static_cast<std::streamoff>(begin));
    file.read(bytes.data(), static_cast<std::streamsize>(count));
    g_checksum_update(sum, reinterpret_cast<const guchar*>(bytes.data()), file.gcount());
  };
  const bool whole = size <= 2 * end + middle_blocks * block;
  take_bytes(0, whole ? size : end);
  for (std::uint64_t i = 0; i < middle_blocks && !whole; ++i)
    take_bytes(end + i * ((size - 2 * end) / middle_blocks), block);
  if (!whole)
    take_bytes(size - end, end);
  return file.good();
}

} // namespace

/// SHA-256. Of a file: over the length, the first and the last 64 KiB, and 64 blocks of 4 KiB evenly between.
/// Of a sequence: over the lengths and the first and last 4 KiB of every image, in order.
Identity Input::identity() const {
  Identity result;
  if (fault || kind == Kind::uri)
    return result;
  const std::unique_ptr<GChecksum, Releaser<g_checksum_free>> sum(g_checksum_new(G_CHECKSUM_SHA256));
  bool ok = kind == Kind::file ? take_file(sum.get(), path, file_end, blocks, result.bytes) : !images.empty();
  for (const fs::path& image : images)
    ok = ok && take_file(sum.get(), image, image_end, 0, result.bytes);
  if (ok)
    result.fingerprint = g_checksum_get_string(sum.get());
  return result;
}

std::string Input::state() const {
  std::ostringstream text;
  const auto add = [&text](const fs::path& file) {
    struct stat status = {};
    stat(file.c_str(), &status);
    text << status.st_dev << ' ' << status.st_ino << ' ' << status.st_size << ' ' << status.st_mtim.tv_sec
         << ' ' << status.st_mtim.tv_nsec << ' ';
  };
  if (kind == Kind::file)
    add(path);
  for (const fs::path& image : images)
    add(image);
  return text.str();
}

std::string Input::place() const {
  if (kind == Kind::uri)
    return label;
  std::error_code error;
  return fs::weakly_canonical(kind == Kind::images ? images.front() : path, error).string();
}

std::string without_credentials(std::string text) {
  const std::string scheme_end = "://";
  for (std::size_t at = text.find(scheme_end); at != std::string::npos; at = text.find(scheme_end, at)) {
    at += scheme_end.size();
    const std::size_t end = std::min(text.find_first_of("/?# \n)\"", at), text.size());
    const std::size_t sign = text.rfind('@', end);
    if (sign != std::string::npos && sign >= at)
      text.erase(at, sign + 1 - at);
  }
  return text;
}

Found find_inputs(const std::vector<std::string>& arguments, Names names) {
  Found found;
  for (const std::string& argument : arguments)
    add(argument, found);
  std::set<std::pair<std::string, std::size_t>> seen; // a picture is not the folder that begins with it
  std::erase_if(found.inputs,
                [&](const Input& input) { return !seen.emplace(input.place(), input.images.size()).second; });
  for (Input& input : found.inputs)
    if (!input.fault && names == Names::path)
      input.stem = written_path(input);
    else if (!input.fault && names == Names::hash)
      input.stem += "-" + sha256(fs::path(input.label).lexically_normal().string()).substr(0, 8);
  return found;
}

std::vector<Input> share_of(const Shard& shard, std::vector<Input> inputs) {
  std::erase_if(inputs,
                [&shard](const Input& input) { return shard_of(input, shard.count) != shard.index - 1; });
  return inputs;
}

} // namespace terrainseg::process
