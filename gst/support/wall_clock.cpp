// SPDX-License-Identifier: LGPL-2.1-or-later
#include "support/wall_clock.hpp"

#include <gst/terrainseg/terrainsegmeta.h>

#include <charconv>

namespace terrainseg {
namespace {

GstStaticCaps unix_time = GST_STATIC_CAPS("timestamp/x-unix");

void note(GstBuffer* buffer, GstClockTime time) {
  g_autoptr(GstCaps) caps = gst_static_caps_get(&unix_time);
  gst_buffer_add_reference_timestamp_meta(buffer, caps, time, GST_BUFFER_DURATION(buffer));
}

} // namespace

std::optional<GstClockTime> utc_of(GstBuffer* buffer) {
  const GstClockTime time = gst_buffer_get_terrain_utc(buffer);
  return GST_CLOCK_TIME_IS_VALID(time) ? std::optional(time) : std::nullopt;
}

std::optional<GstClockTime> parse_start_time(const std::string& text, std::string& error) {
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
  error =
      "expected is ISO 8601, as 2026-11-21T20:00:00.123456Z, or whole nanoseconds since 1970, between 1970 "
      "and 2262";
  return std::nullopt;
}

void stamp_utc(GstBuffer* buffer, GstClockTime start) {
  constexpr GstClockTime latest = G_MAXINT64; // as for start-time: sums do not overflow
  if (GST_BUFFER_PTS_IS_VALID(buffer) && start <= latest && GST_BUFFER_PTS(buffer) <= latest - start &&
      !utc_of(buffer))
    note(buffer, start + GST_BUFFER_PTS(buffer));
}

void stamp_unit_time(GstBuffer* buffer, std::uint64_t microseconds) {
  constexpr std::uint64_t earliest = 1'000'000'000'000'000, latest = G_MAXINT64 / 1000;
  if (microseconds >= earliest && microseconds <= latest && !utc_of(buffer))
    note(buffer, microseconds * GST_USECOND);
}

} // namespace terrainseg
