// SPDX-License-Identifier: LGPL-2.1-or-later
#include "tools/process/container.hpp"

#include <gst/gst.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cstring>
#include <fstream>

namespace terrainseg::process {
namespace {

using Head = std::array<unsigned char, 16>;

/// 16 bytes from `position`, zeros past the end.
Head head_at(std::ifstream& file, std::uint64_t position) {
  Head head{};
  file.clear();
  file.seekg(static_cast<std::streamoff>(position));
  file.read(reinterpret_cast<char*>(head.data()), head.size());
  return head;
}

bool is_tag(const unsigned char* bytes, const char* tag) {
  return std::memcmp(bytes, tag, 4) == 0;
}

/// Consecutive top-level boxes.
std::uint64_t iso_media_end(std::ifstream& file, std::uint64_t size) {
  std::uint64_t position = 0;
  while (position + 8 <= size) {
    const Head box = head_at(file, position);
    if (!std::all_of(&box[4], &box[8], [](char letter) { return g_ascii_isprint(letter); }))
      break;
    std::uint64_t length = GST_READ_UINT32_BE(&box[0]);
    if (length == 0) // extends to the end of the file
      return size;
    if (length == 1)
      length = GST_READ_UINT64_BE(&box[8]);
    if (length < 8 || length > UINT64_MAX - position)
      break;
    position += length;
  }
  return position;
}

/// RIFF chunks; recordings of more than a gigabyte have several.
std::uint64_t riff_end(std::ifstream& file, std::uint64_t size) {
  std::uint64_t position = 0;
  while (position + 12 <= size) {
    const Head chunk = head_at(file, position);
    if (!is_tag(&chunk[0], "RIFF"))
      break;
    const std::uint64_t length = GST_READ_UINT32_LE(&chunk[4]);
    if (length == 0 || length == 0xffffffff) // not finished by the recorder
      return size;
    position += 8 + length;
  }
  return position;
}

/// Position after the EBML element at `position`; `size` if its length is unknown or invalid.
std::uint64_t ebml_end(std::ifstream& file, std::uint64_t position, std::uint64_t size) {
  const Head head = head_at(file, position);
  const int length = std::countl_zero(head[4]) + 1; // bytes of the number that follows
  if (length > 8)
    return size;
  const std::uint64_t unknown = (std::uint64_t{1} << (7 * length)) - 1;
  const std::uint64_t payload = GST_READ_UINT64_BE(&head[4]) >> (64 - 8 * length) & unknown;
  return payload == unknown ? size : position + 4 + static_cast<unsigned>(length) + payload;
}

std::uint64_t matroska_end(std::ifstream& file, std::uint64_t size) {
  const std::uint64_t segment = ebml_end(file, 0, size);
  if (segment + 12 > size)
    return segment;
  const Head head = head_at(file, segment);
  return GST_READ_UINT32_BE(&head[0]) == 0x18538067 ? ebml_end(file, segment, size) : size;
}

} // namespace

std::optional<std::uint64_t> missing_length(const std::filesystem::path& path) {
  std::error_code error;
  const std::uint64_t size = std::filesystem::file_size(path, error);
  std::ifstream file(path, std::ios::binary);
  if (error || !file || size < 16)
    return std::nullopt;
  const Head head = head_at(file, 0);
  std::uint64_t end = size;
  if (is_tag(&head[4], "ftyp"))
    end = iso_media_end(file, size);
  else if (is_tag(&head[0], "RIFF"))
    end = riff_end(file, size);
  else if (GST_READ_UINT32_BE(&head[0]) == 0x1a45dfa3)
    end = matroska_end(file, size);
  return end > size ? std::optional(end) : std::nullopt;
}

bool tells_duration(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  const Head head = head_at(file, 0);
  return (is_tag(&head[0], "RIFF") && is_tag(&head[8], "AVI ")) ||
         GST_READ_UINT32_BE(&head[0]) == 0x1a45dfa3 || is_tag(&head[0], "FLV\x01");
}

bool lacks_end_mark(const std::filesystem::path& path) {
  constexpr char end_mark = 0x3b;
  std::ifstream file(path, std::ios::binary);
  const Head head = head_at(file, 0);
  if (!is_tag(&head[0], "GIF8"))
    return false;
  file.clear();
  file.seekg(-1, std::ios::end);
  return file.get() != end_mark;
}

} // namespace terrainseg::process
