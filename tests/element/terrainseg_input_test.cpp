// SPDX-License-Identifier: LGPL-2.1-or-later
// terrainseg with bad or strange input: an error that names the cause, or a defined answer.
#include <gst/terrainseg/terrainsegmeta.h>

#include "../support/frames.hpp"
#include "harness.hpp"

namespace terrainseg::test {
namespace {

Report only_error(Rig& rig) {
  const auto errors = rig.errors();
  EXPECT_EQ(errors.size(), 1u);
  return errors.empty() ? Report{} : errors[0];
}

std::vector<std::string> filters() {
  std::vector<std::string> names = {"terrainseg"};
  if (have("terrainreference"))
    names.emplace_back("terrainreference");
  return names;
}

TEST(Input, InterlacedIsRefusedWithAHint) {
  for (const std::string& element : filters())
    for (const char* mode : {"interleaved", "fields"}) {
      Rig rig(element);
      Owned<GstCaps> parsed(
          gst_caps_from_string((caps_text("I420", 64, 64) + ",interlace-mode=" + mode).c_str()));
      gst_harness_set_src_caps(rig.harness(), parsed.release());
      Owned<GstBuffer> buffer(gst_buffer_new_allocate(nullptr, 64 * 64 * 2, nullptr));
      EXPECT_EQ(rig.push(buffer.release()), GST_FLOW_NOT_NEGOTIATED) << mode;
      const auto errors = rig.errors();
      ASSERT_EQ(errors.size(), 1u) << element << " " << mode << ": said once";
      EXPECT_TRUE(errors[0].contains("deinterlace"));
      EXPECT_TRUE(errors[0].contains(mode));
    }
}

TEST(Input, MixedVideoPassesWhileItsFramesAreProgressive) {
  for (const std::string& element : filters()) {
    Rig rig(element, caps_text("I420", 64, 48, ",interlace-mode=mixed"));
    Rig plain(element, caps_text("I420", 64, 48));
    const auto mixed = rig.step(), progressive = plain.step();
    const EstimateReader a(mixed.get()), b(progressive.get());
    ASSERT_TRUE(a && b) << element;
    EXPECT_EQ(bytes_of(a.estimate().mask), bytes_of(b.estimate().mask)) << element;
    GstBuffer* fields = new_frame(rig.info(), 1);
    GST_BUFFER_FLAG_SET(fields, GST_VIDEO_BUFFER_FLAG_INTERLACED | GST_VIDEO_BUFFER_FLAG_TFF);
    EXPECT_EQ(rig.push(fields), GST_FLOW_ERROR) << element;
    const Report error = only_error(rig);
    EXPECT_TRUE(error.contains("deinterlace") && error.contains("mixed")) << element << error.user;
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

/// The elements that read or draw frames, as far as they are there.
std::vector<std::string> frame_elements() {
  std::vector<std::string> names = {"terrainseg", "terrainseg overlay=true", "terrainoverlay"};
  if (have("terrainreference"))
    names.insert(names.end(), {"terrainreference", "terrainreference overlay=true"});
  return names;
}

/// A frame of 64 x 48 that every one of them reads: terrainoverlay draws the metadata onto it.
GstBuffer* frame_to_read(const GstVideoInfo& info) {
  GstBuffer* buffer = new_padded_frame(info);
  Owned<GstBuffer> mask(new_mask_buffer(64, 48));
  gst_buffer_memset(mask.get(), 0, 255, 64 * 48);
  Estimate estimate;
  estimate.frame_width = 64;
  estimate.frame_height = 48;
  estimate.mask_region = {0, 0, 64, 48};
  EXPECT_TRUE(attach(buffer, estimate, mask.get(), nullptr));
  return buffer;
}

TEST(Input, AVideoMetaThatClaimsMoreThanTheCapsIsReadAtTheCapsSize) {
  for (const std::string& element : frame_elements())
    for (const auto& [width, height] : {std::pair{64, 8000}, {100000, 48}, {G_MAXINT, G_MAXINT}}) {
      Rig rig(element, caps_text("I420", 64, 48));
      GstBuffer* buffer = frame_to_read(rig.info());
      gst_buffer_get_video_meta(buffer)->width = static_cast<guint>(width);
      gst_buffer_get_video_meta(buffer)->height = static_cast<guint>(height);
      EXPECT_EQ(rig.push(buffer), GST_FLOW_OK) << element;
      const auto out = rig.pull();
      const EstimateReader reader(out.get());
      ASSERT_TRUE(reader) << element;
      EXPECT_EQ(reader.estimate().frame_width, 64) << element;
      EXPECT_EQ(reader.estimate().frame_height, 48) << element;
    }
}

TEST(Input, StridesAndOffsetsThatLieAreAnErrorInEveryElement) {
  const auto refuses = [](const std::string& element, auto spoil) {
    Rig rig(element, caps_text("I420", 64, 48));
    GstBuffer* buffer = frame_to_read(rig.info());
    spoil(*gst_buffer_get_video_meta(buffer));
    EXPECT_EQ(rig.push(buffer), GST_FLOW_ERROR) << element;
    EXPECT_TRUE(only_error(rig).contains("plane")) << element;
  };
  for (const std::string& element : frame_elements()) {
    refuses(element, [](GstVideoMeta& m) { m.stride[0] = G_MAXINT; });
    refuses(element, [](GstVideoMeta& m) { m.stride[2] = G_MININT; });
    refuses(element, [](GstVideoMeta& m) { m.stride[1] = 0; });
    refuses(element, [](GstVideoMeta& m) { m.offset[1] = G_MAXSIZE; });
    refuses(element, [](GstVideoMeta& m) { m.offset[2] = G_MAXSIZE - 24 * 60; });
  }
}

// ---- a crop that is metadata only ------------------------------------------------------------------------

bool offers(Rig& rig, GType api) {
  GstQuery* query = gst_query_new_allocation(
      Owned<GstCaps>(gst_caps_from_string(caps_text("I420", 64, 48).c_str())).get(), TRUE);
  EXPECT_TRUE(gst_pad_peer_query(rig.harness()->srcpad, query));
  const bool found = gst_query_find_allocation_meta(query, api, nullptr);
  gst_query_unref(query);
  return found;
}

TEST(Input, TheCropOfASinkIsNotOfferedUpstream) {
  for (const std::string& element : frame_elements()) {
    Rig rig(element, caps_text("I420", 64, 48));
    for (int twice = 0; twice < 2; ++twice)
      gst_harness_add_propose_allocation_meta(rig.harness(), GST_VIDEO_CROP_META_API_TYPE, nullptr);
    gst_harness_add_propose_allocation_meta(rig.harness(), GST_VIDEO_OVERLAY_COMPOSITION_META_API_TYPE,
                                            nullptr);
    EXPECT_FALSE(offers(rig, GST_VIDEO_CROP_META_API_TYPE)) << element;
    EXPECT_TRUE(offers(rig, GST_VIDEO_META_API_TYPE)) << element;
    EXPECT_TRUE(offers(rig, GST_VIDEO_OVERLAY_COMPOSITION_META_API_TYPE))
        << element << ": what else it takes";
  }
}

/// Masks of a frame whose lower rows videocrop takes away, in front of a sink that takes crop metadata.
std::vector<guint8> mask_behind_crop(const std::string& between) {
  auto pipeline =
      make_element("terrainscenesrc num-buffers=5 ! " + caps_text("I420", 320, 240) +
                   " ! videocrop bottom=80 ! " + between + "terrainseg ! fakevideosink name=sink sync=false");
  Owned<GstElement> sink(gst_bin_get_by_name(GST_BIN(pipeline.get()), "sink"));
  Owned<GstElement> inner(gst_bin_get_by_name(GST_BIN(sink.get()), "sink"));
  g_object_set(inner.get(), "enable-last-sample", TRUE, nullptr);
  std::vector<guint8> mask;
  Owned<GstBus> bus(gst_element_get_bus(pipeline.get()));
  gst_element_set_state(pipeline.get(), GST_STATE_PLAYING);
  Owned<GstMessage> end(gst_bus_timed_pop_filtered(
      bus.get(), 20 * GST_SECOND, static_cast<GstMessageType>(GST_MESSAGE_EOS | GST_MESSAGE_ERROR)));
  GstSample* sample = nullptr;
  g_object_get(inner.get(), "last-sample", &sample, nullptr);
  if (sample) {
    const EstimateReader reader(gst_sample_get_buffer(sample));
    EXPECT_TRUE(reader);
    EXPECT_EQ(reader.estimate().frame_height, 160);
    mask = bytes_of(reader.estimate().mask);
    gst_sample_unref(sample);
  }
  return mask;
}

TEST(Input, WhatIsCroppedOffIsNotLearned) {
  if (!have("videocrop") || !have("fakevideosink"))
    GTEST_SKIP() << "videocrop or fakevideosink is not here";
  const auto cropped = mask_behind_crop(""), copied = mask_behind_crop("identity drop-allocation=true ! ");
  ASSERT_FALSE(copied.empty());
  EXPECT_EQ(cropped, copied);
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

Rectangle window_of(GstBuffer* buffer) {
  return EstimateReader(buffer).estimate().window;
}

TEST(Window, ThatDoesNotFitIsMovedAndCutWithOneWarning) {
  const std::pair<const char*, Rectangle> cases[] = {
      {"window-width=400", {0, 102, 160, 18}}, {"window-height=300", {56, 0, 48, 120}},
      {"window-bottom=5000", {56, 0, 48, 18}}, {"window-x=150 window-width=100", {60, 102, 100, 18}},
      {"window-bottom=200", {56, 0, 48, 18}},  {"window-x=4000", {112, 102, 48, 18}},
      {"window-height=121", {56, 0, 48, 120}},
  };
  for (const auto& [settings, window] : cases) {
    Rig rig(std::string("terrainseg ") + settings, caps_text("I420", 160, 120));
    for (int i = 0; i < 3; ++i)
      EXPECT_EQ(window_of(rig.step().get()), window) << settings;
    const auto warnings = rig.warnings();
    ASSERT_EQ(warnings.size(), 1u) << settings;
    EXPECT_TRUE(warnings[0].contains("window")) << warnings[0].user;
    EXPECT_TRUE(warnings[0].contains("160 x 120")) << warnings[0].user;
    EXPECT_TRUE(warnings[0].contains("window-rect")) << warnings[0].user;
    EXPECT_EQ(rig.counter("learned"), 3u) << settings;
  }
}

TEST(Window, OfTheReferenceIsMovedAndCutToo) {
  if (!have("terrainreference"))
    GTEST_SKIP() << "terrainreference is not here";
  const std::pair<const char*, Rectangle> cases[] = {{"window-height=300", {64, 0, 32, 120}},
                                                     {"window-bottom=5000", {64, 0, 32, 16}},
                                                     {"window-x=4000", {128, 104, 32, 16}}};
  for (const auto& [settings, window] : cases) {
    Rig rig(std::string("terrainreference ") + settings, caps_text("I420", 160, 120));
    for (int i = 0; i < 3; ++i) {
      const auto out = rig.step();
      EXPECT_EQ(window_of(out.get()), window) << settings;
      const EstimateReader reader(out.get());
      ASSERT_TRUE(reader);
      EXPECT_EQ(reader.estimate().flags & flag_starved, 0u) << settings;
    }
    const auto warnings = rig.warnings();
    ASSERT_EQ(warnings.size(), 1u) << settings;
    EXPECT_TRUE(warnings[0].contains("160 x 120")) << warnings[0].user;
    EXPECT_FALSE(warnings[0].contains("window-rect")) << "it has none: " << warnings[0].user;
  }
}

TEST(Window, FollowsAStreamThatShrinksAndGrows) {
  Rig rig("terrainseg window-height=100 window-bottom=50", caps_text("I420", 320, 240));
  EXPECT_EQ(window_of(rig.step().get()), (Rectangle{112, 90, 96, 100}));
  EXPECT_TRUE(rig.warnings().empty());
  rig.set_caps(caps_text("I420", 160, 120));
  EXPECT_EQ(window_of(rig.step().get()), (Rectangle{56, 0, 48, 100}));
  EXPECT_EQ(rig.warnings().size(), 1u);
  rig.set_caps(caps_text("I420", 320, 240)); // what was set comes back
  EXPECT_EQ(window_of(rig.step().get()), (Rectangle{112, 90, 96, 100}));
  EXPECT_TRUE(rig.warnings().empty());
  EXPECT_EQ(rig.counter("learned"), 3u);
}

TEST(Window, IsToldOnceForEachWindowAndFrameSize) {
  Rig rig("terrainseg", caps_text("I420", 160, 120));
  rig.step();
  g_object_set(rig.element(), "window-bottom", 5000, nullptr);
  rig.step();
  EXPECT_EQ(rig.warnings().size(), 1u);
  g_object_set(rig.element(), "caution", 3, nullptr); // nothing about the window
  rig.step();
  EXPECT_TRUE(rig.warnings().empty());
  g_object_set(rig.element(), "window-bottom", 6000, nullptr);
  rig.step();
  EXPECT_EQ(rig.warnings().size(), 1u);
  int bottom = 0;
  g_object_get(rig.element(), "window-bottom", &bottom, nullptr);
  EXPECT_EQ(bottom, 6000); // what was set is kept
}

TEST(Window, AsFractionsFollowsTheSizeOfTheFrame) {
  Rig rig("terrainseg window-rect=0.25,0.5,0.5,0.25 window-bottom=5000", caps_text("I420", 320, 240));
  EXPECT_EQ(window_of(rig.step().get()), (Rectangle{80, 120, 160, 60}));
  rig.set_caps(caps_text("NV12", 160, 90));
  EXPECT_EQ(window_of(rig.step().get()), (Rectangle{40, 45, 80, 23}));
  g_object_set(rig.element(), "window-rect", "0,0.5,1,0.5", nullptr);
  EXPECT_EQ(window_of(rig.step().get()), (Rectangle{0, 45, 160, 45}));
  EXPECT_TRUE(rig.warnings().empty());
  g_object_set(rig.element(), "window-rect", "", "window-bottom", 0, nullptr);
  EXPECT_EQ(window_of(rig.step().get()), (Rectangle{56, 77, 48, 13}));
}

TEST(Window, FractionsThatAreNoneLeaveTheOldOnesInForce) {
  Rig rig("terrainseg window-rect=0,0.5,1,0.5", caps_text("I420", 160, 120));
  for (const char* wrong : {"0.1,0.2", "0,0,1,1.5", "left", "0.5,0,0.6,1"}) {
    g_object_set(rig.element(), "window-rect", wrong, nullptr);
    EXPECT_EQ(window_of(rig.step().get()), (Rectangle{0, 60, 160, 60})) << wrong;
    const auto warnings = rig.warnings();
    ASSERT_EQ(warnings.size(), 1u) << wrong;
    EXPECT_TRUE(warnings[0].contains("window-rect")) << warnings[0].user;
    EXPECT_TRUE(warnings[0].contains(wrong)) << warnings[0].user;
  }
}

/// As an adaptive stream does: the size changes between frames of a playing pipeline.
TEST(Window, SurvivesAnAdaptiveStreamInAPlayingPipeline) {
  auto pipeline =
      make_element("concat name=c ! terrainseg window-height=150 ! fakesink "
                   "terrainscenesrc num-buffers=4 ! video/x-raw,format=I420,width=320,height=240 ! c. "
                   "terrainscenesrc num-buffers=4 ! video/x-raw,format=I420,width=160,height=120 ! c. "
                   "terrainscenesrc num-buffers=4 ! video/x-raw,format=I420,width=640,height=360 ! c.");
  EXPECT_EQ(run_pipeline(pipeline.get()), "");
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

// ---- a picture without colour ---------------------------------------------------------------------------

/// Makes every colour of the frame the grey of its brightness, as videoconvert does with GRAY8.
void take_colour_away(GstBuffer* buffer, const GstVideoInfo& info) {
  GstVideoFrame frame;
  ASSERT_TRUE(gst_video_frame_map(&frame, &info, buffer, GST_MAP_READWRITE));
  for (guint component = 1; component < 3; ++component)
    for (int y = 0; y < GST_VIDEO_FRAME_COMP_HEIGHT(&frame, component); ++y)
      for (int x = 0; x < GST_VIDEO_FRAME_COMP_WIDTH(&frame, component); ++x) {
        const auto at = [&](guint c) {
          return static_cast<guint8*>(GST_VIDEO_FRAME_COMP_DATA(&frame, c)) +
                 GST_VIDEO_FRAME_COMP_POFFSET(&frame, c) % 2 * (GST_VIDEO_FRAME_COMP_DEPTH(&frame, c) > 8) +
                 y * GST_VIDEO_FRAME_COMP_STRIDE(&frame, c) + x * GST_VIDEO_FRAME_COMP_PSTRIDE(&frame, c);
        };
        const guint depth = GST_VIDEO_FRAME_COMP_DEPTH(&frame, component);
        if (depth > 8)
          GST_WRITE_UINT16_LE(at(component),
                              128 << (depth - 8) << GST_VIDEO_FORMAT_INFO_SHIFT(info.finfo, component));
        else
          *at(component) = GST_VIDEO_INFO_IS_RGB(&info) ? *at(0) : 128;
      }
  gst_video_frame_unmap(&frame);
}

/// What is said of so many frames, without colour but every `coloured`-th. The picture is the same each time:
/// it is drawn once.
std::vector<Report> said_of(Rig& rig, int frames, int coloured = 0) {
  const Owned<GstBuffer> picture(new_frame(rig.info())), grey(new_frame(rig.info()));
  take_colour_away(grey.get(), rig.info());
  for (int i = 0; i < frames; ++i) {
    const bool in_colour = coloured != 0 && i % coloured == 0;
    GstBuffer* buffer = gst_buffer_copy_deep(in_colour ? picture.get() : grey.get());
    GST_BUFFER_PTS(buffer) = gst_util_uint64_scale(i, GST_SECOND, 30);
    EXPECT_EQ(rig.push(buffer), GST_FLOW_OK);
    rig.pull();
  }
  return rig.warnings();
}

class Colourless : public testing::TestWithParam<int> {};

TEST_P(Colourless, PicturesInAColourFormatAreToldOnce) {
  const std::string format = format_name(GetParam());
  Rig rig("terrainseg", caps_text(format, 64, 48));
  if (GST_VIDEO_INFO_IS_GRAY(&rig.info())) {
    EXPECT_TRUE(said_of(rig, 130).empty()) << "a format that promises no colour";
    return;
  }
  EXPECT_TRUE(said_of(rig, 59).empty());
  const auto said = said_of(rig, 71);
  ASSERT_EQ(said.size(), 1u);
  EXPECT_TRUE(said[0].contains(format.c_str())) << said[0].user;
  EXPECT_TRUE(said[0].contains("video/x-raw,format=NV12")) << said[0].user;
  EXPECT_TRUE(said[0].contains("GRAY8")) << said[0].user;
}

INSTANTIATE_TEST_SUITE_P(All, Colourless, testing::Range(0, pixel_format_count),
                         [](const auto& info) { return std::string(format_name(info.param)); });

TEST(Colour, PicturesThatHaveItAreNotTold) {
  for (int format = 0; format < pixel_format_count; ++format) {
    // What looks for colour is the same in both presets; this one takes a tenth of the time.
    Rig rig("terrainseg preset=paper", caps_text(format_name(format), 64, 48));
    EXPECT_TRUE(said_of(rig, 130, 1).empty()) << format_name(format);
    EXPECT_TRUE(said_of(rig, 130, 50).empty()) << format_name(format) << ", one picture in 50";
  }
}

TEST(Colour, ALensCapTellsNothing) {
  Rig rig("terrainseg", caps_text("NV12", 160, 120));
  for (int i = 0; i < 130; ++i) {
    GstBuffer* buffer = new_frame(rig.info(), i);
    gst_buffer_memset(buffer, 0, 16, 160 * 120);
    gst_buffer_memset(buffer, 160 * 120, 128, 160 * 60);
    EXPECT_EQ(rig.push(buffer), GST_FLOW_OK);
    rig.pull();
  }
  EXPECT_TRUE(rig.warnings().empty());
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
  // In two pieces of memory, of which one row after the other would run past the first.
  EXPECT_EQ(warned([](GstBuffer* b) {
              GstBuffer* mask = gst_buffer_new_allocate(nullptr, 160 * 240, nullptr);
              gst_buffer_append_memory(mask, gst_allocator_alloc(nullptr, 160 * 240, nullptr));
              describe_mask(mask, 320, 240);
              return with_mask(b, mask);
            }),
            1u);
  // One column of ten million rows: the product with a frame's height is no int.
  EXPECT_EQ(warned([](GstBuffer* b) {
              GstBuffer* mask = gst_buffer_new_allocate(nullptr, 10000000, nullptr);
              describe_mask(mask, 1, 10000000);
              return with_mask(b, mask);
            }),
            1u);
  EXPECT_EQ(warned([](GstBuffer* b) {
              GstBuffer* mask = sky_mask(320, 240);
              gst_buffer_get_video_meta(mask)->stride[0] = -320;
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

// ---- vetoed pixels from upstream -------------------------------------------------------------------------

GstBuffer* with_veto(GstBuffer* buffer, GstBuffer* mask) {
  GstCustomMeta* meta = gst_buffer_add_custom_meta(buffer, GST_TERRAIN_VETO_META_NAME);
  gst_structure_set(gst_custom_meta_get_structure(meta), "mask", GST_TYPE_BUFFER, mask, nullptr);
  gst_buffer_unref(mask);
  return buffer;
}

/// A mask whose left half is vetoed.
GstBuffer* left_half(int width, int height) {
  GstBuffer* mask = new_mask_buffer(width, height);
  for (int y = 0; y < height; ++y) {
    const auto row = static_cast<gsize>(y) * static_cast<gsize>(width), half = static_cast<gsize>(width / 2);
    gst_buffer_memset(mask, row, 255, half);
    gst_buffer_memset(mask, row + half, 0, static_cast<gsize>(width) - half);
  }
  return mask;
}

/// Per mille of a rectangle of the mask that is traversable.
int traversable_in(const Rectangle& r, GstBuffer* out) {
  const EstimateReader reader(out);
  EXPECT_TRUE(reader);
  int count = 0;
  for (int y = r.y; y < r.y + r.height; ++y)
    for (int x = r.x; x < r.x + r.width; ++x)
      count += reader.estimate().mask.plane.row(y)[x] == mask_traversable;
  return 1000 * count / (r.width * r.height);
}

const Rectangle near_left{130, 180, 20, 20}, near_right{170, 180, 20, 20}; // on the road of 320 x 240

GstBuffer* with_roi(GstBuffer* buffer, const char* type, const Rectangle& r) {
  gst_buffer_add_video_region_of_interest_meta(buffer, type, static_cast<guint>(r.x), static_cast<guint>(r.y),
                                               static_cast<guint>(r.width), static_cast<guint>(r.height));
  return buffer;
}

TEST(Veto, TheRoadIsFreeWithoutOne) {
  Rig rig("terrainseg", caps_text("I420", 320, 240));
  rig.step();
  const auto out = rig.step();
  EXPECT_EQ(traversable_in(near_left, out.get()), 1000);
  EXPECT_EQ(traversable_in(near_right, out.get()), 1000);
}

TEST(Veto, AMaskOfAnySizeTakesGroundAway) {
  for (const char* element : {"terrainseg", "terrainseg preset=paper"})
    for (const auto& [width, height] : {std::pair{320, 240}, {32, 16}, {640, 480}}) {
      Rig rig(element, caps_text("I420", 320, 240));
      for (int i = 0; i < 3; ++i) {
        ASSERT_EQ(rig.push(with_veto(new_frame(rig.info(), i), left_half(width, height))), GST_FLOW_OK);
        const auto out = rig.pull();
        EXPECT_EQ(traversable_in(near_left, out.get()), 0) << element << " " << width;
        EXPECT_GT(traversable_in(near_right, out.get()), 700) << element << " " << width; // paper's is noisy
        const EstimateReader reader(out.get());
        for (int x = 0; x < 160; ++x)
          EXPECT_EQ(reader.estimate().boundary[static_cast<std::size_t>(x)], 240);
      }
      EXPECT_TRUE(rig.warnings().empty());
    }
}

TEST(Veto, SeveralMasksAddUp) {
  Rig rig("terrainseg", caps_text("I420", 320, 240));
  GstBuffer* right = new_mask_buffer(320, 240);
  gst_buffer_memset(right, 0, 255, 320 * 240);
  for (gsize y = 0; y < 240; ++y)
    gst_buffer_memset(right, y * 320, 0, 160);
  ASSERT_EQ(rig.push(with_veto(with_veto(new_frame(rig.info()), left_half(320, 240)), right)), GST_FLOW_OK);
  const auto out = rig.pull();
  EXPECT_TRUE(EstimateReader(out.get()).estimate().flags & flag_starved);
  EXPECT_EQ(traversable_in({0, 0, 320, 240}, out.get()), 0);
}

TEST(Veto, RegionsOfChosenTypesAreVetoes) {
  const auto seen = [](const char* element, const char* type) {
    Rig rig(element, caps_text("I420", 320, 240));
    rig.step();
    EXPECT_EQ(rig.push(with_roi(new_frame(rig.info(), 1), type, {120, 160, 40, 60})), GST_FLOW_OK);
    const auto out = rig.pull();
    EXPECT_EQ(traversable_in(near_right, out.get()), 1000) << element << " " << type;
    EXPECT_TRUE(rig.warnings().empty());
    const int left = traversable_in(near_left, out.get());
    EXPECT_TRUE(left == 0 || left == 1000) << left;
    return left == 0;
  };
  EXPECT_TRUE(seen("terrainseg", GST_TERRAIN_VETO_ROI));
  EXPECT_FALSE(seen("terrainseg", "person"));
  EXPECT_TRUE(seen("terrainseg veto-roi-types=person", "person"));
  EXPECT_TRUE(seen("terrainseg veto-roi-types=\"car, person\"", "person"));
  EXPECT_FALSE(seen("terrainseg veto-roi-types=\"car, person\"", "face"));
  EXPECT_FALSE(seen("terrainseg veto-roi-types=\"car, person\"", "car, person"));
  EXPECT_TRUE(seen("terrainseg veto-roi-types=car", GST_TERRAIN_VETO_ROI));
  EXPECT_TRUE(seen("terrainseg veto-roi-types=*", "anything"));
}

TEST(Veto, TheTypesChangeWhilePlaying) {
  Rig rig("terrainseg", caps_text("I420", 320, 240));
  const auto left = [&](const char* types) {
    g_object_set(rig.element(), "veto-roi-types", types, nullptr);
    EXPECT_EQ(rig.push(with_roi(new_frame(rig.info()), "person", {120, 160, 40, 60})), GST_FLOW_OK);
    return traversable_in(near_left, rig.pull().get());
  };
  EXPECT_GT(left("car"), 900);
  EXPECT_EQ(left("person"), 0);
  EXPECT_EQ(left("*"), 0);
  EXPECT_GT(left(nullptr), 900);
}

TEST(Veto, TrainingRegionsAreNoVetoes) {
  Rig rig("terrainseg veto-roi-types=*", caps_text("I420", 320, 240));
  ASSERT_EQ(rig.push(with_region(new_frame(rig.info()), 120, 160, 80, 60)), GST_FLOW_OK);
  EXPECT_GT(traversable_in(near_left, rig.pull().get()), 900);
}

TEST(Veto, OfTheWindowIsNotLearned) {
  Rig rig("terrainseg", caps_text("I420", 320, 240));
  const guint before = rig.generation_after(3);
  ASSERT_EQ(rig.push(with_roi(new_frame(rig.info(), 3), GST_TERRAIN_VETO_ROI, {0, 180, 320, 60})),
            GST_FLOW_OK);
  const auto out = rig.pull();
  EXPECT_EQ(EstimateReader(out.get()).estimate().model_generation, before);
  EXPECT_EQ(EstimateReader(out.get()).estimate().flags & (flag_learned | flag_starved | flag_blocked),
            flag_starved | flag_blocked);
}

TEST(Veto, BadOnesAreReportedOnceAndIgnored) {
  const auto warned = [](auto spoil) {
    Rig rig("terrainseg", caps_text("I420", 320, 240));
    for (int i = 0; i < 3; ++i) {
      EXPECT_EQ(rig.push(spoil(new_frame(rig.info(), i))), GST_FLOW_OK);
      EXPECT_GT(traversable_in(near_right, rig.pull().get()), 900);
    }
    const auto warnings = rig.warnings();
    EXPECT_LE(warnings.size(), 1u);
    return warnings.empty() ? std::string() : warnings[0].user;
  };
  EXPECT_NE(warned([](GstBuffer* b) {
              return with_roi(b, GST_TERRAIN_VETO_ROI, {1000, 1000, 5, 5});
            }).find("terrain-veto is empty or outside the frame"),
            std::string::npos);
  EXPECT_NE(warned([](GstBuffer* b) {
              return with_roi(b, GST_TERRAIN_VETO_ROI, {10, 10, 0, 5});
            }).find("empty"),
            std::string::npos);
  EXPECT_EQ(warned([](GstBuffer* b) { return with_roi(b, "person", {1000, 1000, 5, 5}); }), "");
  EXPECT_EQ(warned([](GstBuffer* b) { return with_roi(b, GST_TERRAIN_VETO_ROI, {300, 100, 900, 900}); }), "");
  EXPECT_NE(warned([](GstBuffer* b) {
              return with_veto(b, gst_buffer_new_allocate(nullptr, 10, nullptr));
            }).find("GstTerrainVetoMeta: the mask is not GRAY8"),
            std::string::npos);
  EXPECT_NE(warned([](GstBuffer* b) {
              GstBuffer* mask = gst_buffer_new_allocate(nullptr, 10, nullptr);
              describe_mask(mask, 320, 240);
              return with_veto(b, mask);
            }).find("shorter"),
            std::string::npos);
  EXPECT_NE(warned([](GstBuffer* b) {
              gst_buffer_add_custom_meta(b, GST_TERRAIN_VETO_META_NAME);
              return b;
            }).find("needs a field 'mask'"),
            std::string::npos);
  EXPECT_NE(warned([](GstBuffer* b) {
              for (int i = 0; i < 9; ++i) {
                GstBuffer* mask = new_mask_buffer(8, 8);
                gst_buffer_memset(mask, 0, 0, 64);
                with_veto(b, mask);
              }
              return b;
            }).find("more than 8"),
            std::string::npos);
  // A bad mask does not take the good one's effect.
  Rig rig("terrainseg", caps_text("I420", 320, 240));
  GstBuffer* frame = with_veto(new_frame(rig.info()), gst_buffer_new_allocate(nullptr, 10, nullptr));
  ASSERT_EQ(rig.push(with_veto(frame, left_half(320, 240))), GST_FLOW_OK);
  EXPECT_EQ(traversable_in(near_left, rig.pull().get()), 0);
  EXPECT_EQ(rig.warnings().size(), 1u);
}

// Noise in blocks of 8 x 8 pixels; what lies above row 190 moves by five blocks a frame.
GstBuffer* frame_with_dashboard(int index) {
  GstBuffer* buffer = gst_buffer_new_allocate(nullptr, 320 * 240, nullptr);
  GstMapInfo map;
  EXPECT_TRUE(gst_buffer_map(buffer, &map, GST_MAP_WRITE));
  for (int y = 0; y < 240; ++y)
    for (int x = 0; x < 320; ++x)
      map.data[y * 320 + x] =
          static_cast<guint8>(90 + noise_at(x / 8 + (y < 190 ? 5 * index : 0), y / 8, 2, 6));
  gst_buffer_unmap(buffer, &map);
  GST_BUFFER_PTS(buffer) = static_cast<GstClockTime>(index) * GST_SECOND / 30;
  return buffer;
}

TEST(Input, ADashboardInTheWindowIsWarnedOfOnce) {
  for (const bool guarded : {true, false}) {
    Rig rig(guarded ? "terrainseg" : "terrainseg window-guard=false", caps_text("GRAY8", 320, 240));
    guint32 flags = 0;
    for (int k = 0; k < 40; ++k) {
      ASSERT_EQ(rig.push(frame_with_dashboard(k)), GST_FLOW_OK);
      const auto out = rig.pull();
      flags = EstimateReader(out.get()).estimate().flags;
      EXPECT_EQ((flags & flag_window_still) != 0, guarded && k >= 8) << k;
    }
    const auto warnings = rig.warnings();
    ASSERT_EQ(warnings.size(), guarded ? 1u : 0u);
    EXPECT_TRUE(!guarded || warnings[0].contains("window-bottom"));
  }
}

} // namespace
} // namespace terrainseg::test
