// SPDX-License-Identifier: LGPL-2.1-or-later
#include "tools/process/container.hpp"

#include <gst/gst.h>

#include <algorithm>
#include <bit>
#include <cstring>
#include <fstream>
#include <string>
#include <string_view>

namespace terrainseg::process {
namespace {

constexpr std::uint64_t longest_index = 256 << 20; ///< bytes of a moov or moof box

using Field = std::vector<std::uint8_t>;
using Content = std::span<const std::uint8_t>;

bool begins(Content bytes, std::string_view text) {
  return bytes.size() >= text.size() && std::memcmp(bytes.data(), text.data(), text.size()) == 0;
}

/// `count` bytes from `at` on; 0 past the end.
std::uint64_t number(Content bytes, std::size_t at, std::size_t count, bool little = false) {
  std::uint64_t value = 0;
  if (at > bytes.size() || bytes.size() - at < count)
    return 0;
  for (std::size_t i = 0; i < count; ++i)
    value = value << 8 | bytes[at + (little ? count - 1 - i : i)];
  return value;
}

/// Reads the bytes of a box in order; returns zeros past the end.
class Bytes {
 public:
  /// `position` in the file is that of the first byte.
  Bytes(Content content, std::uint64_t position) : rest_(content), position_(position) {}
  std::uint64_t number(std::size_t bytes) {
    const std::uint64_t value = process::number(rest_, 0, bytes);
    skip(bytes);
    return value;
  }
  std::int32_t signed32() { return static_cast<std::int32_t>(number(4)); }
  void skip(std::size_t bytes) {
    bytes = std::min(bytes, rest_.size());
    rest_ = rest_.subspan(bytes);
    position_ += bytes;
  }
  Content rest() const { return rest_; }
  std::uint64_t position() const { return position_; }

 private:
  Content rest_;
  std::uint64_t position_;
};

/// Calls `visit` with type and content of each box in `content`. Stops at bytes that are not a box.
template <typename Visit> void each_box(Bytes content, const Visit& visit) {
  while (content.rest().size() >= 8) {
    const Bytes begin = content;
    std::uint64_t length = content.number(4);
    const Content letters = content.rest().first(4);
    const std::string type(letters.begin(), letters.end());
    content.skip(4);
    if (length == 1)
      length = content.number(8);
    else if (length == 0)
      length = begin.rest().size();
    const std::uint64_t head = content.position() - begin.position();
    if (length < head || length > begin.rest().size())
      return;
    const Content inside = content.rest().first(static_cast<std::size_t>(length - head));
    visit(type, Bytes(inside, content.position()));
    content.skip(inside.size());
  }
}

/// The tables of one trak box as they are in the file.
struct Tables {
  IsoTrack track;
  bool video = false;
  std::vector<std::pair<std::uint64_t, std::uint32_t>> durations; ///< frames, ticks
  std::vector<std::pair<std::uint64_t, std::int32_t>> offsets;    ///< frames, ticks
  struct Entry {
    std::uint64_t duration; ///< of the movie's timescale
    std::int64_t begin;     ///< -1 = nothing is shown
    std::uint32_t rate;     ///< 16.16
  };
  std::vector<Entry> entries;
  std::uint64_t list_at = 0; ///< position of the number of entries
  bool wide = false;         ///< 64-bit entries
};

template <typename Value> void read_runs(Bytes bytes, std::vector<std::pair<std::uint64_t, Value>>& runs) {
  bytes.skip(4);
  for (std::uint64_t left = bytes.number(4); left > 0 && !bytes.rest().empty(); --left) {
    const std::uint64_t count = bytes.number(4);
    runs.emplace_back(count, static_cast<Value>(bytes.signed32()));
  }
}

void read_edit_list(Bytes bytes, Tables& tables) {
  const bool wide = tables.wide = bytes.number(4) >> 24 == 1;
  tables.list_at = bytes.position();
  for (std::uint64_t left = bytes.number(4); left > 0 && !bytes.rest().empty(); --left) {
    Tables::Entry entry{};
    entry.duration = bytes.number(wide ? 8 : 4);
    entry.begin = wide ? static_cast<std::int64_t>(bytes.number(8)) : bytes.signed32();
    entry.rate = static_cast<std::uint32_t>(bytes.number(4));
    tables.entries.push_back(entry);
  }
}

/// Each sample entry is a box that begins with 78 bytes of fields.
void read_sample_entries(Bytes bytes, IsoTrack& track) {
  bytes.skip(8);
  each_box(bytes, [&track](const std::string&, Bytes entry) {
    entry.skip(78);
    each_box(entry, [&track](const std::string& type, Bytes box) {
      if (type != "colr" || box.number(4) != 0x6e636c78) // "nclx"
        return;
      box.skip(6);
      track.full_range = box.number(1) >> 7 != 0;
    });
  });
}

void read_track(const Bytes& content, Tables& tables) {
  each_box(content, [&tables](const std::string& type, Bytes box) {
    if (type == "edts" || type == "mdia" || type == "minf" || type == "stbl") {
      read_track(box, tables);
    } else if (type == "tkhd" || type == "mdhd") {
      const bool wide = box.number(4) >> 24 == 1;
      box.skip(wide ? 16 : 8);
      const auto value = static_cast<std::uint32_t>(box.number(4));
      if (type == "tkhd")
        tables.track.id = value;
      else
        tables.track.timescale = std::max(1u, value);
    } else if (type == "hdlr") {
      box.skip(8);
      tables.video = tables.video || box.number(4) == 0x76696465; // "vide"
    } else if (type == "stsd") {
      read_sample_entries(box, tables.track);
    } else if (type == "stts") {
      read_runs(box, tables.durations);
    } else if (type == "ctts") {
      read_runs(box, tables.offsets);
    } else if (type == "elst") {
      read_edit_list(box, tables);
    }
  });
}

Field joined(std::initializer_list<Field> fields) {
  Field all;
  for (const Field& field : fields)
    all.insert(all.end(), field.begin(), field.end());
  return all;
}

Field field_of(std::uint64_t value, int bytes) {
  Field out;
  for (int i = bytes - 1; i >= 0; --i)
    out.push_back(static_cast<std::uint8_t>(value >> 8 * i));
  return out;
}

Field boxed(const std::string& type, const Field& content) {
  return joined({field_of(8 + content.size(), 4), {type.begin(), type.end()}, content});
}

/// Units of a movie box, and the position of its duration.
struct Movie {
  std::uint64_t timescale = 1, duration_at = 0;
  int width = 4; ///< bytes of the duration
};

/// Time from `first` to the end of the last frame, in the movie's timescale.
std::uint64_t media_length(const Tables& tables, std::uint64_t timescale, std::int64_t first) {
  const std::vector<std::int64_t>& times = tables.track.times;
  const std::int64_t last = times.empty() ? 0 : std::ranges::max(times);
  const std::uint64_t ticks = static_cast<std::uint64_t>(std::max<std::int64_t>(last - first, 0)) +
                              (tables.durations.empty() ? 0 : tables.durations.back().second);
  return gst_util_uint64_scale_ceil(ticks, timescale, tables.track.timescale);
}

/// Computes the times of all frames. Like qtdemux, moves them so that negative offsets give no negative time.
void put_together(Tables& tables, const Movie& movie) {
  constexpr std::uint64_t most = 1 << 28;
  IsoTrack& track = tables.track;
  std::int64_t time = 0;
  for (const auto& [count, ticks] : tables.durations)
    for (std::uint64_t i = 0; i < count && track.times.size() < most; ++i, time += ticks)
      track.times.push_back(time);
  std::size_t at = 0;
  std::int64_t least = 0;
  for (const auto& [count, offset] : tables.offsets)
    least = std::min<std::int64_t>(least, offset);
  for (const auto& [count, offset] : tables.offsets)
    for (std::uint64_t i = 0; i < count && at < track.times.size(); ++i)
      track.times[at++] += offset;
  std::uint64_t shown = 0;
  for (const auto& entry : tables.entries) {
    const std::uint64_t length = gst_util_uint64_scale(entry.duration, GST_SECOND, movie.timescale);
    const auto ticks = static_cast<std::int64_t>(
        gst_util_uint64_scale_round(entry.duration, track.timescale, movie.timescale));
    if (entry.begin >= 0) {
      const bool rest = entry.duration == 0; // in a file written in fragments: up to its end
      track.edits.push_back({entry.begin, rest ? INT64_MAX : entry.begin + ticks, shown});
      const std::size_t count = track.edits.size();
      track.in_order =
          track.in_order && entry.rate == 1 << 16 && (count < 2 || track.edits[count - 2].end <= entry.begin);
    }
    shown += length;
  }
  track.in_order = track.in_order && least == 0;
  if (tables.list_at == 0)
    return;
  // One edit that shows everything, from the first tick to the end of the last frame.
  const std::uint64_t length = media_length(tables, movie.timescale, 0) + 1;
  const int width = tables.wide ? 8 : 4;
  track.untrimmed = {{tables.list_at, joined({field_of(1, 4), field_of(length, width), field_of(0, width),
                                              field_of(1 << 16, 4)})},
                     {movie.duration_at, field_of(length, movie.width)}};
}

/// Reads bytes of the file; zeros past its end.
Field load(std::ifstream& file, std::uint64_t begin, std::uint64_t length) {
  Field bytes(static_cast<std::size_t>(length));
  file.clear();
  file.seekg(static_cast<std::streamoff>(begin));
  file.read(reinterpret_cast<char*>(bytes.data()), static_cast<std::streamsize>(length));
  return bytes;
}

/// The longest beginning that tells a container or has the length of a box.
Field head_at(std::ifstream& file, std::uint64_t position) {
  return load(file, position, 16);
}

/// Calls `visit` with the tables of each video track and with its movie.
template <typename Visit> void each_video(const Bytes& content, const Visit& visit) {
  Movie movie;
  each_box(content, [&](const std::string& type, Bytes box) {
    if (type == "mvhd") {
      const bool wide = box.number(4) >> 24 == 1;
      box.skip(wide ? 16 : 8);
      movie.timescale = std::max<std::uint64_t>(1, box.number(4));
      movie.duration_at = box.position();
      movie.width = wide ? 8 : 4;
    } else if (type == "trak") {
      Tables tables;
      read_track(box, tables);
      if (!tables.video)
        return;
      put_together(tables, movie);
      visit(tables, movie);
    }
  });
}

/// Changes to a movie box.
struct Change {
  std::uint64_t length = 0; ///< duration of the presentation, in the movie's timescale
  Field edits;              ///< an edts box
  std::uint64_t shift = 0;  ///< bytes by which the data after the movie box moves
};

void put(Field& bytes, std::size_t at, std::uint64_t value, int width) {
  const Field field = field_of(value, width);
  if (at + field.size() <= bytes.size())
    std::copy(field.begin(), field.end(), bytes.begin() + static_cast<std::ptrdiff_t>(at));
}

/// Returns the boxes in `content` with the changes applied.
Field changed(const Bytes& content, const Change& change) {
  Field out;
  each_box(content, [&](const std::string& type, Bytes box) {
    if (type == "edts")
      return;
    if (type == "mdia")
      out = joined({out, change.edits});
    Field inside(box.rest().begin(), box.rest().end());
    const bool wide = number(inside, 0, 1) == 1;
    if (type == "moov" || type == "trak" || type == "mdia" || type == "minf" || type == "stbl")
      inside = changed(box, change);
    else if (type == "mvhd")
      put(inside, wide ? 24 : 16, change.length, wide ? 8 : 4);
    else if (type == "tkhd")
      put(inside, wide ? 28 : 20, change.length, wide ? 8 : 4);
    const int width = type == "stco" ? 4 : type == "co64" ? 8 : 0; // tables of the frames' positions
    for (std::size_t at = 8; width > 0 && at + width <= inside.size(); at += width)
      put(inside, at, number(inside, at, width) + change.shift, width);
    out = joined({out, boxed(type, inside)});
  });
  return out;
}

/// Counts the frames of a fragment in their tracks.
void read_fragment(const Bytes& content, std::vector<IsoTrack>& tracks) {
  each_box(content, [&tracks](const std::string& type, Bytes fragment) {
    if (type != "traf")
      return;
    unsigned id = 0;
    each_box(fragment, [&](const std::string& part, Bytes box) {
      box.skip(4);
      const std::uint64_t value = box.number(4);
      if (part == "tfhd")
        id = static_cast<unsigned>(value);
      for (IsoTrack& track : tracks)
        if (part == "trun" && track.id == id)
          track.fragment_frames += value;
    });
  });
}

/// Calls `visit` with type, position and length of each top-level box. Returns the end of the last one.
template <typename Visit>
std::uint64_t each_top_box(std::ifstream& file, std::uint64_t size, const Visit& visit) {
  std::uint64_t position = 0;
  while (position + 8 <= size) {
    const Field box = head_at(file, position);
    if (!std::all_of(&box[4], &box[8], [](char letter) { return g_ascii_isprint(letter); }))
      break;
    std::uint64_t length = number(box, 0, 4);
    if (length == 0) // extends to the end of the file
      return size;
    if (length == 1)
      length = number(box, 8, 8);
    if (length < 8 || length > UINT64_MAX - position)
      break;
    visit(std::string(&box[4], &box[8]), position, length);
    position += length;
  }
  return position;
}

/// RIFF chunks; recordings of more than a gigabyte have several.
std::uint64_t riff_end(std::ifstream& file, std::uint64_t size) {
  std::uint64_t position = 0;
  while (position + 12 <= size) {
    const Field chunk = head_at(file, position);
    if (!begins(chunk, "RIFF"))
      break;
    const std::uint64_t length = number(chunk, 4, 4, true);
    if (length == 0 || length == 0xffffffff) // not finished by the recorder
      return size;
    position += 8 + length;
  }
  return position;
}

/// Position after the EBML element at `position`; `size` if its length is unknown or invalid.
std::uint64_t ebml_end(std::ifstream& file, std::uint64_t position, std::uint64_t size) {
  const Field head = head_at(file, position);
  const int length = std::countl_zero(head[4]) + 1; // bytes of the number that follows
  if (length > 8)
    return size;
  const std::uint64_t unknown = (std::uint64_t{1} << (7 * length)) - 1;
  const std::uint64_t payload = number(head, 4, length) & unknown;
  return payload == unknown ? size : position + 4 + static_cast<unsigned>(length) + payload;
}

std::uint64_t matroska_end(std::ifstream& file, std::uint64_t size) {
  const std::uint64_t segment = ebml_end(file, 0, size);
  if (segment + 12 > size)
    return segment;
  const Field head = head_at(file, segment);
  return number(head, 0, 4) == 0x18538067 ? ebml_end(file, segment, size) : size;
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
    const std::size_t marker = file[at + 1], length = number(file, at + 2, 2);
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

std::uint64_t IsoTrack::shown_frames() const {
  if (edits.empty())
    return times.size() + fragment_frames;
  std::uint64_t count = fragment_frames;
  for (const Edit& edit : edits)
    for (const std::int64_t time : times)
      count += time >= edit.begin && time < edit.end;
  return count;
}

std::optional<std::uint64_t> IsoTrack::shown_at(std::uint64_t media_time) const {
  const auto ticks =
      static_cast<std::int64_t>(gst_util_uint64_scale_round(media_time, timescale, GST_SECOND));
  for (const Edit& edit : edits)
    if (ticks >= edit.begin && ticks < edit.end)
      return edit.shown_at + gst_util_uint64_scale_round(static_cast<std::uint64_t>(ticks - edit.begin),
                                                         GST_SECOND, timescale);
  return std::nullopt;
}

Field shown_from(const Field& movie, std::uint64_t start) {
  const Bytes all(movie, 0);
  Change change;
  const auto show = [&change, start](const Tables& tables, const Movie& of) {
    const IsoTrack& track = tables.track;
    if (track.times.empty())
      return;
    const std::int64_t first = std::ranges::min(track.times);
    const std::uint64_t length = media_length(tables, of.timescale, first),
                        gap = gst_util_uint64_scale_round(start, of.timescale, GST_SECOND);
    const auto edit = [](std::uint64_t duration, std::int64_t begin) {
      return joined(
          {field_of(duration, 8), field_of(static_cast<std::uint64_t>(begin), 8), field_of(1 << 16, 4)});
    };
    const Field edits = joined({gap > 0 ? edit(gap, -1) : Field(), edit(length, first)});
    constexpr std::uint64_t edit_bytes = 20, wide = 1 << 24; // 64-bit times
    const Field list = joined({field_of(wide, 4), field_of(edits.size() / edit_bytes, 4), edits});
    change = {gap + length, boxed("edts", boxed("elst", list)), 0};
  };
  each_box(all, [&show](const std::string&, const Bytes& box) { each_video(box, show); });
  if (change.edits.empty())
    return movie;
  change.shift = changed(all, change).size() - movie.size();
  return changed(all, change);
}

std::vector<IsoTrack> iso_video_tracks(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  std::error_code error;
  const std::uint64_t size = std::filesystem::file_size(path, error);
  std::vector<IsoTrack> tracks;
  if (error || !file)
    return tracks;
  each_top_box(file, size, [&](const std::string& type, std::uint64_t position, std::uint64_t length) {
    if ((type != "moov" && type != "moof") || length > std::min(longest_index, size - position))
      return;
    const auto take = [&tracks](Tables& tables, const Movie&) { tracks.push_back(std::move(tables.track)); };
    const Field box = load(file, position, length);
    each_box(Bytes(box, position), [&](const std::string&, const Bytes& content) {
      type == "moof" ? read_fragment(content, tracks) : each_video(content, take);
    });
  });
  for (IsoTrack& track : tracks)
    track.trimmed =
        !track.edits.empty() && track.fragment_frames == 0 && track.shown_frames() < track.times.size();
  return tracks;
}

std::optional<std::uint64_t> missing_length(const std::filesystem::path& path) {
  std::error_code error;
  const std::uint64_t size = std::filesystem::file_size(path, error);
  std::ifstream file(path, std::ios::binary);
  if (error || !file || size < 16)
    return std::nullopt;
  const Field head = head_at(file, 0);
  std::uint64_t end = size;
  if (begins(Content(head).subspan(4), "ftyp"))
    end = each_top_box(file, size, [](const auto&...) {});
  else if (begins(head, "RIFF"))
    end = riff_end(file, size);
  else if (number(head, 0, 4) == 0x1a45dfa3)
    end = matroska_end(file, size);
  return end > size ? std::optional(end) : std::nullopt;
}

bool tells_duration(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  const Field head = head_at(file, 0);
  return (begins(head, "RIFF") && begins(Content(head).subspan(8), "AVI ")) ||
         number(head, 0, 4) == 0x1a45dfa3 || begins(head, "FLV\x01");
}

bool lacks_end_mark(const std::filesystem::path& path) {
  constexpr char end_mark = 0x3b;
  std::ifstream file(path, std::ios::binary);
  const Field head = head_at(file, 0);
  if (!begins(head, "GIF8"))
    return false;
  file.clear();
  file.seekg(-1, std::ios::end);
  return file.get() != end_mark;
}

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
