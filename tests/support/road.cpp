// SPDX-License-Identifier: LGPL-2.1-or-later
#include "road.hpp"

#include <algorithm>
#include <cstdlib>
#include <cstring>

namespace terrainseg::test {

void paint_road(GstVideoFrame& frame, unsigned seed) {
  const int width = GST_VIDEO_FRAME_WIDTH(&frame), height = GST_VIDEO_FRAME_HEIGHT(&frame);
  const bool rgb = GST_VIDEO_INFO_IS_RGB(&frame.info);
  const guint8 yuv[3][3] = {{200, 150, 110}, {90, 100, 110}, {120, 128, 128}};
  const guint8 colors[3][3] = {{150, 190, 240}, {60, 120, 50}, {120, 120, 120}};
  const guint components = std::min(3U, GST_VIDEO_FRAME_N_COMPONENTS(&frame));
  for (guint component = 0; component < components; ++component) {
    const int w = GST_VIDEO_FRAME_COMP_WIDTH(&frame, component),
              h = GST_VIDEO_FRAME_COMP_HEIGHT(&frame, component);
    const int stride = GST_VIDEO_FRAME_COMP_STRIDE(&frame, component),
              step = GST_VIDEO_FRAME_COMP_PSTRIDE(&frame, component);
    const guint depth = GST_VIDEO_FRAME_COMP_DEPTH(&frame, component),
                shift = GST_VIDEO_FORMAT_INFO_SHIFT(frame.info.finfo, component);
    auto* data = static_cast<guint8*>(GST_VIDEO_FRAME_COMP_DATA(&frame, component));
    // GStreamer 1.22 has P010's V one byte into the pair, in the middle of U; it is two.
    if (depth > 8)
      data += GST_VIDEO_FRAME_COMP_POFFSET(&frame, component) % 2;
    for (int y = 0; y < h; ++y)
      for (int x = 0; x < w; ++x) {
        const int px = x * width / w, py = y * height / h;
        const int below = py * 10 - height * 4; // 0 at the horizon
        const bool road = below >= 0 && std::abs(px * 2 - width) * 6 * height <= width * (height + below);
        const int area = below < 0 ? 0 : road ? 2 : 1;
        unsigned noise = (static_cast<unsigned>(px) * 73856093u) ^ (static_cast<unsigned>(py) * 19349663u) ^
                         ((seed + component) * 83492791u);
        noise = (noise ^ (noise >> 13)) * 1274126177u;
        const int wobble = static_cast<int>((noise >> 24) % 41) - 20;
        const int value =
            (rgb ? colors : yuv)[area][component] + (component == 0 || rgb ? wobble : wobble / 4);
        guint8* sample = data + y * stride + x * step;
        if (depth > 8) { // which may lie anywhere in memory
          const guint16 word = GUINT16_TO_LE(static_cast<guint16>(value << (depth - 8) << shift));
          std::memcpy(sample, &word, sizeof word);
        } else {
          *sample = static_cast<guint8>(value);
        }
      }
  }
}

} // namespace terrainseg::test
