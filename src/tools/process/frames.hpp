// SPDX-License-Identifier: LGPL-2.1-or-later
// What is read from the frames themselves: their times on the way in, their metadata on the way out.
#pragma once

#include <gst/gst.h>
#include <gst/video/video.h>

#include <atomic>
#include <cstdint>
#include <string>

#include "tools/process/graph.hpp"
#include "tools/process/outputs.hpp"
#include "tools/process/still_bottom.hpp"

namespace terrainseg::process {

/// Watches the pads before and behind terrainseg. Its streaming thread writes everything but the counters;
/// others read it when the pipeline has stopped.
class Frames {
 public:
  /// `rows`: the CSV; not open where it is not wanted.
  Frames(const Options& options, Graph& graph, AtomicFile& rows, Record& record);
  Frames(const Frames&) = delete;
  Frames& operator=(const Frames&) = delete;

  /// Once the graph is built around `source`.
  void watch(GstElement* source);
  std::uint64_t labelled() const { return labelled_; }
  GstClockTime position() const { return position_; }
  GstClockTime end() const { return next_pts_; } ///< of the last frame; when stopped
  std::uint64_t without_metadata() const { return without_metadata_; }
  /// Rows at the bottom, under the training window, that never changed; 0 = none.
  int still_rows() const;

 private:
  GstPadProbeReturn entering(GstPadProbeInfo* info);
  void segment_entering(GstPadProbeInfo* info);
  void warn_of_views(GstEvent* caps);
  void size_known(GstCaps* caps);
  void frame_done(GstBuffer* buffer);

  const Options& options_;
  Graph& graph_;
  AtomicFile& rows_;
  Record& record_;
  GstSegment segment_{}; ///< of the decoder
  std::uint64_t entered_ = 0;
  GstClockTime next_pts_ = 0;
  GstVideoInfo video_info_{}; ///< behind terrainseg
  StillBottom still_bottom_;
  std::string csv_row_;
  GstVideoRectangle window_{}; ///< of the last frame
  std::uint64_t without_metadata_ = 0;
  std::atomic<std::uint64_t> labelled_{0};
  std::atomic<GstClockTime> position_{0};
};

} // namespace terrainseg::process
