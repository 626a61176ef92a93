// SPDX-License-Identifier: LGPL-2.1-or-later
// The precision time of a frame: MISB ST 0604 in the video, item 2 of ST 0903 in its KLV unit. Units are
// matched to frames by it even if transport time stamps are shifted.
#pragma once

#include <gst/gst.h>
#include <gst/video/video.h>

#include <cstdint>
#include <optional>

#include "exchange/precision_stamp.hpp"
#include "support/times.hpp"

namespace terrainseg {

inline std::optional<std::uint64_t> time_in(const GstMeta* meta) {
  const auto* message = reinterpret_cast<const GstVideoSEIUserDataUnregisteredMeta*>(meta);
  if (!message->data)
    return std::nullopt;
  return stamp_time(message->uuid, {message->data, message->size});
}

inline gboolean remove_stamp(GstBuffer*, GstMeta** meta, gpointer) {
  if ((*meta)->info->api == GST_VIDEO_SEI_USER_DATA_UNREGISTERED_META_API_TYPE && time_in(*meta))
    *meta = nullptr;
  return TRUE;
}

/// The stamp that parsers and decoders attached (GstVideoSEIUserDataUnregisteredMeta), microseconds. Nothing
/// if there is none, or if there are several different ones: a lossy link then merged two pictures.
inline std::optional<std::uint64_t> stamp_of(GstBuffer* buffer) {
  std::optional<std::uint64_t> stamp;
  gpointer state = nullptr;
  while (const GstMeta* meta = gst_buffer_iterate_meta_filtered(
             buffer, &state, GST_VIDEO_SEI_USER_DATA_UNREGISTERED_META_API_TYPE))
    if (const auto time = time_in(meta)) {
      if (stamp && *stamp != *time)
        return std::nullopt;
      stamp = time;
    }
  return stamp;
}

/// Attaches the stamp to a buffer (writable) as parsers do; decoders copy it to their frames.
inline void note_stamp(GstBuffer* buffer, VideoCodec codec, std::uint64_t time_us) {
  StampIdentifier identifier = microseconds_identifier(codec);
  StampContent content = stamp_content(time_us);
  gst_buffer_add_video_sei_user_data_unregistered_meta(buffer, identifier.data(), content.data(),
                                                       content.size());
}

/// Removes all stamps from a buffer (writable); keeps other SEI messages.
inline void forget_stamps(GstBuffer* buffer) {
  gst_buffer_foreach_meta(buffer, remove_stamp, nullptr);
}

/// Microseconds since 1970 if upstream gives the time of day, otherwise the stream time, which makes runs
/// repeatable: encoders that shift time stamps shift the segment too, so the stream time stays the same. The
/// PTS if the segment has no stream time; nothing without a PTS.
inline std::optional<std::uint64_t> time_of_frame(GstBuffer* buffer, const GstSegment& segment) {
  if (const auto utc = utc_of(buffer))
    return *utc / 1000;
  if (!GST_BUFFER_PTS_IS_VALID(buffer))
    return std::nullopt;
  const GstClockTime time = stream_time_of(segment, GST_BUFFER_PTS(buffer));
  return (GST_CLOCK_TIME_IS_VALID(time) ? time : GST_BUFFER_PTS(buffer)) / 1000;
}

/// The stamp in the video if there is one, otherwise the time of the frame.
inline std::optional<std::uint64_t> precision_time(GstBuffer* buffer, const GstSegment& segment) {
  const auto stamp = stamp_of(buffer);
  return stamp ? stamp : time_of_frame(buffer, segment);
}

} // namespace terrainseg
