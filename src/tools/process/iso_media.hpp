// SPDX-License-Identifier: LGPL-2.1-or-later
// MP4 and MOV: what a file promises of its video tracks, by its own tables.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <utility>
#include <vector>

namespace terrainseg::process {

/// A part of a track that its edit list shows, in the track's own time.
struct Edit {
  std::int64_t begin = 0, end = 0; ///< ticks of the media, end excluded
  std::uint64_t shown_at = 0;      ///< nanoseconds of the presentation
};

struct IsoTrack {
  unsigned id = 0;
  std::uint32_t timescale = 1;
  std::vector<std::int64_t> times;   ///< of the frames, ticks, in the order of decoding
  std::uint64_t fragment_frames = 0; ///< frames in fragments, whose times are not read
  std::vector<Edit> edits;           ///< empty: all is shown
  /// An edit begins behind the first frame or ends before the last: qtdemux 1.22 begins such an edit at a key
  /// frame in the order of decoding, and leaves frames out.
  bool trimmed = false;
  bool full_range = false; ///< a colr box says that samples have all values of 0 to 255
  bool in_order = true;    ///< edits that can be shown in one pass, at normal speed
  /// Bytes to read in place of those of the file, by position: one edit that shows all of the track.
  std::vector<std::pair<std::uint64_t, std::vector<std::uint8_t>>> untrimmed;

  /// Frames that a player shows.
  std::uint64_t shown_frames() const;
  /// True when this tool follows the edit list itself.
  bool followed_here() const { return in_order && trimmed; }
  /// When a frame of that media time is shown, in nanoseconds; nothing where an edit cuts it away.
  std::optional<std::uint64_t> shown_at(std::uint64_t media_time) const;
};

/// The video tracks; none for other containers and for files that cannot be read.
std::vector<IsoTrack> iso_video_tracks(const std::filesystem::path& file);

/// A movie box (moov) of one track whose first frame is shown at `start` nanoseconds, and whose edit ends
/// behind the last frame; mp4mux begins every file at 0 and ends its edit by the sum of the durations. What
/// follows the box in the file is expected to move by as many bytes as the box grows. The same bytes when it
/// cannot be read.
std::vector<std::uint8_t> shown_from(const std::vector<std::uint8_t>& movie, std::uint64_t start);

} // namespace terrainseg::process
