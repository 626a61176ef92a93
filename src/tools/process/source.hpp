// SPDX-License-Identifier: LGPL-2.1-or-later
// The decoding half of a pipeline: a file, a URI or a list of images becomes raw, upright, progressive video.
#pragma once

#include <gst/gst.h>

#include <atomic>
#include <cstdint>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "tools/process/faults.hpp"
#include "tools/process/handles.hpp"
#include "tools/process/inputs.hpp"
#include "tools/process/iso_media.hpp"
#include "tools/process/options.hpp"

namespace terrainseg::process {

/// The problem of a source of which nothing more is known: an error says more.
inline constexpr const char* no_video = "there is no video in it";

class Source {
 public:
  Source(const Input& input, const Options& options);
  Source(const Source&) = delete;
  Source& operator=(const Source&) = delete;

  /// The bin with one pad "src"; belongs to whoever adds it to a pipeline, and must be stopped (NULL) before
  /// the Source goes.
  GstElement* bin() const { return bin_; }

  bool has_video() const { return linked_; }
  /// True when nothing works on the input any more although no video came: some demuxers give up a cut file
  /// without a word.
  bool has_given_up() const;
  /// What it holds instead of video, for a message; empty when nothing is known.
  std::string other_streams() const;
  /// Why feeding or linking failed; empty when it did not.
  std::string problem() const;
  Cause cause() const; ///< of the problem
  /// Frames that the decoder marked as damaged. Those before the first sound frame do not count: a file that
  /// is trimmed inside an open group of pictures begins like that, and a player shows them.
  std::uint64_t corrupted() const { return corrupted_; }
  /// Frames that went into the decoder behind the first that came out, and never came out themselves. 0 where
  /// that cannot be told: hidden frames (VP8, VP9, AV1), fields, files without times. When stopped only.
  std::uint64_t lost() const;
  /// False where a frame that goes into the decoder need not come out of it.
  bool is_countable() const;
  /// Which of several video tracks was taken, for a message; empty when there is but one.
  std::string choice() const;
  /// Which images of a sequence end early, for a message; empty when none does.
  std::string cut_images() const;
  /// Why the video tracks that the tables of its file list gave no frame; empty when they list none.
  std::string listed() const;
  /// Frames of the track that the tables of its file promise; 0 where they are unknown.
  std::uint64_t promised() const;
  /// The image that a decoder which has given out `frames` frames was busy with; empty for other inputs.
  std::string image_after(std::uint64_t frames) const;
  /// Ends the stream as if the input were over: for a decoder that failed without doing so itself.
  void end();

 private:
  void build_decoder();
  void build_image_feeder(const Options& options);
  /// A video track: what goes into its decoder.
  struct Track {
    GstElement* decoder;
    bool countable = true;
    bool pictures = false;             ///< each can be decoded without the others
    std::vector<GstClockTime> encoded; ///< times of its frames
    const Source* source = nullptr;
  };
  /// What its file says of the taken track; null for other containers.
  const IsoTrack* table() const { return table(track_id_); }
  const IsoTrack* table(unsigned track_id) const;
  Track* track_of(GstPad* pad);
  void take(GstPad* pad);
  void feed();
  GstBuffer* read_image(const std::filesystem::path& path, std::string& type);
  void pad_added(GstPad* pad);
  bool link_video(GstPad* pad);
  void set_problem(const std::string& problem, Cause cause);
  static void on_pad_added(GstElement*, GstPad* pad, gpointer self);
  static void on_no_more_pads(GstElement*, gpointer self);
  static gboolean on_autoplug_continue(GstElement*, GstPad*, GstCaps* caps, gpointer);
  static void on_need_data(GstElement*, guint, gpointer self);
  static void on_element_added(GstBin*, GstBin*, GstElement* element, gpointer self);
  static GstPadProbeReturn on_image(GstPad* pad, GstPadProbeInfo* info, gpointer self);
  static GstPadProbeReturn on_pull(GstPad*, GstPadProbeInfo* info, gpointer self);
  static GstPadProbeReturn on_pulled(GstPad*, GstPadProbeInfo* info, gpointer self);
  static GstPadProbeReturn on_index(GstPad*, GstPadProbeInfo* info, gpointer self);
  static GstPadProbeReturn on_encoded(GstPad*, GstPadProbeInfo* info, gpointer track);
  static GstPadProbeReturn on_encoded_caps(GstPad*, GstPadProbeInfo* info, gpointer track);
  static GstPadProbeReturn on_decoded(GstPad*, GstPadProbeInfo* info, gpointer self);
  static GstPadProbeReturn on_decoded_caps(GstPad*, GstPadProbeInfo* info, gpointer);

  const Input& input_;
  const int threads_; ///< of the decoder
  GstElement* bin_ = nullptr;
  GstElement* tail_ = nullptr;   ///< the queue that ends the bin
  GstElement* feeder_ = nullptr; ///< the appsrc of an image sequence
  std::size_t next_image_ = 0;   ///< feeder's thread only
  int fps_numerator_ = 30, fps_denominator_ = 1;
  std::string image_type_;               ///< media type of the first image; feeder's thread only
  std::string orientation_ = "rotate-0"; ///< of the last image; its streaming thread
  std::atomic<bool> linked_{false};
  std::atomic<bool> is_iso_media_{false}; ///< qtdemux reads it
  std::atomic<std::uint64_t> corrupted_{0};
  bool sound_ = false;                ///< streaming thread: a frame came out that is not damaged
  bool countable_ = true;             ///< one frame out per frame in; streaming threads
  std::vector<GstClockTime> decoded_; ///< times of the frames that came out; a streaming thread
  std::vector<std::unique_ptr<Track>> tracks_;
  Track* taken_ = nullptr;
  PadPointer picture_; ///< a track of pictures, taken when no other video is there
  int videos_ = 0, taken_number_ = 0;
  unsigned track_id_ = 0;              ///< of the container; 0 = unknown
  const std::vector<IsoTrack> tables_; ///< of an MP4 or MOV file
  std::uint64_t pulled_ = 0;           ///< end of what a libav demuxer has read; its thread only
  std::uint64_t pulls_at_end_ = 0;     ///< how often it asked for more behind that; its thread only
  mutable std::mutex mutex_;           ///< guards those below and tracks_
  std::string problem_;
  Cause cause_ = Cause::none;
  std::string other_streams_;
  std::string cut_image_; ///< the first
  std::uint64_t cut_images_ = 0;
};

} // namespace terrainseg::process
