// SPDX-License-Identifier: LGPL-2.1-or-later
// The standard segmentation metadata, where GStreamer has it (1.26).
#pragma once

#ifdef TERRAINSEG_ANALYTICS

#include <gst/analytics/analytics.h>
#include <gst/video/video.h>

#include <algorithm>

#include "support/buffers.hpp"
#include "terrainseg/estimate.hpp"

namespace terrainseg {

/// Attaches the estimate as GstAnalytics semantic segmentation: region 0 is the rest, region 1 is
/// traversable.
class AnalyticsWriter {
 public:
  /// `estimate.mask` must be readable. False when there is no memory or GStreamer refuses.
  bool attach(GstBuffer* buffer, const Estimate& estimate) {
    // The stock overlay ignores the stride: rows have to be a multiple of 4. It stretches the mask over its
    // rectangle, so that a reduced one serves.
    constexpr int widest = 640;
    const int width = std::max(4, std::min(estimate.mask.width, widest) & ~3);
    const int height =
        std::max(1, static_cast<int>(std::int64_t{estimate.mask.height} * width / estimate.mask.width));
    OwnedBuffer regions = pool_.acquire(width, height);
    {
      const MappedBuffer map(regions.get(), GST_MAP_WRITE);
      if (!map)
        return false;
      write_regions(estimate.mask, map.data(), width, height);
    }

    GstAnalyticsRelationMeta* relations = gst_buffer_get_analytics_relation_meta(buffer);
    if (!relations) // one that another analyser made is shared
      relations = gst_buffer_add_analytics_relation_meta(buffer);
    if (!relations)
      return false;
    guint ids[region_count] = {0, 1};
    const Rectangle& r = estimate.mask_region;
    GstAnalyticsSegmentationMtd segmentation;
    if (!gst_analytics_relation_meta_add_segmentation_mtd(relations, regions.release(),
                                                          GST_SEGMENTATION_TYPE_SEMANTIC, region_count, ids,
                                                          r.x, r.y, r.width, r.height, &segmentation))
      return false;
    gfloat confidence[region_count] = {estimate.confidence / 255.f, estimate.confidence / 255.f};
    GQuark names[region_count] = {g_quark_from_static_string("not-traversable"),
                                  g_quark_from_static_string("traversable")};
    GstAnalyticsClsMtd classes;
    return gst_analytics_relation_meta_add_cls_mtd(relations, region_count, confidence, names, &classes) &&
           gst_analytics_relation_meta_set_relation(relations, GST_ANALYTICS_REL_TYPE_N_TO_N, segmentation.id,
                                                    classes.id);
  }
  void drop() { pool_.drop(); }

 private:
  static constexpr gsize region_count = 2;

  /// Nearest neighbour, and from three values to two region ids.
  static void write_regions(const GrayView& mask, guint8* regions, int width, int height) {
    for (int y = 0; y < height; ++y) {
      const std::uint8_t* from = mask.plane.row(static_cast<int>(std::int64_t{y} * mask.height / height));
      std::uint8_t* to = regions + static_cast<std::ptrdiff_t>(y) * width;
      for (int x = 0; x < width; ++x)
        to[x] = from[std::int64_t{x} * mask.width / width] == mask_traversable;
    }
  }

  MaskPool pool_;
};

} // namespace terrainseg

#endif
