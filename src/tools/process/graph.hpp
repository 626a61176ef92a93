// SPDX-License-Identifier: LGPL-2.1-or-later
// The elements of one run: source -> terrainseg -> tee -> one branch per output. The frames that pass them:
// their times in front of terrainseg, their metadata behind it.
#pragma once

#include <gst/gst.h>
#include <gst/video/video.h>

#include <array>
#include <atomic>
#include <cstdint>
#include <optional>
#include <string>

#include "tools/process/options.hpp"
#include "tools/process/outputs.hpp"

namespace terrainseg::process {

/// Builds the pipeline, sets the size of the video in all branches, and counts the frames of each output.
class Graph {
 public:
  explicit Graph(const Options& options) : options_(options) {}
  ~Graph();

  /// Connects `source` with the branches of the selected outputs. The pipeline takes ownership of `source`.
  /// Throws std::runtime_error.
  void build(GstElement* source, OutputFiles& files);

  GstElement* pipeline() const { return pipeline_; }
  GstElement* terrainseg() const { return named("terrainseg"); }
  /// Sets the size of the outputs, that of the first frame.
  void set_size(const GstVideoInfo& info);
  /// Sets the presentation time of the first frame, at which the annotated video starts.
  void set_start(GstClockTime start) { start_ = start; }
  /// The output whose sink or muxer the element is, if any.
  std::optional<Output> output_of(const GstObject* element) const;
  /// True for an element of the pipeline that is not part of the source.
  bool holds(GstObject* element) const;

  bool ended() const { return sinks_ended_ == sinks_; } ///< every sink has received its EOS
  std::uint64_t written(Output kind) const { return written_[static_cast<std::size_t>(kind)]; }
  std::uint64_t written() const; ///< over all outputs
  void count(Output kind, std::uint64_t frames = 1) { written_[static_cast<std::size_t>(kind)] += frames; }
  std::string bag_metadata() const; ///< of a complete recording; empty when none is selected

 private:
  GstElement* named(const std::string& name) const; ///< the pipeline keeps it; null if it has none
  std::string h264(bool recording) const;
  std::string description(OutputFiles& files) const;
  GstPadProbeReturn on_end(GstPad* pad, GstPadProbeInfo* info);
  GstPadProbeReturn on_movie_box(GstPad* pad, GstPadProbeInfo* info);

  const Options& options_;
  GstElement* pipeline_ = nullptr;
  GstElement* source_ = nullptr;
  int scratch_ = -1; ///< mp4mux keeps frames in this unnamed file, which goes when it is closed
  std::array<std::atomic<std::uint64_t>, output_count> written_{};
  std::atomic<GstClockTime> start_{0};
  int sinks_ = 0;
  std::atomic<int> sinks_ended_{0};
};

/// Detects rows at the bottom of a moving picture that never change: a bonnet, a black bar, a caption. The
/// filter would learn them as ground.
class StillBottom {
 public:
  /// Compares a sample of frames at a sample of pixels with the previous one. All frames must have one size.
  /// One thread only.
  void take(const GstVideoInfo& info, GstBuffer* buffer);

  /// Number of rows from the bottom edge that hardly changed while the picture above did. 0 if they are less
  /// than 3 % of the height, if nothing moved, or after too few frames.
  int rows(int height) const;

 private:
  static constexpr int grid_rows = 60;         ///< covers the lower 60 % of the frame
  static constexpr int grid_columns = 32;      ///< cover the middle half of the width, where the window is
  static constexpr int looked_at_percent = 60; ///< share of the height, from the bottom

  /// Row of the frame for a row of the grid, 0 = the lowest.
  static int frame_row(int grid_row, int height) {
    return grid_row * height * looked_at_percent / (100 * grid_rows);
  }

  std::uint64_t frames_ = 0;
  int compared_ = 0; ///< number of compared pairs
  std::array<std::uint8_t, grid_rows * grid_columns> last_{};
  std::array<std::uint64_t, grid_rows>
      change_{}; ///< sum of absolute brightness differences, 0..255 per pixel
};

/// Observes the pads of terrainseg. Its streaming thread writes everything but the counters; other threads
/// may read after the pipeline has stopped.
class Frames {
 public:
  /// `rows` is the CSV file; not open if no CSV is written.
  Frames(const Options& options, Graph& graph, AtomicFile& rows, Record& record);

  /// Call after the graph has been built around `source`.
  void watch(GstElement* source);
  std::uint64_t labelled() const { return labelled_; }
  GstClockTime position() const { return position_; }
  GstClockTime end() const { return next_pts_; } ///< end of the last frame; only after stopping
  std::uint64_t without_metadata() const { return without_metadata_; }
  /// Rows at the bottom, below the training window, that never changed; 0 = none.
  int still_rows() const;

 private:
  GstPadProbeReturn entering(GstPad* pad, GstPadProbeInfo* info);
  GstPadProbeReturn leaving(GstPad* pad, GstPadProbeInfo* info);
  void segment_entering(GstPadProbeInfo* info);
  void warn_of_views(GstEvent* caps);
  void size_known(GstEvent* caps);
  void frame_done(GstBuffer* buffer);

  const Options& options_;
  Graph& graph_;
  AtomicFile& rows_;
  Record& record_;
  GstSegment segment_{}; ///< of the decoder's output
  std::uint64_t entered_ = 0;
  GstClockTime next_pts_ = 0;
  GstVideoInfo video_info_{}; ///< of terrainseg's output
  StillBottom still_bottom_;
  std::string csv_row_;
  GstVideoRectangle window_{}; ///< of the last frame
  std::uint64_t without_metadata_ = 0;
  std::atomic<std::uint64_t> labelled_{0};
  std::atomic<GstClockTime> position_{0};
};

} // namespace terrainseg::process
