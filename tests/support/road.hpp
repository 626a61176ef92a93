// SPDX-License-Identifier: LGPL-2.1-or-later
// Frames of a simple road, in every format of GStreamer that the elements take.
#pragma once

#include <gst/video/video.h>

namespace terrainseg::test {

/// Paints a road: sky in the upper 40 %, verges, a grey road with a little noise. The noise depends on the
/// place and `seed` alone.
void paint_road(GstVideoFrame& frame, unsigned seed);

} // namespace terrainseg::test
