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
  using Descriptors = std::array<int, output_count>; ///< of the output files; -1 = output not selected

  explicit Graph(const Options& options) : options_(options), pipeline_(gst_pipeline_new(nullptr)) {}
  ~Graph();
  Graph(const Graph&) = delete;
  Graph& operator=(const Graph&) = delete;

  /// Connects `source` with the branches of the selected outputs. The pipeline takes ownership of `source`.
  /// Returns the problem, if any.
  std::optional<std::string> build(GstElement* source, const Descriptors& files);

  GstElement* pipeline() const { return pipeline_; }
  GstElement* terrainseg() const { return terrainseg_; }
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
  GstElement* add(const char* factory);
  GstElement* branch(GstElement* tee);
  GstElement* add_sink(Output kind, int fd);
  void add_annotated(GstElement* tee, int fd);
  void add_masks(GstElement* tee, int fd);
  void add_json(GstElement* tee, int fd);
  void add_recording(GstElement* tee, int fd);
  GstElement* encode_h264(GstElement* from, bool recording);
  void count_buffers(GstElement* element, const char* pad, Output kind);
  void watch_end(GstElement* sink);
  GstPadProbeReturn on_end(GstPad* pad, GstPadProbeInfo* info);
  GstPadProbeReturn on_movie_box(GstPad* pad, GstPadProbeInfo* info);

  const Options& options_;
  GstElement* pipeline_;
  GstElement* source_ = nullptr;
  int scratch_ = -1; ///< mp4mux keeps frames in this unnamed file, which goes when it is closed
  GstElement* terrainseg_ = nullptr;
  GstElement* overlay_ = nullptr; ///< these five are null when their output is not selected
  GstElement* annotated_caps_ = nullptr;
  GstElement* annotated_box_ = nullptr;
  GstElement* annotated_colors_ = nullptr;
  GstElement* masks_caps_ = nullptr;
  GstElement* recording_caps_ = nullptr;
  std::array<GstElement*, output_count> sinks_of_{}, muxers_{};
  std::array<std::atomic<std::uint64_t>, output_count> written_{};
  std::atomic<GstClockTime> start_{0};
  int sinks_ = 0;
  std::atomic<int> sinks_ended_{0};
};

} // namespace terrainseg::process
