// SPDX-License-Identifier: LGPL-2.1-or-later
// The precision time of a frame: what MISB has in the video (ST 0604) and in the unit of its metadata (item 2
// of ST 0903), by which the two find each other wherever time stamps of transport are shifted.
#pragma once

#include <gst/gst.h>

#include <cstdint>
#include <optional>

#include "exchange/precision_stamp.hpp"

namespace terrainseg {

/// The stamp that parsers and decoders took out of the video (GstVideoSEIUserDataUnregisteredMeta),
/// microseconds. Nothing without one, or with two that differ: parts of two pictures that a lossy link put
/// together.
std::optional<std::uint64_t> stamp_of(GstBuffer* buffer);

/// Notes the stamp on a buffer (writable) as parsers do, for decoders to carry along.
void note_stamp(GstBuffer* buffer, VideoCodec codec, std::uint64_t time_us);

/// Takes all stamps off a buffer (writable); other messages stay.
void forget_stamps(GstBuffer* buffer);

/// Microseconds since 1970 when upstream knows the time of day, else the stream time, so that a run can be
/// repeated: encoders that shift time stamps shift the segment too, and the stream time stays. In a segment
/// that has none, the PTS; nothing without.
std::optional<std::uint64_t> time_of_frame(GstBuffer* buffer, const GstSegment& segment);

/// The stamp in the video where there is one, else the time of the frame.
std::optional<std::uint64_t> precision_time(GstBuffer* buffer, const GstSegment& segment);

} // namespace terrainseg
