// SPDX-License-Identifier: LGPL-2.1-or-later
// The time of day of a frame: a GstReferenceTimestampMeta of cameras, RTP or NTP, or the start time of a
// recording.
#pragma once

#include <gst/gst.h>

#include <cstdint>
#include <optional>
#include <string>

namespace terrainseg {

/// Nanoseconds since 1970 from a meta with the reference `timestamp/x-unix` or `timestamp/x-ntp`; nothing
/// without one.
std::optional<GstClockTime> utc_of(GstBuffer* buffer);

/// Parses `2026-11-21T20:00:00.5Z` (ISO 8601; UTC without a zone) or an integer of nanoseconds since 1970. On
/// an error it returns nothing and sets `error` to the valid forms.
std::optional<GstClockTime> parse_start_time(const std::string& text, std::string& error);

/// Adds the time of day, `start` + PTS, to a buffer (writable) without one. Does nothing without a PTS.
void stamp_utc(GstBuffer* buffer, GstClockTime start);

/// Adds the time of day of a KLV unit, microseconds since 1970, to a buffer (writable) without one. Senders
/// that do not know the time of day write stream time instead: values before September 2001 are ignored.
void stamp_unit_time(GstBuffer* buffer, std::uint64_t microseconds);

} // namespace terrainseg
