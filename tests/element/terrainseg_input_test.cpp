// SPDX-License-Identifier: LGPL-2.1-or-later
// terrainseg with bad or strange input: an error that names the cause, or a defined answer.
#include <gst/terrainseg/terrainsegmeta.h>

#include "harness.hpp"

namespace terrainseg::test {
namespace {

Report only_error(Rig& rig) {
  const auto errors = rig.errors();
  EXPECT_EQ(errors.size(), 1u);
  return errors.empty() ? Report{} : errors[0];
}

TEST(Input, InterlacedIsRefusedWithAHint) {
  for (const char* mode : {"interleaved", "mixed", "fields"}) {
    Rig rig("terrainseg");
    Owned<GstCaps> parsed(
        gst_caps_from_string((caps_text("I420", 64, 64) + ",interlace-mode=" + mode).c_str()));
    gst_harness_set_src_caps(rig.harness(), parsed.release());
    Owned<GstBuffer> buffer(gst_buffer_new_allocate(nullptr, 64 * 64 * 2, nullptr));
    EXPECT_EQ(rig.push(buffer.release()), GST_FLOW_NOT_NEGOTIATED) << mode;
    const auto errors = rig.errors();
    ASSERT_FALSE(errors.empty()) << mode;
    EXPECT_TRUE(errors[0].contains("deinterlace"));
    EXPECT_TRUE(errors[0].contains(mode));
  }
}

TEST(Input, BuffersShorterThanTheirCapsSay) {
  for (int format = 0; format < pixel_format_count; ++format) {
    for (gsize missing : {gsize{1}, gsize{500}}) {
      Rig rig("terrainseg", caps_text(format_name(format), 64, 48));
      GstBuffer* buffer = new_frame(rig.info());
      gst_buffer_set_size(buffer, static_cast<gssize>(gst_buffer_get_size(buffer) - missing));
      EXPECT_EQ(rig.push(buffer), GST_FLOW_ERROR) << format_name(format);
      const Report error = only_error(rig);
      EXPECT_TRUE(error.contains("bytes")) << error.user;
    }
  }
  Rig rig("terrainseg", caps_text("I420", 64, 48));
  EXPECT_EQ(rig.push(gst_buffer_new()), GST_FLOW_ERROR);
}

TEST(Input, VideoMetasThatLie) {
  const auto error_for = [](auto spoil) {
    Rig rig("terrainseg", caps_text("I420", 64, 48));
    GstBuffer* buffer = new_padded_frame(rig.info());
    spoil(gst_buffer_get_video_meta(buffer));
    EXPECT_EQ(rig.push(buffer), GST_FLOW_ERROR);
    const auto errors = rig.errors();
    return errors.empty() ? std::string() : errors[0].user;
  };
  EXPECT_NE(error_for([](GstVideoMeta* m) { m->offset[2] += 4000; }).find("plane 2"), std::string::npos);
  EXPECT_NE(error_for([](GstVideoMeta* m) { m->stride[0] = 1000; }).find("plane 0"), std::string::npos);
  EXPECT_NE(error_for([](GstVideoMeta* m) { m->stride[0] = -80; }).find("plane 0"), std::string::npos);
  EXPECT_NE(error_for([](GstVideoMeta* m) { m->stride[1] = 3; }).find("plane 1"), std::string::npos);
  EXPECT_NE(error_for([](GstVideoMeta* m) { m->stride[1] = G_MININT; }).find("plane 1"), std::string::npos);
  EXPECT_NE(error_for([](GstVideoMeta* m) { m->offset[0] = G_MAXSIZE - 10; }).find("plane 0"),
            std::string::npos);
  EXPECT_NE(error_for([](GstVideoMeta* m) { m->width = 32; }).find("less than"), std::string::npos);
  EXPECT_NE(error_for([](GstVideoMeta* m) { m->format = GST_VIDEO_FORMAT_NV12; }).find("NV12"),
            std::string::npos);
  EXPECT_NE(error_for([](GstVideoMeta* m) { m->n_planes = 2; }).find("planes"), std::string::npos);
}

TEST(Input, PlanesInMemoriesOfTheirOwn) {
  Rig rig("terrainseg", caps_text("I420", 64, 48));
  Owned<GstBuffer> whole(new_frame(rig.info()));
  GstBuffer* split = gst_buffer_new();
  gsize offset[GST_VIDEO_MAX_PLANES] = {};
  gint stride[GST_VIDEO_MAX_PLANES] = {};
  for (guint plane = 0; plane < 3; ++plane) {
    offset[plane] = GST_VIDEO_INFO_PLANE_OFFSET(&rig.info(), plane);
    stride[plane] = GST_VIDEO_INFO_PLANE_STRIDE(&rig.info(), plane);
    const gsize end =
        plane < 2 ? GST_VIDEO_INFO_PLANE_OFFSET(&rig.info(), plane + 1) : GST_VIDEO_INFO_SIZE(&rig.info());
    GstMemory* memory = gst_allocator_alloc(nullptr, end - offset[plane], nullptr);
    GstMapInfo map;
    gst_memory_map(memory, &map, GST_MAP_WRITE);
    gst_buffer_extract(whole.get(), offset[plane], map.data, map.size);
    gst_memory_unmap(memory, &map);
    gst_buffer_append_memory(split, memory);
  }
  gst_buffer_add_video_meta_full(split, GST_VIDEO_FRAME_FLAG_NONE, GST_VIDEO_FORMAT_I420, 64, 48, 3, offset,
                                 stride);
  EXPECT_EQ(rig.push(split), GST_FLOW_OK);
  Rig other("terrainseg", caps_text("I420", 64, 48));
  EXPECT_EQ(other.push(whole.release()), GST_FLOW_OK);
  const auto a = rig.pull(), b = other.pull();
  EXPECT_EQ(bytes_of(EstimateReader(a.get()).estimate().mask),
            bytes_of(EstimateReader(b.get()).estimate().mask));
}

TEST(Input, APlaneScatteredOverMemoriesIsAnErrorAndNotAnOverrun) {
  Rig rig("terrainseg", caps_text("I420", 64, 48));
  GstBuffer* buffer = gst_buffer_new();
  for (int i = 0; i < 3; ++i) // the luma plane ends in the second memory
    gst_buffer_append_memory(buffer, gst_allocator_alloc(nullptr, 1600, nullptr));
  gst_buffer_add_video_meta(buffer, GST_VIDEO_FRAME_FLAG_NONE, GST_VIDEO_FORMAT_I420, 64, 48);
  EXPECT_EQ(rig.push(buffer), GST_FLOW_ERROR);
  EXPECT_FALSE(only_error(rig).user.empty());
}

TEST(Input, AWindowThatDoesNotFitTheFrame) {
  for (const char* settings : {"window-width=400", "window-height=300", "window-x=150 window-width=100",
                               "window-bottom=200", "window-x=4000"}) {
    Rig rig(std::string("terrainseg ") + settings, caps_text("I420", 160, 120));
    EXPECT_EQ(rig.push(new_frame(rig.info())), GST_FLOW_ERROR) << settings;
    const Report error = only_error(rig);
    EXPECT_TRUE(error.contains("window")) << error.user;
  }
}

TEST(Input, TinyFramesHaveADefinedAnswer) {
  for (const char* preset : {"default", "paper"})
    for (const auto& [width, height] : {std::pair{1, 1}, {2, 1}, {1, 2}, {3, 3}, {8, 5}, {16, 1}, {1, 300}}) {
      for (int format = 0; format < pixel_format_count; ++format) {
        Rig rig(std::string("terrainseg overlay=true preset=") + preset,
                caps_text(format_name(format), width, height));
        for (int i = 0; i < 3; ++i) {
          const GstFlowReturn flow = rig.push(new_frame(rig.info(), i));
          if (flow != GST_FLOW_OK) {
            EXPECT_TRUE(only_error(rig).contains("window")) << width << "x" << height;
            break;
          }
          const auto out = rig.pull();
          const EstimateReader reader(out.get());
          ASSERT_TRUE(reader) << width << "x" << height << " " << format_name(format) << ": "
                              << reader.error();
          EXPECT_EQ(reader.estimate().mask.width, width);
        }
      }
    }
}

TEST(Input, BlackAndConstantFramesHaveADefinedAnswer) {
  for (int value : {0, 16, 128, 255})
    for (const char* preset : {"default", "paper"})
      for (const char* format : {"I420", "RGB"}) {
        Rig rig(std::string("terrainseg preset=") + preset, caps_text(format, 160, 120));
        for (int i = 0; i < 4; ++i) {
          GstBuffer* buffer = gst_buffer_new_allocate(nullptr, GST_VIDEO_INFO_SIZE(&rig.info()), nullptr);
          gst_buffer_memset(buffer, 0, static_cast<guint8>(value), GST_VIDEO_INFO_SIZE(&rig.info()));
          ASSERT_EQ(rig.push(buffer), GST_FLOW_OK);
          const auto out = rig.pull();
          const EstimateReader reader(out.get());
          ASSERT_TRUE(reader) << reader.error();
          EXPECT_EQ(reader.estimate().horizon_row, -1); // nothing to split
        }
      }
}

TEST(Input, FramesWithoutATimestamp) {
  Rig rig("terrainseg", caps_text("I420", 160, 120));
  for (int i = 0; i < 3; ++i) {
    GstBuffer* buffer = new_frame(rig.info());
    GST_BUFFER_PTS(buffer) = GST_BUFFER_DURATION(buffer) = GST_CLOCK_TIME_NONE;
    ASSERT_EQ(rig.push(buffer), GST_FLOW_OK);
    EXPECT_TRUE(EstimateReader(rig.pull().get()));
  }
}

// ---- training pixels from upstream -----------------------------------------------------------------------

GstBuffer* with_region(GstBuffer* buffer, guint x, guint y, guint w, guint h) {
  gst_buffer_add_video_region_of_interest_meta(buffer, GST_TERRAIN_TRAINING_ROI, x, y, w, h);
  return buffer;
}

GstBuffer* with_mask(GstBuffer* buffer, GstBuffer* mask) {
  GstCustomMeta* meta = gst_buffer_add_custom_meta(buffer, GST_TERRAIN_TRAINING_META_NAME);
  gst_structure_set(gst_custom_meta_get_structure(meta), "mask", GST_TYPE_BUFFER, mask, nullptr);
  gst_buffer_unref(mask);
  return buffer;
}

/// A mask that trains the upper part of the frame, the sky.
GstBuffer* sky_mask(int width, int height) {
  GstBuffer* mask = new_mask_buffer(width, height);
  gst_buffer_memset(mask, 0, 0, static_cast<gsize>(width) * height);
  gst_buffer_memset(mask, 0, 255, static_cast<gsize>(width) * (height / 4));
  return mask;
}

double blue_of(GstBuffer* buffer) {
  const EstimateReader reader(buffer);
  EXPECT_TRUE(reader);
  EXPECT_GT(reader.estimate().model_count, 0);
  return reader.estimate().models[0].mean[1] / 256.0; // U: sky 150, road 128
}

TEST(Training, TheWindowTrainsWhenNothingIsSupplied) {
  Rig rig("terrainseg", caps_text("I420", 320, 240));
  EXPECT_NEAR(blue_of(rig.step().get()), 128, 8.5);
}

TEST(Training, ARegionOfInterestTrainsInstead) {
  Rig rig("terrainseg", caps_text("I420", 320, 240));
  ASSERT_EQ(rig.push(with_region(new_frame(rig.info()), 40, 10, 240, 60)), GST_FLOW_OK);
  EXPECT_NEAR(blue_of(rig.pull().get()), 150, 8.5);
  EXPECT_TRUE(rig.warnings().empty());
}

TEST(Training, AMaskOfAnySizeTrainsInstead) {
  for (const auto& [width, height] : {std::pair{320, 240}, {33, 17}, {640, 480}}) {
    Rig rig("terrainseg", caps_text("I420", 320, 240));
    ASSERT_EQ(rig.push(with_mask(new_frame(rig.info()), sky_mask(width, height))), GST_FLOW_OK);
    EXPECT_NEAR(blue_of(rig.pull().get()), 150, 8.5) << width;
    EXPECT_TRUE(rig.warnings().empty());
  }
}

TEST(Training, RegionsOfAnotherTypeMeanNothing) {
  Rig rig("terrainseg", caps_text("I420", 320, 240));
  GstBuffer* buffer = new_frame(rig.info());
  gst_buffer_add_video_region_of_interest_meta(buffer, "face", 40, 10, 240, 60);
  ASSERT_EQ(rig.push(buffer), GST_FLOW_OK);
  EXPECT_NEAR(blue_of(rig.pull().get()), 128, 8.5);
}

TEST(Training, BadTrainingPixelsAreReportedOnceAndIgnored) {
  const auto warned = [](auto spoil) {
    Rig rig("terrainseg", caps_text("I420", 320, 240));
    for (int i = 0; i < 3; ++i) {
      EXPECT_EQ(rig.push(spoil(new_frame(rig.info(), i))), GST_FLOW_OK);
      EXPECT_TRUE(EstimateReader(rig.pull().get()));
    }
    return rig.warnings().size();
  };
  EXPECT_EQ(warned([](GstBuffer* b) { return with_region(b, 1000, 1000, 5, 5); }), 1u);
  EXPECT_EQ(warned([](GstBuffer* b) { return with_region(b, G_MAXUINT, 0, G_MAXUINT, 5); }), 1u);
  EXPECT_EQ(warned([](GstBuffer* b) { return with_mask(b, gst_buffer_new_allocate(nullptr, 10, nullptr)); }),
            1u);
  EXPECT_EQ(warned([](GstBuffer* b) {
              GstBuffer* mask = gst_buffer_new_allocate(nullptr, 10, nullptr);
              describe_mask(mask, 320, 240);
              return with_mask(b, mask);
            }),
            1u);
  EXPECT_EQ(warned([](GstBuffer* b) {
              gst_buffer_add_custom_meta(b, GST_TERRAIN_TRAINING_META_NAME);
              return b;
            }),
            1u);
  EXPECT_EQ(warned([](GstBuffer* b) { return with_region(b, 10, 10, 100, 100); }), 0u);
}

} // namespace
} // namespace terrainseg::test
