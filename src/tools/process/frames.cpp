// SPDX-License-Identifier: LGPL-2.1-or-later
#include "tools/process/frames.hpp"

#include <gst/terrainseg/terrainsegmeta.h>

#include <algorithm>

#include "tools/process/csv_rows.hpp"
#include "tools/process/handles.hpp"

namespace terrainseg::process {

Frames::Frames(const Options& options, Graph& graph, AtomicFile& rows, Record& record)
    : options_(options), graph_(graph), rows_(rows), record_(record) {
  gst_segment_init(&segment_, GST_FORMAT_UNDEFINED);
  if (rows_.fd() >= 0)
    rows_.write(csv_header);
}

void Frames::watch(GstElement* source) {
  constexpr auto all =
      static_cast<GstPadProbeType>(GST_PAD_PROBE_TYPE_BUFFER | GST_PAD_PROBE_TYPE_EVENT_DOWNSTREAM);
  const PadPointer in(gst_element_get_static_pad(source, "src"));
  const auto on_entering = [](GstPad*, GstPadProbeInfo* info, gpointer self) {
    return static_cast<Frames*>(self)->entering(info);
  };
  gst_pad_add_probe(in.get(), all, on_entering, this, nullptr);
  const PadPointer out(gst_element_get_static_pad(graph_.terrainseg(), "src"));
  const auto on_labelled = [](GstPad*, GstPadProbeInfo* info, gpointer self) {
    Frames* frames = static_cast<Frames*>(self);
    if (GST_PAD_PROBE_INFO_TYPE(info) & GST_PAD_PROBE_TYPE_BUFFER) {
      frames->frame_done(GST_PAD_PROBE_INFO_BUFFER(info));
    } else if (GstEvent* event = GST_PAD_PROBE_INFO_EVENT(info); GST_EVENT_TYPE(event) == GST_EVENT_CAPS) {
      GstCaps* caps = nullptr;
      gst_event_parse_caps(event, &caps);
      frames->size_known(caps);
    }
    return GST_PAD_PROBE_OK;
  };
  gst_pad_add_probe(out.get(), all, on_labelled, this, nullptr);
}

int Frames::still_rows() const {
  const int rows = still_bottom_.rows();
  return window_.h > 0 && window_.y + window_.h > video_info_.height - rows ? rows : 0;
}

/// From here on, time stamps are the presentation times of the file. Edit lists and B-frames shift the stamps
/// of a demuxer; its segment has the shift.
void Frames::segment_entering(GstPadProbeInfo* info) {
  GstEvent* event = GST_PAD_PROBE_INFO_EVENT(info);
  gst_event_copy_segment(event, &segment_);
  if (segment_.format != GST_FORMAT_TIME)
    return;
  GstSegment plain;
  gst_segment_init(&plain, GST_FORMAT_TIME);
  GstEvent* replacement = gst_event_new_segment(&plain);
  gst_event_set_seqnum(replacement, gst_event_get_seqnum(event));
  gst_event_unref(event);
  GST_PAD_PROBE_INFO_DATA(info) = replacement;
}

/// The two views of a stereo picture are labelled as one.
void Frames::warn_of_views(GstEvent* event) {
  GstCaps* caps = nullptr;
  gst_event_parse_caps(event, &caps);
  GstVideoInfo info;
  if (!gst_video_info_from_caps(&info, caps))
    return;
  const GstVideoMultiviewMode mode = GST_VIDEO_INFO_MULTIVIEW_MODE(&info);
  if (mode == GST_VIDEO_MULTIVIEW_MODE_NONE || mode == GST_VIDEO_MULTIVIEW_MODE_MONO)
    return;
  const std::string text = std::string("stereo video (") + gst_video_multiview_mode_to_caps_string(mode) +
                           "): its two views are taken for one picture; make a video of one view first, as "
                           "ffmpeg -i INPUT -vf stereo3d=sbsl:ml OUTPUT.mkv does for side by side";
  if (std::find(record_.warnings.begin(), record_.warnings.end(), text) == record_.warnings.end())
    record_.warnings.push_back(text);
}

/// Ends the stream after --frames frames. Frames without a time get one, which files need.
GstPadProbeReturn Frames::entering(GstPadProbeInfo* info) {
  if (!(GST_PAD_PROBE_INFO_TYPE(info) & GST_PAD_PROBE_TYPE_BUFFER)) {
    GstEvent* event = GST_PAD_PROBE_INFO_EVENT(info);
    if (GST_EVENT_TYPE(event) == GST_EVENT_SEGMENT)
      segment_entering(info);
    else if (GST_EVENT_TYPE(event) == GST_EVENT_CAPS)
      warn_of_views(event);
    // GAP events may overtake the segment in an encoder, which muxers report as an error. Files need none.
    return GST_EVENT_TYPE(event) == GST_EVENT_GAP ? GST_PAD_PROBE_DROP : GST_PAD_PROBE_OK;
  }
  GstBuffer* buffer = GST_PAD_PROBE_INFO_BUFFER(info);
  if (options_.max_frames && entered_ >= options_.max_frames) {
    gst_buffer_unref(buffer);
    GST_PAD_PROBE_INFO_DATA(info) = nullptr;
    GST_PAD_PROBE_INFO_FLOW_RETURN(info) = GST_FLOW_EOS;
    return GST_PAD_PROBE_HANDLED;
  }
  ++entered_;
  const GstClockTime time =
      segment_.format == GST_FORMAT_TIME && GST_BUFFER_PTS_IS_VALID(buffer)
          ? gst_segment_to_stream_time(&segment_, GST_FORMAT_TIME, GST_BUFFER_PTS(buffer))
          : GST_BUFFER_PTS(buffer);
  if (!GST_CLOCK_TIME_IS_VALID(time) || time != GST_BUFFER_PTS(buffer)) {
    buffer = gst_buffer_make_writable(buffer);
    GST_BUFFER_PTS(buffer) = GST_CLOCK_TIME_IS_VALID(time) ? time : next_pts_;
    GST_PAD_PROBE_INFO_DATA(info) = buffer;
  }
  const GstClockTime length = GST_BUFFER_DURATION_IS_VALID(buffer) && GST_BUFFER_DURATION(buffer) > 0
                                  ? GST_BUFFER_DURATION(buffer)
                                  : GST_SECOND / 30;
  next_pts_ = GST_BUFFER_PTS(buffer) + length;
  return GST_PAD_PROBE_OK;
}

/// Files have one size: the first frame's. Later frames are scaled to it. Caps may arrive twice before the
/// first frame, because the orientation is known after the size.
void Frames::size_known(GstCaps* caps) {
  GstVideoInfo info;
  if (!gst_video_info_from_caps(&info, caps))
    return;
  video_info_ = info;
  if (labelled_ > 0)
    return;
  record_.width = info.width;
  record_.height = info.height;
  graph_.set_size(info);
}

void Frames::frame_done(GstBuffer* buffer) {
  position_ = GST_BUFFER_PTS(buffer);
  if (labelled_ == 0)
    graph_.set_start(position_);
  const GstStructure* meta = gst_buffer_get_terrain_seg_structure(buffer);
  if (meta) {
    const guint permille = gst_terrain_seg_meta_get_traversable_permille(meta);
    const guint flags = gst_terrain_seg_meta_get_flags(meta);
    const gint horizon = gst_terrain_seg_meta_get_horizon_row(meta);
    record_.traversable_sum += permille;
    still_bottom_.take(video_info_, buffer);
    gst_terrain_seg_meta_get_window(meta, &window_);
    record_.blocked += (flags & GST_TERRAIN_SEG_FLAG_BLOCKED) != 0;
    record_.horizon_frames += horizon >= 0;
    if (rows_.fd() >= 0) {
      make_csv_row(csv_row_, buffer, meta);
      rows_.write(csv_row_);
      graph_.count(Output::csv);
    }
  } else {
    ++without_metadata_;
  }
  ++labelled_;
}

} // namespace terrainseg::process
