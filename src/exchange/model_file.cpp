// SPDX-License-Identifier: LGPL-2.1-or-later
#include "exchange/model_file.hpp"

#include <algorithm>
#include <array>
#include <atomic>
#include <cerrno>
#include <cstring>
#include <fcntl.h>
#include <filesystem>
#include <sys/stat.h>
#include <unistd.h>
#include <utility>

#include "exchange/bytes.hpp"
#include "exchange/write_all.hpp"

namespace terrainseg {
namespace {

constexpr std::array<std::uint8_t, 8> magic = {'T', 'E', 'R', 'R', 'A', 'I', 'N', '\n'};
constexpr std::size_t header_size = magic.size() + 4 + 4;
constexpr std::size_t model_size = 3 * 2 + 3 * 4 + 8;
constexpr std::size_t largest_content =
    4 + max_models * model_size + 3 * 4 + 4 * (color_bins + 2 * texture_bins) + 3 * 4 + 2 * 2 + 4;
constexpr std::size_t largest_file = header_size + largest_content + 4;

void put_histogram(std::vector<std::uint8_t>& out, const std::vector<std::uint32_t>& histogram) {
  put_integer(out, static_cast<std::uint32_t>(histogram.size()));
  for (const std::uint32_t bin : histogram)
    put_integer(out, bin);
}

/// Calls pass(number) for the numbers behind the histograms.
template <class AnyTerrain, class Pass>
void each_number_behind(AnyTerrain& terrain, std::uint32_t version, const Pass& pass) {
  pass(terrain.exposure_mean);
  pass(terrain.horizon);
  pass(terrain.generation);
  if (version < 2)
    return;
  pass(terrain.line.width);
  pass(terrain.line.height);
  pass(terrain.line.row_q8);
}

TerrainResult refuse(std::string why) {
  return {std::nullopt, std::move(why)};
}

/// Reads a histogram of exactly `bins` bins or of none. Returns the error otherwise.
std::string take_histogram(ByteReader& in, const char* name, std::uint32_t bins,
                           std::vector<std::uint32_t>& out) {
  const auto count = in.little<std::uint32_t>();
  if (count != 0 && count != bins)
    return std::string("the histogram of ") + name + " has " + std::to_string(count) +
           " bins, this version of terrainseg supports 0 or " + std::to_string(bins);
  out.resize(count);
  for (std::uint32_t& bin : out)
    bin = in.little<std::uint32_t>();
  return {};
}

std::string cause(const char* doing, const std::string& path, int error) {
  return std::string(doing) + " '" + path + "': " + std::strerror(error);
}

class Descriptor {
 public:
  explicit Descriptor(int fd) : fd_(fd) {}
  ~Descriptor() {
    if (fd_ >= 0)
      ::close(fd_);
  }
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;
  int get() const { return fd_; }
  int close() { return ::close(std::exchange(fd_, -1)); }

 private:
  int fd_;
};

/// Creates a file of the default mode (mkstemp() would use 0600) with a unique name.
Descriptor create_beside(const std::string& path, std::string& name) {
  static std::atomic<unsigned> serial = 0;
  for (int attempt = 0; attempt < 100; ++attempt) {
    name = path + "." + std::to_string(::getpid()) + "-" + std::to_string(serial++) + ".part";
    const int fd = ::open(name.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
    if (fd >= 0 || errno != EEXIST)
      return Descriptor(fd);
  }
  return Descriptor(-1);
}

/// Resolves symbolic links one by one, because the target may not exist yet. Sets `error` if the links form a
/// loop.
std::string through_links(std::filesystem::path path, int& error) {
  for (int hops = 0; hops < 40; ++hops) {
    std::error_code no_link;
    const auto target = std::filesystem::read_symlink(path, no_link);
    if (no_link)
      return path;
    path.replace_filename(target);
  }
  error = ELOOP;
  return path;
}

/// Returns the error if a path is not a regular file; empty for a regular file.
std::string no_file(const char* doing, const std::string& path, const struct stat& s) {
  if (S_ISREG(s.st_mode))
    return {};
  const char* kind = S_ISDIR(s.st_mode)    ? "a directory"
                     : S_ISCHR(s.st_mode)  ? "a character device"
                     : S_ISBLK(s.st_mode)  ? "a block device"
                     : S_ISFIFO(s.st_mode) ? "a pipe"
                                           : "a socket or something else";
  return std::string(doing) + " '" + path + "': it is " + kind + ", not a file; choose another path";
}

} // namespace

std::vector<std::uint8_t> serialize_terrain(const Terrain& terrain) {
  std::vector<std::uint8_t> content;
  content.reserve(largest_content);
  content.push_back(terrain.space.rgb ? 1 : 0);
  content.push_back(static_cast<std::uint8_t>(terrain.space.colorimetry.range));
  content.push_back(static_cast<std::uint8_t>(terrain.space.colorimetry.matrix));
  content.push_back(static_cast<std::uint8_t>(terrain.models.size()));
  const auto put_number = [&](auto number) { put_integer(content, number); };
  for (const TerrainModel& model : terrain.models)
    each_moment(model, put_number);
  put_histogram(content, terrain.negative_colors);
  put_histogram(content, terrain.terrain_texture);
  put_histogram(content, terrain.negative_texture);
  each_number_behind(terrain, model_file_version, put_number);

  std::vector<std::uint8_t> file(magic.begin(), magic.end());
  put_integer(file, model_file_version);
  put_integer(file, static_cast<std::uint32_t>(content.size()));
  file.insert(file.end(), content.begin(), content.end());
  put_integer(file, crc32(file));
  return file;
}

TerrainResult parse_terrain(std::span<const std::uint8_t> bytes) {
  if (bytes.empty())
    return refuse("the file is empty: save the learned terrain again");
  if (bytes.size() < magic.size() || !std::ranges::equal(magic, bytes.first<magic.size()>()))
    return refuse("not a learned terrain of terrainseg: it does not begin with \"TERRAIN\"");
  ByteReader header(bytes.subspan(magic.size()));
  const auto version = header.little<std::uint32_t>();
  const auto size = header.little<std::uint32_t>();
  if (!header.ok())
    return refuse("the file is cut short: it ends within its header after " + std::to_string(bytes.size()) +
                  " bytes");
  if (version == 0)
    return refuse("the file is damaged: version 0 was never written");
  if (version > model_file_version)
    return refuse("the file has version " + std::to_string(version) +
                  ", written by a newer terrainseg; this one reads up to version " +
                  std::to_string(model_file_version) + ": update terrainseg or save the terrain again");
  if (size > largest_content)
    return refuse("the file is damaged: it announces " + std::to_string(size) +
                  " bytes of content, at most " + std::to_string(largest_content) + " are possible");
  const std::size_t whole = header_size + size + 4;
  if (bytes.size() < whole)
    return refuse("the file is cut short: " + std::to_string(bytes.size()) + " of " + std::to_string(whole) +
                  " bytes are there");
  if (bytes.size() > whole)
    return refuse("the file is damaged: " + std::to_string(bytes.size() - whole) + " bytes follow its end");
  if (ByteReader(bytes.subspan(whole - 4)).little<std::uint32_t>() != crc32(bytes.first(whole - 4)))
    return refuse("the file is damaged: its checksum does not match its content");

  ByteReader in(bytes.subspan(header_size, size));
  Terrain terrain;
  const auto rgb = in.little<std::uint8_t>(), range = in.little<std::uint8_t>(),
             matrix = in.little<std::uint8_t>();
  if (rgb > 1 || range > 1 || matrix > 2)
    return refuse("unknown colour space (rgb " + std::to_string(rgb) + ", range " + std::to_string(range) +
                  ", matrix " + std::to_string(matrix) + ")");
  terrain.space = {rgb == 1, {static_cast<ColorRange>(range), static_cast<ColorMatrix>(matrix)}};
  const auto models = in.little<std::uint8_t>();
  if (models > max_models)
    return refuse("the file holds " + std::to_string(models) + " models, at most " +
                  std::to_string(max_models) + " are possible");
  terrain.models.resize(models);
  const auto take_number = [&]<class Number>(Number& number) { number = in.little<Number>(); };
  for (TerrainModel& model : terrain.models)
    each_moment(model, take_number);
  for (std::string wrong : {take_histogram(in, "negative colours", color_bins, terrain.negative_colors),
                            take_histogram(in, "terrain texture", texture_bins, terrain.terrain_texture),
                            take_histogram(in, "negative texture", texture_bins, terrain.negative_texture)})
    if (!wrong.empty())
      return refuse(std::move(wrong));
  each_number_behind(terrain, version, take_number);
  if (!in.ok() || !in.done())
    return refuse("the file is damaged: its content does not have the size that its counts add up to");
  if (const std::string flaw = flaw_of(terrain); !flaw.empty())
    return refuse("the file has an invalid value: " + flaw + "; learn the terrain again");
  return {std::move(terrain), {}};
}

TerrainResult load_terrain(const std::string& path) {
  // O_NONBLOCK: opening a pipe must not wait for a writer.
  Descriptor fd(::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK));
  struct stat is {};
  if (fd.get() < 0 || ::fstat(fd.get(), &is) != 0)
    return refuse(cause("cannot open", path, errno));
  if (std::string why = no_file("cannot load", path, is); !why.empty())
    return refuse(std::move(why));
  std::vector<std::uint8_t> bytes(largest_file + 1);
  std::size_t size = 0;
  while (size < bytes.size()) {
    const ssize_t n = ::read(fd.get(), bytes.data() + size, bytes.size() - size);
    if (n < 0 && errno == EINTR)
      continue;
    if (n < 0)
      return refuse(cause("cannot read", path, errno));
    if (n == 0)
      break;
    size += static_cast<std::size_t>(n);
  }
  TerrainResult result = parse_terrain(std::span(bytes).first(size));
  if (!result.error.empty())
    result.error = "cannot load '" + path + "': " + result.error;
  return result;
}

std::string save_terrain(const std::string& name, const Terrain& terrain) {
  if (name.empty())
    return "cannot write: the path is empty";
  int error = 0;
  const std::string path = through_links(name, error);
  if (error != 0)
    return cause("cannot write", name, error);
  struct stat old {};
  const bool replaces = ::stat(path.c_str(), &old) == 0;
  if (std::string why = replaces ? no_file("cannot write", name, old) : ""; !why.empty())
    return why;
  const std::vector<std::uint8_t> bytes = serialize_terrain(terrain);
  std::string temporary;
  Descriptor fd = create_beside(path, temporary);
  if (fd.get() < 0)
    return cause("cannot create a temporary file beside", path, errno);
  if (write_all(fd.get(), bytes) != 0 || (replaces && ::fchmod(fd.get(), old.st_mode & 07777) != 0) ||
      ::fsync(fd.get()) != 0 || fd.close() != 0 || ::rename(temporary.c_str(), path.c_str()) != 0) {
    std::string why = cause("cannot write", path, errno);
    ::unlink(temporary.c_str());
    return why;
  }
  // fsync of the folder, so that the rename reaches the disk.
  const std::size_t slash = path.rfind('/');
  const std::string folder = slash == std::string::npos ? "." : path.substr(0, slash + 1);
  if (const Descriptor dir(::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC)); dir.get() >= 0)
    ::fsync(dir.get());
  return {};
}

} // namespace terrainseg
