// SPDX-License-Identifier: LGPL-2.1-or-later
// The elements of one run: source -> terrainseg -> tee -> one branch per output.
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
  void count_buffers(GstElement* element, const char* pad, Output kind);
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

} // namespace terrainseg::process
