// SPDX-License-Identifier: LGPL-2.1-or-later
// Attaches what a KLV unit says to a frame.
#pragma once

#include <gst/video/video.h>

#include <cstdint>
#include <string>
#include <vector>

#include "exchange/vmti_klv.hpp"
#include "support/buffers.hpp"

namespace terrainseg {

class UnitAttacher {
 public:
  UnitAttacher() noexcept { gst_video_info_init(&info_); }
  void set_video(GstCaps* caps);
  /// Decodes the unit for attach(). What is wrong with it, or an empty text.
  std::string decode(GstBuffer* klv);
  /// The frame with the decoded unit; as it was when there is no memory for it.
  GstBuffer* attach(GstBuffer* frame);
  const GstVideoInfo& video() const { return info_; }
  void drop(); ///< the pools

 private:
  GstVideoInfo info_;
  KlvUnit unit_;
  MaskPool masks_;
  SmallPool boundaries_;
  std::vector<std::uint16_t> rows_;
};

} // namespace terrainseg
