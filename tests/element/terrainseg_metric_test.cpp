// SPDX-License-Identifier: LGPL-2.1-or-later
// terrainseg in metres: calibration, mount, poses, and the wall clock.
#include <gst/terrainseg/terrainsegmeta.h>

#include <glib/gstdio.h>

#include <cmath>
#include <limits>
#include <numbers>

#include "harness.hpp"
#include "support/times.hpp"

namespace terrainseg::test {
namespace {

constexpr int width = 160, height = 120;
const std::string caps = caps_text("I420", width, height);
constexpr double focal = 138.5, center_x = 79.5, center_y = 59.5;
constexpr double degree = std::numbers::pi / 180;

/// A file that goes when the test ends.
class TemporaryFile {
 public:
  explicit TemporaryFile(const std::string& text) {
    gchar* name = nullptr;
    const int handle = g_file_open_tmp("terrainseg-XXXXXX.yaml", &name, nullptr);
    g_close(handle, nullptr);
    path = name;
    g_free(name);
    EXPECT_TRUE(g_file_set_contents(path.c_str(), text.data(), static_cast<gssize>(text.size()), nullptr));
  }
  ~TemporaryFile() { g_unlink(path.c_str()); }
  TemporaryFile(const TemporaryFile&) = delete;
  TemporaryFile& operator=(const TemporaryFile&) = delete;
  std::string path;
};

std::string calibration(int w = width, int h = height, double scale = 1) {
  const auto number = [](double value) { return std::to_string(value); };
  return "image_width: " + std::to_string(w) + "\nimage_height: " + std::to_string(h) +
         "\ncamera_matrix:\n  rows: 3\n  cols: 3\n  data: [" + number(focal * scale) + ", 0, " +
         number((center_x + 0.5) * scale - 0.5) + ", 0, " + number(focal * scale) + ", " +
         number((center_y + 0.5) * scale - 0.5) + ", 0, 0, 1]\n";
}

/// Frames of the road through a terrainseg that knows how its camera stands.
class Metric : public testing::Test {
 protected:
  std::string with(const std::string& mount = "height=0.5,pitch=10deg", const std::string& more = "") const {
    return "terrainseg camera-info=" + camera.path + " mount=" + mount + " " + more;
  }
  /// A pose in degrees at a running time in milliseconds.
  static GstEvent* pose(double roll, double pitch, guint64 ms, bool upstream = false) {
    GstStructure* fields = gst_structure_new(GST_TERRAIN_SEG_POSE_EVENT, "roll", G_TYPE_DOUBLE, roll * degree,
                                             "pitch", G_TYPE_DOUBLE, pitch * degree, "running-time",
                                             G_TYPE_UINT64, guint64{ms * GST_MSECOND}, nullptr);
    return gst_event_new_custom(upstream ? GST_EVENT_CUSTOM_UPSTREAM : GST_EVENT_CUSTOM_DOWNSTREAM_OOB,
                                fields);
  }
  static bool has_metres(GstBuffer* buffer) {
    return gst_buffer_get_terrain_metric_structure(buffer, nullptr) != nullptr;
  }

  TemporaryFile camera{calibration()};
};

/// Where a boundary's row in a column lies on the ground, by the formula for a camera without roll:
/// X = h / tan (p + atan (yn)). Written apart from the projection, which rotates rays.
struct Expected {
  double range, bearing;
};
Expected expected(int column, int row, double h, double pitch) {
  const double x = (column - center_x) / focal, y = (row - 0.5 - center_y) / focal;
  const double forward = h / std::tan(pitch + std::atan(y));
  const double depth = forward * std::cos(pitch) + h * std::sin(pitch);
  const double left = -x * depth;
  return {std::hypot(forward, left), std::atan2(left, forward)};
}

TEST_F(Metric, ColumnsAreWhereTheirRowsMeetTheGround) {
  Rig rig(with() + "range-max=4", caps);
  Owned<GstBuffer> last;
  for (int i = 0; i < 8; ++i)
    last = rig.step();
  const EstimateReader reader(last.get());
  const MetricReader metres(last.get());
  ASSERT_TRUE(metres) << (metres.error() ? metres.error() : "none");
  const MetricEstimate& m = metres.metric();
  const auto& boundary = reader.estimate().boundary;
  ASSERT_EQ(m.ranges.size(), boundary.size());
  int measured = 0, free = 0;
  for (int i = 0; i < width; ++i) {
    const Expected e = expected(i, boundary[i], 0.5, 10 * degree);
    const bool over = (boundary[i] - 0.5 - center_y) / focal <= -std::tan(10 * degree);
    if (over || e.range > 4.001) {
      EXPECT_EQ(m.ranges[i], std::numeric_limits<float>::infinity()) << i;
      ++free;
    } else if (e.range < 3.999) {
      EXPECT_NEAR(m.ranges[i], e.range, 0.0006) << i;
      EXPECT_NEAR(m.bearings[i], e.bearing, 0.0006 * degree + 1e-7) << i;
      EXPECT_LT(m.low[i], m.ranges[i]) << i;
      EXPECT_GT(m.high[i], m.ranges[i]) << i;
      ++measured;
    }
  }
  EXPECT_GT(measured, 20);
  EXPECT_GT(free, 20);
  EXPECT_EQ(m.height, 0.5);
  EXPECT_NEAR(m.pitch, 10 * degree, 1e-12);
  EXPECT_EQ(m.roll, 0);
  EXPECT_EQ(m.range_max, 4);
  EXPECT_NEAR(m.range_min, expected(80, height, 0.5, 10 * degree).range, 0.001);
  EXPECT_EQ(m.flags & metric_flag_pose, 0u);
  EXPECT_TRUE(rig.warnings().empty());
}

/// The bearings of all columns with a range lie in the fan.
void expect_inside(const MetricEstimate& m) {
  for (std::size_t i = 0; i < m.bearings.size(); ++i)
    if (!std::isnan(m.bearings[i])) {
      const double half = m.fan.increment / 2 + 1e-5;
      EXPECT_GE(m.bearings[i], m.fan.angle_min - half) << i;
      EXPECT_LE(m.bearings[i], m.fan.angle_max() + half) << i;
    }
}

TEST_F(Metric, ScansHaveOneFan) {
  // Camera and mount alone decide: whatever is in the picture, and before anything was learned.
  std::optional<ScanFan> fan;
  for (const char* more : {"", "learning=false", "window-bottom=20 threshold=4"}) {
    Rig rig(with() + more, caps);
    for (int i = 0; i < 6; ++i) {
      const auto out = rig.step();
      const MetricReader metres(out.get());
      ASSERT_TRUE(metres);
      const MetricEstimate& m = metres.metric();
      EXPECT_EQ(m.fan, fan.value_or(m.fan)) << more << i;
      fan = m.fan;
      expect_inside(m);
    }
  }
  // A view of 60 degrees on the horizon; the columns at its middle are 0.41 degrees apart.
  EXPECT_LT(fan->angle_min, -30 * degree);
  EXPECT_GT(fan->angle_min, -45 * degree);
  EXPECT_NEAR(fan->angle_max(), -fan->angle_min, 2 * fan->increment);
  EXPECT_GT(fan->increment, 0.41 * degree);
  EXPECT_LT(fan->increment, 0.7 * degree);
  EXPECT_NEAR(fan->range_min, expected(80, height, 0.5, 10 * degree).range, 0.001);
}

TEST_F(Metric, TheFanHoldsWhileTheVehicleSways) {
  Rig rig(with("height=0.5"), caps);
  std::optional<ScanFan> fan;
  std::optional<double> range_max;
  int columns = 0;
  for (int i = 0; i < 30; ++i) {
    ASSERT_TRUE(gst_harness_push_event(rig.harness(), pose(8 * std::sin(0.7 * i), 20 + 8 * std::cos(0.9 * i),
                                                           1000 * static_cast<guint64>(i) / 30)));
    const auto out = rig.step();
    const MetricReader metres(out.get());
    ASSERT_TRUE(metres) << i;
    const MetricEstimate& m = metres.metric();
    EXPECT_EQ(m.fan, fan.value_or(m.fan)) << i;
    EXPECT_EQ(m.range_max, range_max.value_or(m.range_max)) << i;
    fan = m.fan;
    range_max = m.range_max;
    columns += !std::isnan(m.bearings[0]);
    expect_inside(m);
    EXPECT_LE(m.fan.range_min, m.range_min + 0.05);
  }
  EXPECT_GT(columns, 20);
}

TEST_F(Metric, ARegionOfTheCalibratedPictureHasItsOwnRanges) {
  // The lower middle of a picture of twice the size: its calibration with roi, and that of the part.
  const std::string whole = "width: 320\nheight: 240\nk: [138.5, 0, 139.5, 0, 138.5, 129.5, 0, 0, 1]\nroi: "
                            "{x_offset: 60, y_offset: 70, width: 160, height: 120}\n";
  const TemporaryFile region(whole);
  std::vector<std::vector<float>> ranges;
  for (const std::string& path : {camera.path, region.path}) {
    Rig rig("terrainseg mount=height=0.5,pitch=10deg camera-info=" + path, caps);
    Owned<GstBuffer> last;
    for (int i = 0; i < 8; ++i)
      last = rig.step();
    const MetricReader metres(last.get());
    ASSERT_TRUE(metres);
    ranges.emplace_back(metres.metric().low.begin(), metres.metric().low.end());
    EXPECT_TRUE(rig.warnings().empty());
  }
  for (std::size_t i = 0; i < ranges[0].size(); ++i)
    EXPECT_TRUE(ranges[0][i] == ranges[1][i] || (std::isnan(ranges[0][i]) && std::isnan(ranges[1][i]))) << i;
  // Frames of the whole picture contradict the roi.
  Rig rig("terrainseg mount=height=0.5,pitch=10deg camera-info=" + region.path, caps_text("I420", 320, 240));
  EXPECT_EQ(rig.push(new_frame(info_of(caps_text("I420", 320, 240)), 0)), GST_FLOW_ERROR);
  bool said = false;
  for (const auto& error : reports(rig.bus(), GST_MESSAGE_ERROR))
    said |= error.contains("remove roi");
  EXPECT_TRUE(said);
}

TEST_F(Metric, TheLimitIsWhereTheErrorReachesAFifth) {
  Rig rig(with("height=0.5,pitch=10deg,pitch-error=1deg"), caps);
  const auto out = rig.step();
  const MetricReader metres(out.get());
  ASSERT_TRUE(metres);
  // d / h * error = 0.2, the error of the pitch and of half a percent of the rows.
  const double error = std::hypot(degree, 0.005 * height / focal);
  EXPECT_NEAR(metres.metric().range_max, 0.2 * 0.5 / error, 0.001);
  // Nothing is known before anything was learned.
  Rig unknown(with() + "learning=false", caps);
  const auto first = unknown.step();
  const MetricReader none(first.get());
  ASSERT_TRUE(none);
  for (const float range : none.metric().ranges)
    EXPECT_TRUE(std::isnan(range));
}

TEST_F(Metric, NoCalibrationNoMetres) {
  for (const std::string& half : {std::string("terrainseg"), "terrainseg camera-info=" + camera.path,
                                  std::string("terrainseg mount=height=0.5")}) {
    Rig rig(half, caps);
    EXPECT_FALSE(has_metres(rig.step().get())) << half;
    rig.step();
    const auto warnings = rig.warnings();
    if (half == "terrainseg") {
      EXPECT_TRUE(warnings.empty());
      continue;
    }
    ASSERT_EQ(warnings.size(), 1u) << half;
    EXPECT_TRUE(warnings[0].contains(half.find("mount") == half.npos ? "mount is missing"
                                                                     : "camera-info is missing"));
  }
}

TEST_F(Metric, WhatCannotBeUsedIsAnErrorAtStart) {
  const TemporaryFile text("hello\n"), flat("height: 0\n"), steep("mount:\n  height: 1\n  pitch: 90deg\n"),
      nan("image_width: 160\nimage_height: 120\ncamera_matrix: {data: [nan, 0, 80, 0, 1, 60, 0, 0, 1]}\n"),
      omni(calibration() + "distortion_model: omni\n");
  struct Case {
    std::string launch;
    std::vector<const char*> says;
  };
  const std::string mount = " mount=height=1";
  for (const Case& wrong : {
           Case{"camera-info=/nowhere.yaml" + mount, {"/nowhere.yaml", "camera-info", "No such file"}},
           Case{"camera-info=/" + mount, {"camera-info", "folder"}},
           Case{"camera-info=" + text.path + mount, {text.path.c_str(), "no keys"}},
           Case{"camera-info=" + nan.path + mount, {nan.path.c_str(), "not finite"}},
           Case{"camera-info=" + omni.path + mount, {"omni", "plumb_bob"}},
           Case{"camera-info=" + camera.path + " mount=" + flat.path, {flat.path.c_str(), "mount", "height"}},
           Case{"camera-info=" + camera.path + " mount=" + steep.path, {"pitch", "80 degrees"}},
           Case{"camera-info=" + camera.path + " mount=height=0", {"mount", "height"}},
           Case{"camera-info=" + camera.path + " mount=height=1,pitch=90deg", {"mount", "80 degrees"}},
           Case{"camera-info=" + camera.path + " mount=height=1,tilt=3", {"tilt=3", "known are"}},
           Case{"start-time=yesterday", {"start-time", "yesterday", "ISO", "1970"}},
           Case{"start-time=1234x", {"start-time"}},
           Case{"start-time=1969-12-31T23:59:59Z", {"start-time"}},
       }) {
    auto element = make_element("terrainseg " + wrong.launch);
    Owned<GstBus> bus(gst_bus_new());
    gst_element_set_bus(element.get(), bus.get());
    EXPECT_EQ(gst_element_set_state(element.get(), GST_STATE_PAUSED), GST_STATE_CHANGE_FAILURE)
        << wrong.launch;
    const auto errors = reports(bus.get(), GST_MESSAGE_ERROR);
    ASSERT_EQ(errors.size(), 1u) << wrong.launch;
    for (const char* says : wrong.says)
      EXPECT_NE((errors[0].user + errors[0].developer).find(says), std::string::npos)
          << wrong.launch << " -> " << errors[0].user;
    gst_element_set_bus(element.get(), nullptr);
  }
}

TEST_F(Metric, ACalibrationOfAnotherSizeIsScaledAndOfAnotherShapeRefused) {
  const TemporaryFile large(calibration(width * 4, height * 4, 4)),
      wide(calibration(width * 4, height * 3, 4));
  Rig plain(with(), caps), scaled("terrainseg mount=height=0.5,pitch=10deg camera-info=" + large.path, caps);
  const auto a = plain.step(), b = scaled.step();
  const MetricReader from(a.get()), to(b.get());
  ASSERT_TRUE(from);
  ASSERT_TRUE(to);
  for (std::size_t i = 0; i < from.metric().ranges.size(); ++i)
    if (std::isfinite(from.metric().ranges[i])) {
      EXPECT_NEAR(to.metric().ranges[i], from.metric().ranges[i], 0.002) << i;
    }
  Rig refused("terrainseg mount=height=0.5 camera-info=" + wide.path);
  refused.set_caps(caps);
  EXPECT_NE(refused.push(new_frame(info_of(caps))), GST_FLOW_OK);
  const auto errors = refused.errors();
  ASSERT_FALSE(errors.empty());
  EXPECT_TRUE(errors[0].contains("640 x 360"));
  EXPECT_TRUE(errors[0].contains("160 x 120"));
  // A stream that changes its shape goes on, without metres.
  Rig rig(with(), caps);
  EXPECT_TRUE(has_metres(rig.step().get()));
  rig.set_caps(caps_text("I420", 160, 90));
  EXPECT_FALSE(has_metres(rig.step().get()));
  EXPECT_EQ(rig.warnings().size(), 1u);
  rig.set_caps(caps_text("I420", 320, 240));
  EXPECT_TRUE(has_metres(rig.step().get()));
}

TEST_F(Metric, TheShapeThatCountsIsThatOfTheFrames) {
  // In front of a video that its camera marked as turned caps come twice, lying and upright, and then its
  // frames.
  const TemporaryFile wide(calibration(width * 4, height * 3, 4));
  const std::string launch = "terrainseg mount=height=0.5,pitch=10deg camera-info=" + wide.path;
  Rig upright(launch);
  upright.set_caps(caps_text("I420", height * 3, width * 4));
  upright.set_caps(caps_text("I420", width * 4, height * 3));
  EXPECT_TRUE(has_metres(upright.step().get()));
  EXPECT_TRUE(upright.errors().empty());
  EXPECT_TRUE(upright.warnings().empty());
  Rig lying(launch);
  lying.set_caps(caps_text("I420", width * 4, height * 3));
  lying.set_caps(caps_text("I420", height * 3, width * 4));
  EXPECT_NE(lying.push(new_frame(info_of(caps_text("I420", height * 3, width * 4)))), GST_FLOW_OK);
  EXPECT_EQ(lying.errors().size(), 1u);
}

TEST_F(Metric, ACalibrationOfAnotherShapeIsSaidOnce) {
  // Upstream tries its caps again and again.
  const TemporaryFile wide(calibration(width * 4, height * 3, 4));
  const std::string text = "terrainscenesrc num-buffers=3 ! video/x-raw,width=160,height=120 ! terrainseg "
                           "name=t mount=height=0.5 camera-info=" +
                           wide.path + " ! fakesink";
  Owned<GstElement> pipeline(gst_parse_launch(text.c_str(), nullptr));
  ASSERT_TRUE(pipeline);
  const Owned<GstBus> bus(gst_element_get_bus(pipeline.get()));
  gst_element_set_state(pipeline.get(), GST_STATE_PLAYING);
  gst_element_get_state(pipeline.get(), nullptr, nullptr, 20 * GST_SECOND);
  gst_element_set_state(pipeline.get(), GST_STATE_READY); // the last of its messages is there
  std::size_t said = 0;
  for (const auto& error : reports(bus.get(), GST_MESSAGE_ERROR))
    said += error.contains("does not fit");
  EXPECT_EQ(said, 1u);
  gst_element_set_state(pipeline.get(), GST_STATE_NULL);
}

TEST_F(Metric, APoseFromEitherSideStandsAboveTheMount) {
  Rig rig(with() + "range-max=6", caps);
  EXPECT_TRUE(gst_harness_push_event(rig.harness(), pose(0, 5, 0)));
  EXPECT_TRUE(gst_harness_push_upstream_event(rig.harness(), pose(2, 15, 66, true)));
  const auto first = rig.step(), second = rig.step(), third = rig.step(); // at 0, 33.3 and 66.7 ms
  const auto pitch_of = [](GstBuffer* buffer) { return MetricReader(buffer).metric().pitch / degree; };
  EXPECT_NEAR(pitch_of(first.get()), 5, 0.001);
  EXPECT_NEAR(pitch_of(second.get()), 5 + 10 * 33.333 / 66, 0.001) << "between the two";
  EXPECT_NEAR(MetricReader(second.get()).metric().roll / degree, 2 * 33.333 / 66, 0.001);
  EXPECT_NEAR(pitch_of(third.get()), 15, 0.001);
  const MetricReader metres(third.get());
  EXPECT_EQ(metres.metric().flags & metric_flag_pose, 1u);
  EXPECT_EQ(metres.metric().height, 0.5) << "the mount's own";
  // A height of its own.
  GstEvent* higher = pose(0, 5, 100);
  gst_structure_set(gst_event_writable_structure(higher), "height", G_TYPE_DOUBLE, 0.75, "yaw", G_TYPE_DOUBLE,
                    0.5, nullptr);
  EXPECT_TRUE(gst_harness_push_event(rig.harness(), higher));
  const auto fourth = rig.step();
  EXPECT_EQ(MetricReader(fourth.get()).metric().height, 0.75);
  EXPECT_NEAR(MetricReader(fourth.get()).metric().yaw, 0.5, 1e-4);
  EXPECT_TRUE(rig.warnings().empty());
}

// Level ground ends where level rays are seen: f tan (pitch) above the middle.
double level_row(double pitch) {
  return center_y - focal * std::tan(pitch);
}
double vanishing_row_of(GstBuffer* buffer) {
  const GstStructure* fields = gst_buffer_get_terrain_seg_structure(buffer);
  return fields ? gst_terrain_seg_meta_get_vanishing_row(fields) : -2;
}

TEST_F(Metric, TheVanishingRowIsThePosesElseTheMounts) {
  for (const char* more : {"", "motion=off"}) {
    Rig rig(with("height=0.5,pitch=10deg", more), caps);
    EXPECT_NEAR(vanishing_row_of(rig.step().get()), level_row(10 * degree), 0.005) << more;
    EXPECT_TRUE(gst_harness_push_event(rig.harness(), pose(0, 5, 33)));
    EXPECT_NEAR(vanishing_row_of(rig.step().get()), level_row(5 * degree), 0.005) << more;
    EXPECT_TRUE(gst_harness_push_event(rig.harness(), pose(0, 60, 67)));
    EXPECT_EQ(vanishing_row_of(rig.step().get()), -1) << "above the picture " << more;
    for (int i = 0; i < 4; ++i)
      rig.step();
    EXPECT_EQ(vanishing_row_of(rig.step().get()), -1) << "stale, and this picture is too small for motion";
  }
  Rig set(with("height=0.5,pitch=10deg", "vanishing-row=50"), caps);
  EXPECT_EQ(vanishing_row_of(set.step().get()), 50) << "set by hand stands above both";
}

TEST_F(Metric, AStalePoseTakesTheMetresAway) {
  Rig rig(with(), caps);
  EXPECT_TRUE(has_metres(rig.step().get())) << "the mount's";
  EXPECT_TRUE(gst_harness_push_event(rig.harness(), pose(0, 5, 33)));
  int with_metres = 0;
  for (int i = 1; i < 12; ++i) // 33 to 367 ms
    with_metres += has_metres(rig.step().get());
  EXPECT_EQ(with_metres, 3) << "frames within 100 ms of the pose";
  const auto warnings = rig.warnings();
  ASSERT_EQ(warnings.size(), 1u);
  EXPECT_TRUE(warnings[0].contains("100 ms"));
  EXPECT_TRUE(gst_harness_push_event(rig.harness(), pose(0, 5, 400)));
  EXPECT_TRUE(has_metres(rig.step().get())) << "back with the next";
  // One in the future is none.
  EXPECT_TRUE(gst_harness_push_event(rig.harness(), pose(0, 5, 900000)));
  for (int i = 0; i < 4; ++i)
    rig.step();
  EXPECT_FALSE(has_metres(rig.step().get()));
  EXPECT_TRUE(rig.warnings().empty()) << "told once";
}

TEST_F(Metric, AfterAFlushMetresWaitForAPose) {
  Rig rig(with(), caps);
  EXPECT_TRUE(gst_harness_push_event(rig.harness(), pose(0, 5, 0)));
  EXPECT_TRUE(has_metres(rig.step().get()));
  EXPECT_TRUE(gst_harness_push_event(rig.harness(), gst_event_new_flush_start()));
  EXPECT_TRUE(gst_harness_push_event(rig.harness(), gst_event_new_flush_stop(TRUE)));
  GstSegment segment;
  gst_segment_init(&segment, GST_FORMAT_TIME);
  EXPECT_TRUE(gst_harness_push_event(rig.harness(), gst_event_new_segment(&segment)));
  EXPECT_FALSE(has_metres(rig.step().get()));
}

TEST_F(Metric, APoseThatMakesNoSenseIsIgnored) {
  Rig rig(with(), caps);
  EXPECT_TRUE(has_metres(rig.step().get()));
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const auto number = [](const char* field, double value) {
    GstEvent* event = pose(0, 5, 33);
    gst_structure_set(gst_event_writable_structure(event), field, G_TYPE_DOUBLE, value, nullptr);
    return event;
  };
  GstEvent* without = pose(0, 5, 33);
  gst_structure_remove_field(gst_event_writable_structure(without), "running-time");
  GstEvent* never = pose(0, 5, 33);
  gst_structure_set(gst_event_writable_structure(never), "running-time", G_TYPE_UINT64, GST_CLOCK_TIME_NONE,
                    nullptr);
  for (GstEvent* event : {number("pitch", nan), number("roll", nan), number("pitch", 90 * degree),
                          number("height", 0), number("height", -1), number("yaw", 1e9), without, never})
    gst_harness_push_event(rig.harness(), event);
  const auto out = rig.step();
  EXPECT_EQ(MetricReader(out.get()).metric().flags & metric_flag_pose, 0u) << "none of them was taken";
  EXPECT_NEAR(MetricReader(out.get()).metric().pitch, 10 * degree, 1e-9);
  EXPECT_EQ(rig.warnings().size(), 1u) << "told once";
}

TEST_F(Metric, PosesMayComeOutOfOrderAndAFutureOneIsNotTaken) {
  Rig rig(with(), caps);
  for (const int ms : {400, 0, 50}) // frames lie 33 ms apart
    gst_harness_push_event(rig.harness(), pose(0, 10 + ms / 100.0, static_cast<guint64>(ms)));
  const auto first = rig.step(), second = rig.step();
  const MetricReader at_0(first.get()), at_33(second.get());
  ASSERT_TRUE(at_0);
  ASSERT_TRUE(at_33);
  EXPECT_NEAR(at_0.metric().pitch, 10 * degree, 1e-6);
  EXPECT_NEAR(at_33.metric().pitch, (10 + 1 / 3.0) * degree, 1e-4) << "between the poses at 0 and 50 ms";
  Rig future(with(), caps);
  gst_harness_push_event(future.harness(), pose(0, 10, 400));
  EXPECT_FALSE(has_metres(future.step().get())) << "400 ms ahead: unknown, and no guess";
}

TEST_F(Metric, PosesOfAWrongClockDoNotKeepOutTheRightOnes) {
  Rig rig(with(), caps);
  for (guint64 i = 0; i < 1000; ++i)
    gst_harness_push_event(rig.harness(), pose(0, 5, 5000000 + i));
  EXPECT_FALSE(has_metres(rig.step().get()));
  gst_harness_push_event(rig.harness(), pose(0, 5, 33));
  EXPECT_TRUE(has_metres(rig.step().get()));
}

TEST_F(Metric, ATimeThatNoSignedNumberHoldsIsNone) {
  GstSegment segment;
  gst_segment_init(&segment, GST_FORMAT_TIME);
  constexpr GstClockTime last = G_MAXINT64;
  EXPECT_EQ(terrainseg::running_time_of(segment, last), last);
  EXPECT_EQ(terrainseg::running_time_of(segment, last + 1), GST_CLOCK_TIME_NONE);
  EXPECT_EQ(terrainseg::running_time_of(segment, GST_CLOCK_TIME_NONE - 1), GST_CLOCK_TIME_NONE);
}

TEST_F(Metric, GroundBeyondTheLimitIsNoFreeGround) {
  Rig rig(with("height=0.5,pitch=-15deg") + "range-max=1", caps);
  EXPECT_FALSE(has_metres(rig.step().get()));
  rig.step();
  const auto warnings = rig.warnings();
  ASSERT_EQ(warnings.size(), 1u);
  EXPECT_TRUE(warnings[0].contains("range-max"));
}

TEST_F(Metric, MetresOfAFilterBeforeDoNotStay) {
  const auto behind = [](Rig& first, Rig& second) {
    second.push(first.step().release());
    return second.pull();
  };
  Rig before(with(), caps), plain("terrainseg", caps);
  EXPECT_FALSE(has_metres(behind(before, plain).get()));
  Rig low(with("height=0.5,pitch=10deg", "instance=low"), caps),
      high(with("height=0.75,pitch=10deg", "instance=high"), caps);
  const auto out = behind(low, high);
  EXPECT_EQ(MetricReader(out.get(), "low").metric().height, 0.5);
  EXPECT_EQ(MetricReader(out.get(), "high").metric().height, 0.75);
}

TEST_F(Metric, AHorizonThatIsElsewhereIsTold) {
  // The road's sky ends at 40 % of the height: row 48, 4.75 degrees above the middle.
  const double above = std::atan((center_y - 48) / focal) / degree;
  for (const double off : {0.0, 3.0}) {
    const std::string pitch = std::to_string(above + off) + "deg";
    Rig rig(with("height=0.5,pitch=" + pitch), caps);
    std::uint32_t flags = 0;
    int sure = 0;
    for (int i = 0; i < 330; ++i) {
      const auto out = rig.step();
      flags = MetricReader(out.get()).metric().flags;
      sure += EstimateReader(out.get()).estimate().horizon_confidence >= 80;
    }
    ASSERT_GT(sure, 250) << "the road has a horizon";
    const auto warnings = rig.warnings();
    EXPECT_EQ(flags & metric_flag_horizon, off == 0 ? 0u : 2u) << off;
    ASSERT_EQ(warnings.size(), off == 0 ? 0u : 1u) << off;
    if (off != 0) {
      EXPECT_TRUE(warnings[0].contains("degrees lower")) << warnings[0].user;
    }
  }
}

TEST_F(Metric, MarksStandOnTheGroundTheyName) {
  Rig rig(with() + "range-max=4", caps);
  Owned<GstBuffer> last;
  for (int i = 0; i < 4; ++i)
    last = rig.step();
  const MetricReader metres(last.get());
  ASSERT_TRUE(metres);
  ASSERT_EQ(metres.metric().ticks.size(), 4u) << "1 to 4 m";
  for (const RangeTick& tick : metres.metric().ticks) {
    // v = cy + f tan (atan (h / X) - p)
    const double row = center_y + focal * std::tan(std::atan(0.5 / tick.range) - 10 * degree);
    EXPECT_NEAR(tick.row * height - 0.5, row, 1e-3) << tick.range;
    EXPECT_NEAR(tick.column * width - 0.5, center_x, 1e-3);
  }
}

TEST_F(Metric, TheMapShowsTheWayFromAbove) {
  const std::string drawing =
      "range-max=4 overlay=true overlay-alpha=1 overlay-color=0xff00ff00 overlay-style=";
  Rig with_map(with() + drawing + "map", caps), with_tint(with() + drawing + "tint", caps),
      plain_map("terrainseg " + drawing + "map", caps), plain_tint("terrainseg " + drawing + "tint", caps);
  Owned<GstBuffer> map, tint, bare_map, bare_tint;
  for (int i = 0; i < 6; ++i) {
    map = with_map.step();
    tint = with_tint.step();
    bare_map = plain_map.step();
    bare_tint = plain_tint.step();
  }
  EXPECT_EQ(bytes_of(bare_map.get()), bytes_of(bare_tint.get())) << "without metres there is no map";
  EXPECT_NE(bytes_of(tint.get()), bytes_of(bare_tint.get())) << "with metres there are numbers";
  const MetricReader metres(map.get());
  ASSERT_TRUE(metres);
  const MetricEstimate& m = metres.metric();
  // The map is a square of 2/5 of the shorter side in the top right corner; 5 m to its upper edge, the
  // vehicle in the middle of its lower edge. Green has a luma of 145, the dark ground of the map less
  // than 40.
  const int side = std::min(width, height) * 2 / 5, gap = std::max(height / 60, 1);
  const int left = width - side - gap, top = gap;
  const auto pixels = bytes_of(map.get());
  int free = 0, beyond = 0;
  for (std::size_t i = 0; i < m.ranges.size(); i += 3) {
    const double reach = std::isinf(m.ranges[i]) ? 9 : m.ranges[i];
    for (const double range : {0.6, 1.4, 2.4, 3.6}) {
      if (std::abs(range - reach) < 0.7)
        continue; // within the edge's own pixels (a pixel is a tenth of a metre)
      const double forward = range * std::cos(m.bearings[i]), aside = range * std::sin(m.bearings[i]);
      const int x = left + static_cast<int>(std::lround((side - 1) / 2.0 - aside * (side - 1) / 5));
      const int y = top + side - 1 - static_cast<int>(std::lround(forward * (side - 1) / 5));
      // Only where the neighbours say the same: an edge beside it has its own colour.
      bool alike = true;
      for (std::size_t k = i < 20 ? 0 : i - 20; k < std::min(i + 20, m.ranges.size()); ++k)
        alike = alike && (m.ranges[k] > range + 0.7) == (reach > range); // infinity is more, too
      if (!alike || x <= left + 1 || x >= left + side - 2)
        continue;
      const int seen = pixels[static_cast<std::size_t>(y * width + x)];
      if (reach > range) {
        EXPECT_GT(seen, 100) << i << " at " << range;
        ++free;
      } else {
        EXPECT_LT(seen, 90) << i << " at " << range;
        ++beyond;
      }
    }
  }
  EXPECT_GT(free, 20);
  EXPECT_GT(beyond, 0);
}

TEST_F(Metric, LinesHaveThem) {
  auto pipeline =
      make_element("videotestsrc num-buffers=2 ! " + caps + " ! " +
                   with("height=0.5,pitch=10deg", "start-time=2026-11-22T20:00:00Z") +
                   " ! terrainextract ! application/x-ndjson ! fakesink name=sink signal-handoffs=true");
  Owned<GstElement> sink(gst_bin_get_by_name(GST_BIN(pipeline.get()), "sink"));
  std::vector<std::string> lines;
  g_signal_connect(sink.get(), "handoff",
                   G_CALLBACK(+[](GstElement*, GstBuffer* buffer, GstPad*, std::vector<std::string>* to) {
                     const auto bytes = bytes_of(buffer);
                     to->emplace_back(bytes.begin(), bytes.end());
                   }),
                   &lines);
  EXPECT_EQ(run_pipeline(pipeline.get()), "");
  ASSERT_EQ(lines.size(), 2u);
  EXPECT_NE(lines[1].find("\"utc\": \"2026-11-22T20:00:00.033333Z\""), std::string::npos) << lines[1];
  EXPECT_NE(lines[1].find("\"metric\": {\"ranges\": ["), std::string::npos) << lines[1];
  EXPECT_NE(lines[1].find("\"height\": 0.5, \"pitch\": 0.174533"), std::string::npos) << lines[1];
}

// ---- the wall clock --------------------------------------------------------------------------------------

TEST(StartTime, Forms) {
  std::string error;
  constexpr guint64 evening = 1795377600; // 2026-11-22T20:00:00Z
  struct Form {
    const char* text;
    guint64 nanoseconds;
  };
  for (const Form& form :
       {Form{"1970-01-01T00:00:00Z", 0}, Form{"2026-11-22T20:00:00Z", evening * GST_SECOND},
        Form{"2026-11-22T20:00:00", evening * GST_SECOND},
        Form{"2026-11-22T21:30:00+01:30", evening * GST_SECOND},
        Form{"2026-11-22T20:00:00.25Z", evening * GST_SECOND + 250 * GST_MSECOND},
        Form{"1795377600000000001", evening * GST_SECOND + 1}}) {
    const auto time = parse_start_time(form.text, error);
    ASSERT_TRUE(time) << form.text;
    EXPECT_EQ(*time, form.nanoseconds) << form.text;
  }
  for (const char* wrong : {"", " ", "now", "2026-13-01T00:00:00Z", "-5", "1e9", "99999999999999999999",
                            "18446744073709551615", "1969-12-31T23:59:59Z", "9999-01-01T00:00:00Z"}) {
    error.clear();
    EXPECT_FALSE(parse_start_time(wrong, error)) << wrong;
    EXPECT_FALSE(error.empty()) << wrong;
  }
}

TEST(StartTime, AUnitTellsATimeOfDayOrATimeStamp) {
  const auto stamped = [](std::uint64_t microseconds) {
    Owned<GstBuffer> buffer(gst_buffer_new());
    stamp_unit_time(buffer.get(), microseconds);
    return utc_of(buffer.get());
  };
  EXPECT_EQ(stamped(1'700'000'000'123'456), 1'700'000'000'123'456'000u);
  EXPECT_FALSE(stamped(3'600'000'000)) << "an hour into a stream";
  EXPECT_FALSE(stamped(0));
  EXPECT_FALSE(stamped(G_MAXUINT64)) << "no sum may overflow";
  Owned<GstBuffer> buffer(gst_buffer_new());
  GST_BUFFER_PTS(buffer.get()) = 0;
  stamp_utc(buffer.get(), 5 * GST_SECOND);
  stamp_unit_time(buffer.get(), 1'700'000'000'123'456);
  EXPECT_EQ(utc_of(buffer.get()), 5 * GST_SECOND) << "what a frame says of itself stays";
}

TEST(StartTime, AFrameBeyondTheEndOfTimesGetsNone) {
  const auto stamped = [](GstClockTime start, GstClockTime pts) {
    Owned<GstBuffer> buffer(gst_buffer_new());
    GST_BUFFER_PTS(buffer.get()) = pts;
    stamp_utc(buffer.get(), start);
    return utc_of(buffer.get());
  };
  constexpr GstClockTime latest = G_MAXINT64;
  EXPECT_EQ(stamped(latest - 1, 1), latest);
  EXPECT_FALSE(stamped(latest, 1));
  EXPECT_FALSE(stamped(latest, latest + 1)) << "the sum is no time";
  EXPECT_FALSE(stamped(5 * GST_SECOND, G_MAXUINT64 - 1)) << "the sum begins anew";
}

TEST(StartTime, FramesGetTheTimeOfDayUnlessTheyHaveOne) {
  Rig rig("terrainseg start-time=2026-11-22T20:00:00Z", caps);
  rig.step();
  const auto second = rig.step();
  ASSERT_TRUE(utc_of(second.get()));
  EXPECT_EQ(*utc_of(second.get()), 1795377600 * GST_SECOND + 33333333);
  GstBuffer* own = new_frame(rig.info(), 5);
  Owned<GstCaps> ntp(gst_caps_from_string("timestamp/x-ntp"));
  gst_buffer_add_reference_timestamp_meta(own, ntp.get(), (2208988800 + 1000) * GST_SECOND,
                                          GST_CLOCK_TIME_NONE);
  rig.push(own);
  const auto third = rig.pull();
  EXPECT_EQ(*utc_of(third.get()), 1000 * GST_SECOND) << "the stream's own";
  GstBuffer* timeless = new_frame(rig.info(), 6);
  GST_BUFFER_PTS(timeless) = GST_CLOCK_TIME_NONE;
  rig.push(timeless);
  EXPECT_FALSE(utc_of(rig.pull().get()));
  Rig none("terrainseg", caps);
  EXPECT_FALSE(utc_of(none.step().get()));
}

} // namespace
} // namespace terrainseg::test
