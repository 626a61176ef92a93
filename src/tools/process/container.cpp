// SPDX-License-Identifier: LGPL-2.1-or-later
#include "tools/process/container.hpp"

#include <array>
#include <cstring>
#include <fstream>

namespace terrainseg::process {
namespace {

using Head = std::array<unsigned char, 16>;

std::uint64_t big_endian(const unsigned char* bytes, int count) {
  std::uint64_t value = 0;
  for (int i = 0; i < count; ++i)
    value = value << 8 | bytes[i];
  return value;
}

std::uint64_t little_endian32(const unsigned char* bytes) {
  return bytes[0] | bytes[1] << 8 | bytes[2] << 16 | std::uint64_t{bytes[3]} << 24;
}

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

bool is_printable(const unsigned char* bytes) {
  for (int i = 0; i < 4; ++i)
    if (bytes[i] < 0x20 || bytes[i] > 0x7e)
      return false;
  return true;
}

/// Consecutive top-level boxes.
std::uint64_t iso_media_end(std::ifstream& file, std::uint64_t size) {
  std::uint64_t position = 0;
  while (position + 8 <= size) {
    const Head box = head_at(file, position);
    if (!is_printable(&box[4]))
      break;
    std::uint64_t length = big_endian(&box[0], 4);
    if (length == 0) // extends to the end of the file
      return size;
    if (length == 1)
      length = big_endian(&box[8], 8);
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
    const std::uint64_t length = little_endian32(&chunk[4]);
    if (length == 0 || length == 0xffffffff) // not finished by the recorder
      return size;
    position += 8 + length;
  }
  return position;
}

/// Length of an EBML number from its first byte, 0 = invalid.
int ebml_length(unsigned char first) {
  for (int length = 1; length <= 8; ++length)
    if (first & (0x100 >> length))
      return length;
  return 0;
}

/// Position after the EBML element at `position`; `size` if its length is unknown or invalid.
std::uint64_t ebml_end(std::ifstream& file, std::uint64_t position, std::uint64_t size) {
  const Head head = head_at(file, position);
  const int length = ebml_length(head[4]);
  if (length == 0)
    return size;
  const std::uint64_t unknown = (std::uint64_t{1} << (7 * length)) - 1;
  const std::uint64_t payload = big_endian(&head[4], length) & unknown;
  return payload == unknown ? size : position + 4 + static_cast<unsigned>(length) + payload;
}

std::uint64_t matroska_end(std::ifstream& file, std::uint64_t size) {
  const std::uint64_t segment = ebml_end(file, 0, size);
  if (segment + 12 > size)
    return segment;
  const Head head = head_at(file, segment);
  return big_endian(&head[0], 4) == 0x18538067 ? ebml_end(file, segment, size) : size;
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
  else if (big_endian(&head[0], 4) == 0x1a45dfa3)
    end = matroska_end(file, size);
  if (end > size)
    return end;
  return std::nullopt;
}

bool tells_duration(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  const Head head = head_at(file, 0);
  return (is_tag(&head[0], "RIFF") && is_tag(&head[8], "AVI ")) || big_endian(&head[0], 4) == 0x1a45dfa3 ||
         is_tag(&head[0], "FLV\x01");
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
