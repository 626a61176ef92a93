// SPDX-License-Identifier: LGPL-2.1-or-later
#include "tools/process/fingerprint.hpp"

#include <fcntl.h>
#include <glib.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <memory>

#include "tools/process/handles.hpp"

namespace terrainseg::process {
namespace {

constexpr std::uint64_t file_end = 64 * 1024; ///< bytes at each end of a recording
constexpr std::uint64_t image_end = 4 * 1024; ///< bytes at each end of an image
constexpr std::uint64_t block = 4 * 1024;
constexpr std::uint64_t blocks = 64;

using Checksum = std::unique_ptr<GChecksum, Releaser<g_checksum_free>>;

/// Adds the bytes [begin, begin + size) of a file; returns false if they cannot be read.
bool take_bytes(GChecksum* sum, int fd, std::uint64_t begin, std::uint64_t size) {
  guchar buffer[block];
  while (size > 0) {
    const ssize_t count =
        pread(fd, buffer, std::min<std::uint64_t>(size, sizeof buffer), static_cast<off_t>(begin));
    if (count < 0 && errno == EINTR)
      continue;
    if (count <= 0)
      return false;
    g_checksum_update(sum, buffer, count);
    begin += static_cast<std::uint64_t>(count);
    size -= static_cast<std::uint64_t>(count);
  }
  return true;
}

/// Adds a file's length, both ends and `middle_blocks` blocks between them. Adds its length to `total`.
bool take_file(GChecksum* sum, const std::filesystem::path& path, std::uint64_t end,
               std::uint64_t middle_blocks, std::uint64_t& total) {
  const int fd = open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK);
  if (fd < 0)
    return false;
  struct stat status;
  bool ok = fstat(fd, &status) == 0 && S_ISREG(status.st_mode);
  if (ok) {
    const auto size = static_cast<std::uint64_t>(status.st_size);
    total += size;
    const std::string length = std::to_string(size) + "\n";
    g_checksum_update(sum, reinterpret_cast<const guchar*>(length.data()),
                      static_cast<gssize>(length.size()));
    if (size <= 2 * end + middle_blocks * block) {
      ok = take_bytes(sum, fd, 0, size);
    } else {
      const std::uint64_t step = middle_blocks ? (size - 2 * end) / middle_blocks : 0;
      ok = take_bytes(sum, fd, 0, end);
      for (std::uint64_t i = 0; ok && i < middle_blocks; ++i)
        ok = take_bytes(sum, fd, end + i * step, block);
      ok = ok && take_bytes(sum, fd, size - end, end);
    }
  }
  close(fd);
  return ok;
}

Identity finish(GChecksum* sum, bool ok, std::uint64_t total) {
  return {total, ok ? g_checksum_get_string(sum) : ""};
}

} // namespace

Identity identity_of(const std::filesystem::path& file) {
  const Checksum sum(g_checksum_new(G_CHECKSUM_SHA256));
  std::uint64_t total = 0;
  const bool ok = take_file(sum.get(), file, file_end, blocks, total);
  return finish(sum.get(), ok, total);
}

Identity identity_of(const std::vector<std::filesystem::path>& images) {
  const Checksum sum(g_checksum_new(G_CHECKSUM_SHA256));
  std::uint64_t total = 0;
  bool ok = !images.empty();
  for (const auto& image : images)
    ok = ok && take_file(sum.get(), image, image_end, 0, total);
  return finish(sum.get(), ok, total);
}

} // namespace terrainseg::process
