// SPDX-License-Identifier: LGPL-2.1-or-later
#include "support/precision_time.hpp"

#include <gst/video/video.h>

#include "support/segment_time.hpp"
#include "support/wall_clock.hpp"

namespace terrainseg {
namespace {

std::optional<std::uint64_t> time_in(const GstMeta* meta) {
  const auto* message = reinterpret_cast<const GstVideoSEIUserDataUnregisteredMeta*>(meta);
  if (!message->data)
    return std::nullopt;
  return stamp_time(message->uuid, {message->data, message->size});
}

gboolean remove_stamp(GstBuffer*, GstMeta** meta, gpointer) {
  if ((*meta)->info->api == GST_VIDEO_SEI_USER_DATA_UNREGISTERED_META_API_TYPE && time_in(*meta))
    *meta = nullptr;
  return TRUE;
}

} // namespace

std::optional<std::uint64_t> stamp_of(GstBuffer* buffer) {
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

void note_stamp(GstBuffer* buffer, VideoCodec codec, std::uint64_t time_us) {
  StampIdentifier identifier = microseconds_identifier(codec);
  StampContent content = stamp_content(time_us);
  gst_buffer_add_video_sei_user_data_unregistered_meta(buffer, identifier.data(), content.data(),
                                                       content.size());
}

void forget_stamps(GstBuffer* buffer) {
  gst_buffer_foreach_meta(buffer, remove_stamp, nullptr);
}

std::optional<std::uint64_t> time_of_frame(GstBuffer* buffer, const GstSegment& segment) {
  if (const auto utc = utc_of(buffer))
    return *utc / 1000;
  if (!GST_BUFFER_PTS_IS_VALID(buffer))
    return std::nullopt;
  const GstClockTime time = stream_time_of(segment, GST_BUFFER_PTS(buffer));
  return (GST_CLOCK_TIME_IS_VALID(time) ? time : GST_BUFFER_PTS(buffer)) / 1000;
}

std::optional<std::uint64_t> precision_time(GstBuffer* buffer, const GstSegment& segment) {
  const auto stamp = stamp_of(buffer);
  return stamp ? stamp : time_of_frame(buffer, segment);
}

} // namespace terrainseg
