// SPDX-License-Identifier: LGPL-2.1-or-later
#include "tools/process/exif.hpp"

#include <cstddef>
#include <cstring>
#include <string_view>

namespace terrainseg::process {
namespace {

using Content = std::span<const std::uint8_t>;

bool begins(Content bytes, std::string_view text) {
  return bytes.size() >= text.size() && std::memcmp(bytes.data(), text.data(), text.size()) == 0;
}

/// `count` bytes from `at` on; 0 past the end.
std::size_t number(Content bytes, std::size_t at, std::size_t count, bool little) {
  std::size_t value = 0;
  if (at > bytes.size() || bytes.size() - at < count)
    return 0;
  for (std::size_t i = 0; i < count; ++i)
    value = value << 8 | bytes[at + (little ? count - 1 - i : i)];
  return value;
}

/// Of a TIFF structure, which EXIF data is: the orientation in its first directory.
int orientation_in(Content tiff) {
  const bool little = begins(tiff, std::string_view("II*\0", 4));
  if (!little && !begins(tiff, std::string_view("MM\0*", 4)))
    return 1;
  constexpr std::size_t entry_bytes = 12, orientation = 0x112;
  const std::size_t directory = number(tiff, 4, 4, little), entries = number(tiff, directory, 2, little);
  for (std::size_t i = 0; i < entries; ++i) {
    const std::size_t entry = directory + 2 + i * entry_bytes;
    if (number(tiff, entry, 2, little) != orientation)
      continue;
    const std::size_t value = number(tiff, entry + 8, 2, little);
    return value >= 1 && value <= 8 ? static_cast<int>(value) : 1;
  }
  return 1;
}

// The EXIF data in a file; empty when there is none.

Content exif_in_jpeg(Content file) {
  constexpr std::string_view name("Exif\0\0", 6);
  for (std::size_t at = 2; at + 4 <= file.size() && file[at] == 0xff;) {
    const std::size_t marker = file[at + 1], length = number(file, at + 2, 2, false);
    if (marker == 0xff) { // fills up
      ++at;
      continue;
    }
    if (marker == 0xda || length < 2 || length > file.size() - at - 2)
      break;
    const Content content = file.subspan(at + 4, length - 2);
    if (marker == 0xe1 && begins(content, name))
      return content.subspan(name.size());
    at += 2 + length;
  }
  return {};
}

/// In chunks: of PNG a length, a type, the data and a check sum; of WebP a type, a length and padded data.
Content exif_in_chunks(Content file, bool webp) {
  const std::size_t extra = webp ? 8 : 12;
  for (std::size_t at = webp ? 12 : 8; at + extra <= file.size();) {
    const std::size_t length = number(file, webp ? at + 4 : at, 4, webp);
    if (length > file.size() - at - extra)
      break;
    if (begins(file.subspan(webp ? at : at + 4), webp ? "EXIF" : "eXIf"))
      return file.subspan(at + 8, length);
    at += extra + length + (webp ? length & 1 : 0);
  }
  return {};
}

} // namespace

int exif_orientation(Content file) {
  if (begins(file, "\xff\xd8"))
    return orientation_in(exif_in_jpeg(file));
  if (begins(file, "\x89PNG"))
    return orientation_in(exif_in_chunks(file, false));
  if (begins(file, "RIFF") && file.size() > 12 && begins(file.subspan(8), "WEBP"))
    return orientation_in(exif_in_chunks(file, true));
  return orientation_in(file);
}

const char* orientation_tag(int orientation) {
  constexpr const char* tags[] = {"rotate-0",        "flip-rotate-0", "rotate-180",     "flip-rotate-180",
                                  "flip-rotate-270", "rotate-90",     "flip-rotate-90", "rotate-270"};
  return tags[orientation - 1];
}

} // namespace terrainseg::process
