// SPDX-License-Identifier: LGPL-2.1-or-later
// MAVLink out of terrainextract, read by a receiver that is written apart from the sender.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <numbers>
#include <optional>

#include "exchange/mavlink_stream.hpp"
#include "outlet_harness.hpp"

namespace terrainseg::test {
namespace {

const testing::Environment* const gstreamer = testing::AddGlobalTestEnvironment(new GStreamer);

constexpr const char* raw_caps = "video/x-raw,format=I420,width=64,height=48,framerate=30/1";
constexpr gsize raw_size = 64 * 48 * 3 / 2;
constexpr double degree = std::numbers::pi / 180;

// ---- a receiver ------------------------------------------------------------------------------------------

/// One frame as the MAVLink 2 serialisation page has it.
struct Packet {
  unsigned sequence = 0, system = 0, component = 0, id = 0;
  std::vector<std::uint8_t> payload;
  std::uint64_t number(std::size_t at, int bytes) const { // cut zeros are zeros
    std::uint64_t value = 0;
    for (int i = 0; i < bytes; ++i)
      if (at + i < payload.size())
        value |= std::uint64_t{payload[at + i]} << (8 * i);
    return value;
  }
  float real(std::size_t at) const {
    const auto bits = static_cast<std::uint32_t>(number(at, 4));
    float value;
    std::memcpy(&value, &bits, 4);
    return value;
  }
};

/// CRC-16/MCRF4XX bit by bit.
unsigned crc_of(const std::uint8_t* first, const std::uint8_t* last, unsigned extra) {
  unsigned crc = 0xFFFF;
  const auto take = [&](unsigned byte) {
    for (int bit = 0; bit < 8; ++bit)
      crc = ((crc ^ (byte >> bit)) & 1) ? (crc >> 1) ^ 0x8408u : crc >> 1;
  };
  for (; first != last; ++first)
    take(*first);
  take(extra);
  return crc;
}

/// Whole frames without anything between them.
std::vector<Packet> packets_of(GstBuffer* unit) {
  const std::string text = text_of(unit);
  const auto* p = reinterpret_cast<const std::uint8_t*>(text.data());
  const auto* const end = p + text.size();
  std::vector<Packet> packets;
  while (end - p >= 12) {
    EXPECT_EQ(p[0], 0xFD);
    const std::ptrdiff_t length = p[1];
    if (end - p < 12 + length)
      break;
    Packet packet{p[4], p[5], p[6], p[7] + 256u * p[8] + 65536u * p[9], {p + 10, p + 10 + length}};
    EXPECT_EQ(p[2] | p[3], 0);
    EXPECT_EQ(p[10 + length] | p[11 + length] << 8u,
              crc_of(p + 1, p + 10 + length, packet.id == 330 ? 23 : 50));
    packets.push_back(packet);
    p += 12 + length;
  }
  EXPECT_EQ(p, end);
  return packets;
}

/// A sector of OBSTACLE_DISTANCE by ArduPilot's rules: the direction of its middle, degrees to the right, and
/// the metres that it takes, if it takes them.
struct Sector {
  double right;
  std::optional<double> metres;
};
std::array<Sector, 72> sectors_of(const Packet& packet) {
  const auto low = packet.number(152, 2), high = packet.number(154, 2);
  const double step = packet.real(158) > 0 ? packet.real(158) : static_cast<double>(packet.number(157, 1));
  std::array<Sector, 72> sectors;
  for (int i = 0; i < 72; ++i) {
    Sector& sector = sectors[static_cast<std::size_t>(i)];
    sector.right = packet.real(162) + i * step;
    const auto distance = packet.number(8 + 2 * i, 2);
    if (distance != 0 && distance != 65535 && distance >= low && distance <= high)
      sector.metres = static_cast<double>(distance) / 100;
  }
  return sectors;
}

/// The obstacles that it takes from a message.
struct Obstacle {
  double metres, right;
};
std::vector<Obstacle> taken(const Packet& packet) {
  std::vector<Obstacle> out;
  for (const Sector& sector : sectors_of(packet))
    if (sector.metres)
      out.push_back({*sector.metres, std::remainder(sector.right, 360)});
  return out;
}

/// ArduPilot's eight faces, 45 degrees each, the first ahead, clockwise: the nearest obstacle that simple
/// avoidance sees there, metres, or none. It walks the sectors in order, and what it found in a face is
/// written when the next sector lies in another one: a face that it enters twice holds the second part only.
std::array<std::optional<double>, 8> faces_of(const Packet& packet) {
  std::array<std::optional<double>, 8> faces;
  std::optional<std::size_t> face;
  for (const Sector& sector : sectors_of(packet)) {
    const auto here = static_cast<std::size_t>(std::fmod(sector.right + 720 + 22.5, 360) / 45);
    if (face != here)
      faces[here].reset();
    face = here;
    if (sector.metres)
      faces[here] = std::min(faces[here].value_or(1000), *sector.metres);
  }
  return faces;
}

// ---- frames ----------------------------------------------------------------------------------------------

/// 64 columns over 70 degrees, free but for what is put there.
struct View {
  std::vector<float> ranges = std::vector<float>(64, INFINITY), bearings;
  View() {
    for (int i = 0; i < 64; ++i)
      bearings.push_back(static_cast<float>((35 - 70 * (i + 0.5) / 64) * degree));
  }
  MetricEstimate metric() const {
    MetricEstimate m;
    m.ranges = m.low = m.high = ranges;
    m.bearings = bearings;
    m.height = 0.5;
    m.range_min = 0.3;
    m.range_max = 8;
    return m;
  }
};

class Mavlink : public testing::Test {
 protected:
  void start(const char* settings = "") {
    // One element alone is no bin.
    GstElement* element = gst_parse_launch((std::string("terrainextract ") + settings).c_str(), nullptr);
    h = Owned<GstHarness>(gst_harness_new_with_element(element, "sink", "src"));
    gst_object_unref(element);
    gst_harness_set_sink_caps_str(h.get(), "application/x-mavlink");
    gst_harness_set_src_caps_str(h.get(), raw_caps);
  }
  Owned<GstBuffer> push(Owned<GstBuffer> buffer) {
    EXPECT_EQ(gst_harness_push(h.get(), buffer.release()), GST_FLOW_OK);
    return Owned<GstBuffer>(gst_harness_try_pull(h.get()));
  }
  Owned<GstBuffer> frame_of(const View& view, GstClockTime time) {
    OwnedEstimate estimate = blank(64, 48, 64, 48);
    auto buffer = frame_with(estimate.estimate, raw_size, 0);
    GST_BUFFER_PTS(buffer.get()) = time;
    EXPECT_TRUE(writer.attach(buffer.get(), view.metric()));
    return buffer;
  }
  /// OBSTACLE_DISTANCE of what one frame gives.
  std::optional<Packet> obstacles(Owned<GstBuffer> in) {
    const auto unit = push(std::move(in));
    if (!unit)
      return std::nullopt;
    for (const Packet& packet : packets_of(unit.get()))
      if (packet.id == 330)
        return packet;
    return std::nullopt;
  }
  Owned<GstHarness> h;
  MetricWriter writer;
};

TEST_F(Mavlink, AFrameByteForByte) {
  start();
  View view;
  // The golden frame's view: sectors 66 to 71 and 0 to 6, those of its unknown ones beyond the view or NaN.
  const std::string head = "fd090000"
                           "0001c4000000"
                           "00000000"
                           "1208000403";
  view.bearings = {static_cast<float>(10 * degree), static_cast<float>(5 * degree), 0.F,
                   static_cast<float>(-5 * degree), static_cast<float>(-10 * degree)};
  view.ranges = {8.F, 3.5F, 2.1F, 1.5F, INFINITY};
  OwnedEstimate estimate = blank(64, 48, 5, 48);
  auto buffer = frame_with(estimate.estimate, raw_size, 0);
  MetricEstimate metric = view.metric();
  metric.range_min = 0.2;
  ASSERT_TRUE(writer.attach(buffer.get(), metric));
  const Owned<GstCaps> unix_time(gst_caps_from_string("timestamp/x-unix"));
  gst_buffer_add_reference_timestamp_meta(buffer.get(), unix_time.get(), 1700000000123456000,
                                          GST_CLOCK_TIME_NONE);
  const auto unit = push(std::move(buffer));
  ASSERT_TRUE(unit);
  std::string hex;
  for (const char c : text_of(unit.get())) {
    char two[3];
    g_snprintf(two, sizeof two, "%02x", static_cast<unsigned char>(c));
    hex += two;
  }
  EXPECT_EQ(hex.substr(0, head.size()), head);
  std::string middle;
  for (int i = 0; i < 67; ++i)
    middle += "ffff";
  const std::size_t second = 2 * (10 + 9 + 2);
  EXPECT_EQ(hex.substr(second, hex.size() - second - 4), "fda7000001"
                                                         "01c44a0100"
                                                         "40222018240a0600"
                                                         "d20096002103" +
                                                             middle +
                                                             "20035e01"
                                                             "14002003"
                                                             "04"
                                                             "05"
                                                             "00000000"
                                                             "00000000"
                                                             "0c");
  EXPECT_EQ(packets_of(unit.get()).size(), 2u); // checks the sums
}

TEST_F(Mavlink, AnObstacleAt30DegreesIsThere) {
  for (const char* layout : {"portable", "fine"})
    for (const double right : {-30.0, -11.0, 0.0, 30.0}) {
      start((std::string("mavlink-layout=") + layout).c_str());
      View view;
      for (int i = 0; i < 64; ++i)
        if (std::abs(-view.bearings[i] / degree - right) < 1.2)
          view.ranges[i] = 2.5F;
      const auto packet = obstacles(frame_of(view, 0));
      ASSERT_TRUE(packet);
      const auto found = taken(*packet);
      ASSERT_FALSE(found.empty()) << layout << right;
      for (const Obstacle& obstacle : found) {
        EXPECT_DOUBLE_EQ(obstacle.metres, 2.5);
        EXPECT_NEAR(obstacle.right, right, *layout == 'p' ? 3.7 : 2.3);
      }
    }
}

TEST_F(Mavlink, FineSectorsStayWhereTheyAre) {
  for (const bool stated : {true, false}) {
    start("mavlink-layout=fine");
    std::optional<std::vector<double>> first;
    for (int i = 0; i < 5; ++i) {
      View view;
      for (float& bearing : view.bearings)
        bearing *= 1 + 0.05F * static_cast<float>(i % 3); // the boundary is nearer
      view.ranges[40] = 2;
      OwnedEstimate estimate = blank(64, 48, 64, 48);
      auto buffer = frame_with(estimate.estimate, raw_size, 0);
      GST_BUFFER_PTS(buffer.get()) = i * GST_SECOND;
      MetricEstimate metric = view.metric();
      metric.range_min += i * 0.01 * stated;
      if (stated)
        metric.fan = {-40 * degree, degree, 81, 0.3};
      ASSERT_TRUE(writer.attach(buffer.get(), metric));
      const auto packet = obstacles(std::move(buffer));
      ASSERT_TRUE(packet);
      std::vector<double> geometry;
      for (const Sector& sector : sectors_of(*packet))
        geometry.push_back(sector.right);
      geometry.push_back(static_cast<double>(packet->number(152, 2)));
      EXPECT_EQ(geometry, first.value_or(geometry)) << i;
      first = geometry;
      const auto found = taken(*packet);
      ASSERT_FALSE(found.empty());
      EXPECT_NEAR(found[0].right, -view.bearings[40] / degree, 2);
    }
    EXPECT_NEAR(first->front(), stated ? -40.5 + 81.0 / 144 : -34.45 + 68.9 / 144, 0.1);
  }
}

TEST_F(Mavlink, ArduPilotKeepsEveryBlockedColumn) {
  for (const char* layout : {"portable", "fine"}) {
    start((std::string("mavlink-layout=") + layout).c_str());
    for (int i = 0; i < 64; ++i) {
      View view;
      view.ranges[i] = i % 3 == 0   ? 0.05F
                       : i % 3 == 1 ? 0.3F
                                    : 7.99F; // nearer than what is seen, the nearest row, far
      const auto packet = obstacles(frame_of(view, i * GST_SECOND));
      ASSERT_TRUE(packet);
      const auto found = taken(*packet);
      ASSERT_GE(found.size(), 1u) << layout << i;
      ASSERT_LE(found.size(), 2u) << layout << i; // a fine sector between two columns is both
      for (const Obstacle& obstacle : found) {
        EXPECT_NEAR(obstacle.metres, std::max(view.ranges[i], 0.3F), 0.011);
        EXPECT_NEAR(obstacle.right, -view.bearings[i] / degree, 2.6);
      }
    }
  }
}

// Obstacles to the left and to the right of what is straight ahead share a face.
TEST_F(Mavlink, ArduPilotsFaceAheadHoldsTheNearest) {
  for (const double right : {-20.0, -8.0, 5.0, 20.0}) {
    View view;
    for (int i = 0; i < 64; ++i) {
      const double here = -view.bearings[i] / degree;
      if (std::abs(here - right) < 1.2)
        view.ranges[i] = 1.5F;
      else if (std::abs(here + right) < 1.2)
        view.ranges[i] = 3.5F;
      else if (std::abs(here - 30) < 1.2)
        view.ranges[i] = 2.5F;
    }
    start("mavlink-layout=fine");
    auto packet = obstacles(frame_of(view, 0));
    ASSERT_TRUE(packet);
    auto faces = faces_of(*packet);
    EXPECT_EQ(faces[0], 1.5) << right;
    EXPECT_EQ(faces[1], 2.5);
    EXPECT_EQ(faces[7], std::nullopt);
    // The other layout begins in the middle of the face: of what lies to the right nothing is left.
    start("mavlink-layout=portable");
    packet = obstacles(frame_of(view, 0));
    ASSERT_TRUE(packet);
    faces = faces_of(*packet);
    EXPECT_EQ(faces[0], right < 0 ? 1.5 : 3.5) << right;
    EXPECT_EQ(faces[1], 2.5);
  }
}

TEST_F(Mavlink, WhatIsNotKnownIsAnObstacleUnlessToldOtherwise) {
  start();
  Bus bus(h.get());
  // Without anything: the half circle ahead.
  auto packet = obstacles(frame(raw_size, 0));
  ASSERT_TRUE(packet);
  EXPECT_EQ(taken(*packet).size(), 37u);
  EXPECT_NE(bus.text(GST_MESSAGE_WARNING).find("camera-info"), std::string::npos);
  // With a view that is known from a frame before: that.
  View view;
  EXPECT_TRUE(taken(*obstacles(frame_of(view, GST_SECOND))).empty());
  auto without_metres = frame_with(blank(64, 48, 64, 48).estimate, raw_size, 50);
  packet = obstacles(std::move(without_metres));
  ASSERT_TRUE(packet);
  auto found = taken(*packet);
  EXPECT_EQ(found.size(), 15u);
  for (const Obstacle& obstacle : found) {
    EXPECT_DOUBLE_EQ(obstacle.metres, 0.3);
    EXPECT_LE(std::abs(obstacle.right), 35);
  }
  // Stale pose or not learned: NaN in every column.
  View stale;
  stale.ranges.assign(64, NAN);
  stale.bearings.assign(64, NAN);
  EXPECT_EQ(taken(*obstacles(frame_of(stale, 3 * GST_SECOND))).size(), 15u);
  // Half of it.
  View half;
  for (int i = 0; i < 32; ++i)
    half.ranges[i] = NAN;
  for (const Obstacle& obstacle : taken(*obstacles(frame_of(half, 4 * GST_SECOND))))
    EXPECT_LT(obstacle.right, 2.5);
  g_object_set(h->element, "mavlink-unknown", 1, nullptr);
  EXPECT_TRUE(taken(*obstacles(frame_of(stale, 5 * GST_SECOND))).empty());
  EXPECT_EQ(bus.text(GST_MESSAGE_WARNING), "") << "once is enough";
}

/// Messages of `seconds` of video: how many, and the longest time between two.
struct Rate {
  int obstacles = 0, heartbeats = 0;
  double longest = 0;
};

TEST_F(Mavlink, RatesAt60And30And5AndOthers) {
  for (const auto& [n, d] : {std::pair{60, 1},
                             {30, 1},
                             {30000, 1001},
                             {25, 1},
                             {24, 1},
                             {20, 1},
                             {16, 1},
                             {15, 1},
                             {10, 1},
                             {5, 1},
                             {4, 1}}) {
    start();
    const View view;
    const double fps = static_cast<double>(n) / d;
    Rate rate;
    double last = 0;
    unsigned sequence = 0;
    const int frames = static_cast<int>(20 * fps);
    for (int i = 0; i < frames; ++i) {
      // Milliseconds, as some containers keep them.
      const GstClockTime time = gst_util_uint64_scale(i, GST_SECOND * d, n) / GST_MSECOND * GST_MSECOND;
      const auto unit = push(frame_of(view, time));
      if (!unit)
        continue;
      EXPECT_EQ(GST_BUFFER_PTS(unit.get()), time);
      for (const Packet& packet : packets_of(unit.get())) {
        EXPECT_EQ(packet.sequence, sequence++ & 255);
        rate.heartbeats += packet.id == 0;
        if (packet.id != 330)
          continue;
        const double now = static_cast<double>(time) / GST_SECOND;
        rate.longest = std::max(rate.longest, now - last);
        last = now;
        ++rate.obstacles;
      }
    }
    EXPECT_LE(rate.obstacles, 20 * 15 + 1) << fps;
    EXPECT_GE(rate.obstacles, std::min(20 * 10.0, 20 * fps) - 1) << fps;
    EXPECT_LE(rate.longest, 0.25 + 0.002) << fps;
    EXPECT_NEAR(rate.heartbeats, 20, 1) << fps;
  }
}

TEST_F(Mavlink, TimeThatStartsAnewIsNoSilence) {
  start();
  const View view;
  EXPECT_TRUE(push(frame_of(view, 100 * GST_SECOND)));
  EXPECT_FALSE(push(frame_of(view, 100 * GST_SECOND + 20 * GST_MSECOND)));
  EXPECT_TRUE(push(frame_of(view, 0))) << "back by minutes";
  EXPECT_FALSE(push(frame_of(view, 20 * GST_MSECOND)));
  EXPECT_TRUE(push(frame_of(view, 7 * GST_SECOND))) << "and on";
  gst_harness_push_event(h.get(), gst_event_new_flush_start());
  gst_harness_push_event(h.get(), gst_event_new_flush_stop(TRUE));
  GstSegment segment;
  gst_segment_init(&segment, GST_FORMAT_TIME);
  gst_harness_push_event(h.get(), gst_event_new_segment(&segment));
  EXPECT_TRUE(push(frame_of(view, 7 * GST_SECOND + GST_MSECOND))) << "after a flush";
  EXPECT_TRUE(push(frame_of(view, GST_CLOCK_TIME_NONE))) << "without a time";
}

TEST_F(Mavlink, GapsPassAndFramesBetweenTwoMessagesAreGaps) {
  start();
  const View view;
  EXPECT_TRUE(push(frame_of(view, 0)));
  EXPECT_FALSE(next_event(h.get(), GST_EVENT_GAP));
  EXPECT_FALSE(push(frame_of(view, 33 * GST_MSECOND)));
  EXPECT_TRUE(next_event(h.get(), GST_EVENT_GAP));
  gst_harness_push_event(h.get(), gst_event_new_gap(66 * GST_MSECOND, GST_SECOND));
  const auto gap = next_event(h.get(), GST_EVENT_GAP);
  ASSERT_TRUE(gap);
  GstClockTime start = 0;
  gst_event_parse_gap(gap.get(), &start, nullptr);
  EXPECT_EQ(start, 66 * GST_MSECOND);
}

TEST_F(Mavlink, TheSenderIsWhoTheUserSays) {
  start("system-id=7 component-id=158");
  const View view;
  const auto unit = push(frame_of(view, 0));
  const auto packets = packets_of(unit.get());
  ASSERT_EQ(packets.size(), 2u);
  EXPECT_EQ(packets[0].id, 0u);
  for (const Packet& packet : packets) {
    EXPECT_EQ(packet.system, 7u);
    EXPECT_EQ(packet.component, 158u);
  }
  EXPECT_EQ(packets[1].number(156, 1), 4u);  // unknown sensor
  EXPECT_EQ(packets[1].number(166, 1), 12u); // body frame
  EXPECT_EQ(packets[1].number(154, 2), 800u);
}

} // namespace
} // namespace terrainseg::test
