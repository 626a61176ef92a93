// SPDX-License-Identifier: LGPL-2.1-or-later
// Times of a frame: in a segment that a peer sends and that may have any values; the time of day: a
// GstReferenceTimestampMeta of cameras, RTP or NTP, or the start time of a recording; and the precision time:
// MISB ST 0604 in the video, item 2 of ST 0903 in its KLV unit. Units are matched to frames by it even if
// transport time stamps are shifted.
#pragma once

#include <gst/gst.h>
#include <gst/terrainseg/terrainsegmeta.h>
#include <gst/video/video.h>

#include <charconv>
#include <cstdint>
#include <optional>
#include <string>

#include "exchange/precision_stamp.hpp"

namespace terrainseg {

/// A segment in time that no peer has sent yet.
inline GstSegment in_time() noexcept {
  GstSegment segment;
  gst_segment_init(&segment, GST_FORMAT_TIME);
  return segment;
}

/// GST_CLOCK_TIME_NONE if the segment is in bytes or frames, which have no stream time.
inline GstClockTime stream_time_of(const GstSegment& segment, GstClockTime timestamp) {
  return segment.format == GST_FORMAT_TIME ? gst_segment_to_stream_time(&segment, GST_FORMAT_TIME, timestamp)
                                           : GST_CLOCK_TIME_NONE;
}

/// Whether positions have a running time. They have none with a negative rate and no stop; GStreamer logs a
/// critical in that case.
inline bool has_running_time(const GstSegment& segment) {
  return segment.format == GST_FORMAT_TIME && (segment.rate > 0 || GST_CLOCK_TIME_IS_VALID(segment.stop));
}

/// GST_CLOCK_TIME_NONE if there is none, or if it does not fit into a signed number.
inline GstClockTime running_time_of(const GstSegment& segment, GstClockTime timestamp) {
  const GstClockTime time = has_running_time(segment)
                                ? gst_segment_to_running_time(&segment, GST_FORMAT_TIME, timestamp)
                                : GST_CLOCK_TIME_NONE;
  return time <= static_cast<GstClockTime>(G_MAXINT64) ? time : GST_CLOCK_TIME_NONE;
}

inline void note_utc(GstBuffer* buffer, GstClockTime time) {
  static GstStaticCaps unix_time = GST_STATIC_CAPS("timestamp/x-unix");
  g_autoptr(GstCaps) caps = gst_static_caps_get(&unix_time);
  gst_buffer_add_reference_timestamp_meta(buffer, caps, time, GST_BUFFER_DURATION(buffer));
}

/// Nanoseconds since 1970 from a meta with the reference `timestamp/x-unix` or `timestamp/x-ntp`; nothing
/// without one.
inline std::optional<GstClockTime> utc_of(GstBuffer* buffer) {
  const GstClockTime time = gst_buffer_get_terrain_utc(buffer);
  return GST_CLOCK_TIME_IS_VALID(time) ? std::optional(time) : std::nullopt;
}

/// Parses `2026-11-21T20:00:00.5Z` (ISO 8601; UTC without a zone) or an integer of nanoseconds since 1970. On
/// an error it returns nothing and sets `error` to the valid forms.
inline std::optional<GstClockTime> parse_start_time(const std::string& text, std::string& error) {
  guint64 nanoseconds = 0;
  const auto [end, status] = std::from_chars(text.data(), text.data() + text.size(), nanoseconds);
  const bool whole = end == text.data() + text.size() && !text.empty();
  constexpr GstClockTime latest = G_MAXINT64; // 2262: sums of times do not overflow
  // Current times in seconds, milliseconds or microseconds, read as nanoseconds, would be before 1973.
  constexpr GstClockTime least = 100'000'000 * GST_SECOND;
  if (whole && status == std::errc{} && nanoseconds > 0 && nanoseconds < least) {
    error = "a number is nanoseconds since 1970, and " + text +
            " lies before 1973; expected is ISO 8601, as 2026-11-21T20:00:00Z, or 19 digits, as `date +%s%N` "
            "prints";
    return std::nullopt;
  }
  if (whole && status == std::errc{} && nanoseconds <= latest)
    return nanoseconds;
  g_autoptr(GTimeZone) utc = g_time_zone_new_utc();
  g_autoptr(GDateTime) date = whole ? nullptr : g_date_time_new_from_iso8601(text.c_str(), utc);
  if (date) {
    const gint64 seconds = g_date_time_to_unix(date);
    if (seconds >= 0 && static_cast<GstClockTime>(seconds) < latest / GST_SECOND)
      return static_cast<GstClockTime>(seconds) * GST_SECOND +
             static_cast<GstClockTime>(g_date_time_get_microsecond(date)) * GST_USECOND;
  }
  error = "expected is ISO 8601, as 2026-11-21T20:00:00.123456Z, or whole nanoseconds since 1970, between "
          "1970 and 2262";
  return std::nullopt;
}

/// Adds the time of day, `start` + PTS, to a buffer (writable) without one. Does nothing without a PTS.
inline void stamp_utc(GstBuffer* buffer, GstClockTime start) {
  constexpr GstClockTime latest = G_MAXINT64; // as for start-time: sums do not overflow
  if (GST_BUFFER_PTS_IS_VALID(buffer) && start <= latest && GST_BUFFER_PTS(buffer) <= latest - start &&
      !utc_of(buffer))
    note_utc(buffer, start + GST_BUFFER_PTS(buffer));
}

/// Adds the time of day of a KLV unit, microseconds since 1970, to a buffer (writable) without one. Senders
/// that do not know the time of day write stream time instead: values before September 2001 are ignored.
inline void stamp_unit_time(GstBuffer* buffer, std::uint64_t microseconds) {
  constexpr std::uint64_t earliest = 1'000'000'000'000'000, latest = G_MAXINT64 / 1000;
  if (microseconds >= earliest && microseconds <= latest && !utc_of(buffer))
    note_utc(buffer, microseconds * GST_USECOND);
}

inline std::optional<std::uint64_t> time_in(const GstMeta* meta) {
  const auto* message = reinterpret_cast<const GstVideoSEIUserDataUnregisteredMeta*>(meta);
  if (!message->data)
    return std::nullopt;
  return stamp_time(message->uuid, {message->data, message->size});
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
  const auto remove_stamp = [](GstBuffer*, GstMeta** meta, gpointer) -> gboolean {
    if ((*meta)->info->api == GST_VIDEO_SEI_USER_DATA_UNREGISTERED_META_API_TYPE && time_in(*meta))
      *meta = nullptr;
    return TRUE;
  };
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
