// SPDX-License-Identifier: LGPL-2.1-or-later
// Detects video without colour in a format with colour.
#pragma once

#include <gst/video/video.h>

#include <algorithm>
#include <cstdlib>
#include <string>

#include "support/warnings.hpp"

namespace terrainseg {

/// Checks a lattice of pixels of each frame. A grey camera with videoconvert, or one in infrared mode, has
/// neutral chroma in all of them. A picture of uniform brightness (a lens cap) is ignored.
class ColourWatch {
 public:
  static constexpr unsigned frames_before_news =
      60; ///< number of consecutive frames without colour before the report

  /// Returns true once, for the last of that many frames.
  bool see(const GstVideoFrame& frame) {
    if (told_ || GST_VIDEO_FRAME_N_COMPONENTS(&frame) < 3) // grey formats have no colour
      return false;
    const Look seen = look(frame);
    if (seen == Look::coloured)
      grey_ = 0;
    if (seen != Look::grey)
      return false;
    told_ = ++grey_ >= frames_before_news;
    return told_;
  }

 private:
  enum class Look { coloured, grey, flat };
  static constexpr int columns = 16, rows = 9;
  static constexpr int tolerance =
      2; ///< maximum distance from neutral chroma, of 255: rounding in the conversion from grey
  static constexpr int contrast = 16; ///< minimum brightness range of a picture, of 255

  /// The upper 8 bits of a sample.
  static int sample(const GstVideoFrame& frame, guint component, int column, int row) {
    const int x = (2 * column + 1) * GST_VIDEO_FRAME_COMP_WIDTH(&frame, component) / (2 * columns);
    const int y = (2 * row + 1) * GST_VIDEO_FRAME_COMP_HEIGHT(&frame, component) / (2 * rows);
    const auto* at = static_cast<const guint8*>(GST_VIDEO_FRAME_COMP_DATA(&frame, component)) +
                     std::ptrdiff_t{y} * GST_VIDEO_FRAME_COMP_STRIDE(&frame, component) +
                     std::ptrdiff_t{x} * GST_VIDEO_FRAME_COMP_PSTRIDE(&frame, component);
    const guint depth = GST_VIDEO_FRAME_COMP_DEPTH(&frame, component);
    if (depth <= 8)
      return *at;
    // In P010, GStreamer 1.22 gives an offset of one byte for V; it is at two.
    at += GST_VIDEO_FRAME_COMP_POFFSET(&frame, component) % 2;
    const int little_endian = at[0] | at[1] << 8; // the address may be unaligned
    return little_endian >> GST_VIDEO_FORMAT_INFO_SHIFT(frame.info.finfo, component) >> (depth - 8);
  }

  static Look look(const GstVideoFrame& frame) {
    const bool rgb = GST_VIDEO_INFO_IS_RGB(&frame.info);
    int least = 255, most = 0;
    for (int row = 0; row < rows; ++row)
      for (int column = 0; column < columns; ++column) {
        const int a = sample(frame, 0, column, row), b = sample(frame, 1, column, row),
                  c = sample(frame, 2, column, row);
        const bool neutral = rgb ? std::max({a, b, c}) - std::min({a, b, c}) <= tolerance
                                 : std::abs(b - 128) <= tolerance && std::abs(c - 128) <= tolerance;
        if (!neutral)
          return Look::coloured;
        least = std::min(least, a);
        most = std::max(most, a);
      }
    return most - least >= contrast ? Look::grey : Look::flat;
  }

  unsigned grey_ = 0; ///< consecutive frames without colour
  bool told_ = false;
};

/// Warning: pictures in a colour format are grey.
inline Warning colourless_warning(const GstVideoInfo& info) {
  const std::string format = gst_video_format_to_string(GST_VIDEO_INFO_FORMAT(&info));
  return {
      "The video format " + format + " has colour, but the last " +
          std::to_string(ColourWatch::frames_before_news) +
          " frames have none: the ground is learned from brightness and texture only, which is less "
          "accurate. For a colour camera, set a colour format directly after it (video/x-raw,format=NV12) "
          "and switch its infrared mode off; for a mono camera, use GRAY8 to avoid this warning.",
      "format " + format + ", chroma within 2 of neutral in every pixel that was looked at"};
}

} // namespace terrainseg
