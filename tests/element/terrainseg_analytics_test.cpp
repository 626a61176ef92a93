// SPDX-License-Identifier: LGPL-2.1-or-later
// The standard segmentation metadata beside ours; built where GStreamer has it (1.26).
#include <gst/analytics/analytics.h>

#include "harness.hpp"

namespace terrainseg::test {
namespace {

struct Segmentation {
  GstBuffer* mask = nullptr; // owned by the caller
  gint x = 0, y = 0;
  guint width = 0, height = 0;
  GstAnalyticsSegmentationMtd segmentation{};
  GstAnalyticsMtd classes{};
  bool has_classes = false;
};

bool find(GstBuffer* buffer, Segmentation& found) {
  GstAnalyticsRelationMeta* relations = gst_buffer_get_analytics_relation_meta(buffer);
  if (!relations)
    return false;
  gpointer state = nullptr;
  GstAnalyticsMtd any;
  if (!gst_analytics_relation_meta_iterate(relations, &state, gst_analytics_segmentation_mtd_get_mtd_type(),
                                           &any))
    return false;
  found.segmentation = any;
  found.mask = gst_analytics_segmentation_mtd_get_mask(&found.segmentation, &found.x, &found.y, &found.width,
                                                       &found.height);
  gpointer related = nullptr;
  found.has_classes = gst_analytics_relation_meta_get_direct_related(
      relations, any.id, GST_ANALYTICS_REL_TYPE_N_TO_N, gst_analytics_cls_mtd_get_mtd_type(), &related,
      &found.classes);
  return true;
}

TEST(Analytics, SaysTheSameAsTheMask) {
  for (const auto& [width, height] : {std::pair{320, 240}, {161, 121}, {1280, 720}}) {
    Rig rig("terrainseg", caps_text("I420", width, height));
    rig.step();
    const auto out = rig.step();
    const EstimateReader reader(out.get());
    ASSERT_TRUE(reader);
    Segmentation found;
    ASSERT_TRUE(find(out.get(), found));
    EXPECT_EQ(found.x, 0);
    EXPECT_EQ(found.width, static_cast<guint>(width));
    EXPECT_EQ(found.height, static_cast<guint>(height));
    const GstVideoMeta* layout = gst_buffer_get_video_meta(found.mask);
    ASSERT_NE(layout, nullptr);
    EXPECT_EQ(layout->format, GST_VIDEO_FORMAT_GRAY8);
    EXPECT_EQ(layout->width % 4, 0u);
    const auto regions = bytes_of(found.mask);
    ASSERT_EQ(regions.size(), static_cast<std::size_t>(layout->width) * layout->height);
    const GrayView& mask = reader.estimate().mask;
    for (guint y = 0; y < layout->height; ++y)
      for (guint x = 0; x < layout->width; ++x)
        ASSERT_EQ(regions[y * layout->width + x],
                  mask.plane.row(static_cast<int>(y * mask.height /
                                                  layout->height))[x * mask.width / layout->width] == 255);
    ASSERT_EQ(gst_analytics_segmentation_mtd_get_region_count(&found.segmentation), 2u);
    ASSERT_TRUE(found.has_classes);
    gsize index = 0;
    ASSERT_TRUE(gst_analytics_segmentation_mtd_get_region_index(&found.segmentation, &index, 1));
    EXPECT_STREQ(g_quark_to_string(gst_analytics_cls_mtd_get_quark(&found.classes, index)), "traversable");
    gst_buffer_unref(found.mask);
  }
}

TEST(Analytics, IsLeftOutWhenSwitchedOff) {
  Rig rig("terrainseg analytics-meta=false", caps_text("I420", 320, 240));
  const auto out = rig.step();
  EXPECT_EQ(gst_buffer_get_analytics_relation_meta(out.get()), nullptr);
}

TEST(Analytics, SharesTheMetaOfAnotherAnalyser) {
  Rig rig("terrainseg", caps_text("I420", 320, 240));
  GstBuffer* buffer = new_frame(rig.info());
  GstAnalyticsRelationMeta* relations = gst_buffer_add_analytics_relation_meta(buffer);
  GstAnalyticsODMtd other;
  ASSERT_TRUE(gst_analytics_relation_meta_add_od_mtd(relations, g_quark_from_string("car"), 1, 2, 3, 4, 0.5f,
                                                     &other));
  ASSERT_EQ(rig.push(buffer), GST_FLOW_OK);
  const auto out = rig.pull();
  Segmentation found;
  ASSERT_TRUE(find(out.get(), found));
  gst_buffer_unref(found.mask);
  EXPECT_EQ(gst_analytics_relation_get_length(gst_buffer_get_analytics_relation_meta(out.get())), 3u);
}

} // namespace
} // namespace terrainseg::test
