// SPDX-License-Identifier: LGPL-2.1-or-later
// Reads containers: the tables of MP4 and MOV files, which have the frames of their video tracks and when a
// player shows them, the length of these and other files, and how a camera was turned when it took a picture.
// Demuxers end a truncated file like a complete one.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <utility>
#include <vector>

namespace terrainseg::process {

/// An entry of a track's edit list: a part of the track that is shown.
struct Edit {
  std::int64_t begin = 0, end = 0; ///< in ticks of the media; `end` is exclusive
  std::uint64_t shown_at = 0;      ///< presentation time in nanoseconds
};

struct IsoTrack {
  unsigned id = 0;
  std::uint32_t timescale = 1;
  std::vector<std::int64_t> times;   ///< of the frames, in ticks, in decoding order
  std::uint64_t fragment_frames = 0; ///< number of frames in fragments; their times are not read
  std::vector<Edit> edits;           ///< empty = everything is shown
  /// An edit starts after the first frame or ends before the last. qtdemux 1.22 starts such an edit at a key
  /// frame in decoding order and drops frames.
  bool trimmed = false;
  bool full_range = false; ///< a colr box declares full range (0 to 255)
  bool in_order = true;    ///< the edits can be shown in one pass at normal speed
  /// Position and bytes that replace those of the file: one edit that shows all of the track.
  std::vector<std::pair<std::uint64_t, std::vector<std::uint8_t>>> untrimmed;

  /// Number of frames that a player shows.
  std::uint64_t shown_frames() const;
  /// True when this tool, instead of qtdemux, applies the edit list.
  bool followed_here() const { return in_order && trimmed; }
  /// Presentation time in nanoseconds of a frame with that media time; nothing when no edit shows it.
  std::optional<std::uint64_t> shown_at(std::uint64_t media_time) const;
};

/// The video tracks of a file; none for other containers and for files that cannot be read.
std::vector<IsoTrack> iso_video_tracks(const std::filesystem::path& file);

/// Changes a movie box (moov) of one track: the first frame is shown at `start` nanoseconds, and the edit
/// ends after the last frame. (mp4mux starts every file at 0 and ends the edit by the sum of the durations.)
/// The data after the box moves by the number of bytes that the box grows. Returns the box unchanged when it
/// cannot be read.
std::vector<std::uint8_t> shown_from(const std::vector<std::uint8_t>& movie, std::uint64_t start);

/// Returns the number of bytes that the file must have according to its size fields, if it has fewer. Reads
/// ISO base media (MP4, MOV), RIFF (AVI) and Matroska (MKV, WebM). Returns nothing for other containers,
/// complete files and unreadable files.
std::optional<std::uint64_t> missing_length(const std::filesystem::path& file);

/// Whether the container's header has the exact duration: AVI, Matroska, FLV.
bool tells_duration(const std::filesystem::path& file);

/// Whether a GIF does not end with the trailer byte. A GIF has no duration, but a defined end.
bool lacks_end_mark(const std::filesystem::path& file);

/// The EXIF orientation of a JPEG, PNG, WebP or TIFF file, 1 to 8; 1 (upright) where it has none.
int exif_orientation(std::span<const std::uint8_t> file);

/// The value of GStreamer's tag `image-orientation` for it.
const char* orientation_tag(int orientation);

} // namespace terrainseg::process
