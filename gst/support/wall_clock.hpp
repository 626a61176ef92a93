// SPDX-License-Identifier: LGPL-2.1-or-later
// The time of day of a frame: GstReferenceTimestampMeta, which cameras, RTP and NTP give, or the start of a
// recording.
#pragma once

#include <gst/gst.h>

#include <cstdint>
#include <optional>
#include <string>

namespace terrainseg {

/// Nanoseconds since 1970, from what upstream noted in `timestamp/x-unix` or `timestamp/x-ntp`; nothing when
/// it noted neither.
std::optional<GstClockTime> utc_of(GstBuffer* buffer);

/// Reads `2026-11-21T20:00:00.5Z` (ISO 8601; without a zone it is UTC) or whole nanoseconds since 1970. On an
/// error nothing, and `error` says what was expected.
std::optional<GstClockTime> parse_start_time(const std::string& text, std::string& error);

/// Notes the time of day on a buffer (writable) that has none: `start` plus its PTS. Without a PTS nothing.
void stamp_utc(GstBuffer* buffer, GstClockTime start);

/// Notes the time of day that a KLV unit tells, microseconds since 1970, on a buffer (writable) that has
/// none. A sender that does not know the time of day sends the time stamp of its stream in its place: what
/// would lie before September 2001 is none.
void stamp_unit_time(GstBuffer* buffer, std::uint64_t microseconds);

} // namespace terrainseg
