// SPDX-License-Identifier: LGPL-2.1-or-later
// The precision time of a frame: MISB ST 0604 in the video, item 2 of ST 0903 in its KLV unit. Units are
// matched to frames by it even if transport time stamps are shifted.
#pragma once

#include <gst/gst.h>

#include <cstdint>
#include <optional>

#include "exchange/precision_stamp.hpp"

namespace terrainseg {

/// The stamp that parsers and decoders attached (GstVideoSEIUserDataUnregisteredMeta), microseconds. Nothing
/// if there is none, or if there are several different ones: a lossy link then merged two pictures.
std::optional<std::uint64_t> stamp_of(GstBuffer* buffer);

/// Attaches the stamp to a buffer (writable) as parsers do; decoders copy it to their frames.
void note_stamp(GstBuffer* buffer, VideoCodec codec, std::uint64_t time_us);

/// Removes all stamps from a buffer (writable); keeps other SEI messages.
void forget_stamps(GstBuffer* buffer);

/// Microseconds since 1970 if upstream gives the time of day, otherwise the stream time, which makes runs
/// repeatable: encoders that shift time stamps shift the segment too, so the stream time stays the same. The
/// PTS if the segment has no stream time; nothing without a PTS.
std::optional<std::uint64_t> time_of_frame(GstBuffer* buffer, const GstSegment& segment);

/// The stamp in the video if there is one, otherwise the time of the frame.
std::optional<std::uint64_t> precision_time(GstBuffer* buffer, const GstSegment& segment);

} // namespace terrainseg
