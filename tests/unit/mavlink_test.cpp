// SPDX-License-Identifier: LGPL-2.1-or-later
// MAVLink frames byte for byte, and sectors as an autopilot reads them.

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>
#include <string>

#include "exchange/mavlink_stream.hpp"

namespace terrainseg {
namespace {

constexpr float degree = static_cast<float>(std::numbers::pi / 180);

std::string hex(const std::vector<std::uint8_t>& bytes) {
  std::string text;
  for (std::uint8_t byte : bytes) {
    text += "0123456789abcdef"[byte >> 4];
    text += "0123456789abcdef"[byte & 15];
  }
  return text;
}

TEST(Mavlink, ObstacleDistanceByteForByte) {
  ObstacleDistance message;
  message.time_us = 1700000000123456;
  message.min_distance = 20;
  message.max_distance = 800;
  message.distances.fill(mavlink_unknown_distance);
  message.distances[70] = 800;
  message.distances[71] = 350;
  message.distances[0] = 210;
  message.distances[1] = 150;
  message.distances[2] = 801;
  message.distances[66] = 1;
  message.distances[6] = 500;
  std::vector<std::uint8_t> bytes;
  std::uint8_t sequence = 0;
  append_obstacle_distance(bytes, message, {1, 196}, sequence);
  std::string middle;
  for (int i = 0; i < 59; ++i)
    middle += "ffff";
  EXPECT_EQ(hex(bytes), "fda700000001c44a010040222018240a0600d20096002103fffffffffffff401" + middle +
                            "0100ffffffffffff20035e0114002003040500000000000000000c8826");
  EXPECT_EQ(sequence, 1);
}

TEST(Mavlink, HeartbeatIsCutAndCounted) {
  std::vector<std::uint8_t> bytes;
  std::uint8_t sequence = 255;
  append_heartbeat(bytes, {}, sequence);
  EXPECT_EQ(sequence, 0);
  EXPECT_EQ(hex(bytes).substr(0, 38), "fd090000ff01c4000000"
                                      "00000000"
                                      "1208000403");
}

// What ArduPilot takes: distances from min to max; anything else is passed over. Written from its
// documentation.
bool taken(const ObstacleDistance& message, int sector) {
  const int distance = message.distances[sector];
  return distance > 0 && distance != 65535 && distance >= message.min_distance &&
         distance <= message.max_distance;
}
double clockwise_of(const ObstacleDistance& message, int sector) {
  const double width = message.increment_f > 0 ? message.increment_f : message.increment;
  double angle = message.angle_offset + sector * width;
  return angle > 180 ? angle - 360 : angle;
}

struct Columns {
  std::vector<float> ranges, bearings;
};
Columns free_view(double half_width = 35, int count = 320) {
  Columns columns;
  for (int i = 0; i < count; ++i) {
    columns.ranges.push_back(INFINITY);
    columns.bearings.push_back(static_cast<float>((half_width - 2 * half_width * (i + 0.5) / count)) *
                               degree);
  }
  return columns;
}

ObstacleDistance sectors_of(const Columns& columns, MavlinkLayout layout, MavlinkUnknown unknown,
                            double min_m, double max_m) {
  return obstacle_distance(mavlink_view(columns.bearings).value(), columns.ranges, columns.bearings, layout,
                           unknown, min_m, max_m);
}

class BothLayouts : public testing::TestWithParam<MavlinkLayout> {};
INSTANTIATE_TEST_SUITE_P(Mavlink, BothLayouts, testing::Values(MavlinkLayout::portable, MavlinkLayout::fine));

TEST_P(BothLayouts, AnObstacleLandsWhereItIs) {
  for (double right : {-30.0, -12.0, 0.0, 7.0, 30.0}) {
    Columns columns = free_view();
    for (std::size_t i = 0; i < columns.ranges.size(); ++i)
      if (std::abs(-columns.bearings[i] / degree - right) < 1)
        columns.ranges[i] = 2.5f;
    const auto message = sectors_of(columns, GetParam(), MavlinkUnknown::obstacle, 0.2, 8);
    int found = 0;
    for (int sector = 0; sector < mavlink_sectors; ++sector)
      if (taken(message, sector)) {
        ++found;
        EXPECT_EQ(message.distances[sector], 250);
        EXPECT_NEAR(clockwise_of(message, sector), right, GetParam() == MavlinkLayout::portable ? 3.6 : 1.5);
      }
    EXPECT_GE(found, 1) << right;
  }
}

TEST_P(BothLayouts, EveryBlockedColumnIsKept) {
  for (int i = 0; i < 320; i += 7) {
    Columns columns = free_view();
    columns.ranges[i] = i % 2 ? 0.05f : 7.99f; // nearer than the least distance, too
    const auto message = sectors_of(columns, GetParam(), MavlinkUnknown::obstacle, 0.2, 8);
    int found = 0;
    for (int sector = 0; sector < mavlink_sectors; ++sector)
      found += taken(message, sector);
    EXPECT_EQ(found, 1) << i;
  }
}

TEST_P(BothLayouts, FreeIsSaidAndUnknownIsNoFreeWay) {
  Columns columns = free_view();
  const auto message = sectors_of(columns, GetParam(), MavlinkUnknown::obstacle, 0.2, 8);
  int said_free = 0;
  for (int sector = 0; sector < mavlink_sectors; ++sector) {
    EXPECT_TRUE(message.distances[sector] == 801 || message.distances[sector] == mavlink_unknown_distance);
    said_free += message.distances[sector] == 801;
  }
  EXPECT_EQ(said_free, GetParam() == MavlinkLayout::portable ? 15 : 72);
  for (float& range : columns.ranges)
    range = NAN;
  const auto unknown = sectors_of(columns, GetParam(), MavlinkUnknown::obstacle, 0.2, 8);
  const auto nothing = sectors_of(columns, GetParam(), MavlinkUnknown::nothing, 0.2, 8);
  for (int sector = 0; sector < mavlink_sectors; ++sector) {
    EXPECT_EQ(unknown.distances[sector], message.distances[sector] == 801 ? 20 : 65535) << sector;
    EXPECT_EQ(nothing.distances[sector], 65535);
  }
}

TEST_P(BothLayouts, WithoutColumnsTheViewIsUnknown) {
  const std::vector<float> none(10, NAN);
  EXPECT_FALSE(mavlink_view(none));
  const auto message = obstacle_distance({-40, 40}, none, none, GetParam(), MavlinkUnknown::obstacle, 0.2, 8);
  for (int sector = 0; sector < mavlink_sectors; ++sector) {
    const bool inside = std::abs(clockwise_of(message, sector)) <= 42.5;
    EXPECT_EQ(message.distances[sector], inside ? 20 : mavlink_unknown_distance) << sector;
  }
  const auto nothing = obstacle_distance({-40, 40}, none, none, GetParam(), MavlinkUnknown::nothing, 0.2, 8);
  for (std::uint16_t distance : nothing.distances)
    EXPECT_EQ(distance, mavlink_unknown_distance);
}

// A mask of a coarse level has fewer columns than there are sectors, and a lens spaces them unevenly.
TEST_P(BothLayouts, FewColumnsLeaveNoHolesAndNoGhosts) {
  Columns columns;
  for (int i = 0; i < 40; ++i) {
    columns.ranges.push_back(i == 20 ? 3.0f : INFINITY);
    columns.bearings.push_back(static_cast<float>(std::atan((19.5 - i) / 19.5 * 0.7)));
  }
  const auto message = sectors_of(columns, GetParam(), MavlinkUnknown::obstacle, 0.2, 8);
  int blocked = 0;
  for (int sector = 0; sector < mavlink_sectors; ++sector) {
    const double angle = clockwise_of(message, sector);
    if (taken(message, sector)) {
      ++blocked;
      EXPECT_EQ(message.distances[sector], 300);
      EXPECT_LT(std::abs(angle), 3.1);
    } else {
      EXPECT_EQ(message.distances[sector], std::abs(angle) < 37.4 ? 801 : mavlink_unknown_distance) << angle;
    }
  }
  EXPECT_GE(blocked, 1);
}

TEST(MavlinkStream, GoesOnAfterTimesThatNoStreamHas) {
  constexpr std::int64_t least = std::numeric_limits<std::int64_t>::min(),
                         most = std::numeric_limits<std::int64_t>::max();
  for (const std::int64_t odd : {least, most, least + 1, most - 1, std::int64_t{-2}}) {
    MavlinkStream stream;
    EXPECT_FALSE(stream.at(0, 0, nullptr, {}).empty());
    stream.at(odd, 0, nullptr, {});
    stream.at(odd, 0, nullptr, {});
    for (const std::int64_t other : {least, most, std::int64_t{0}})
      stream.at(other, 0, nullptr, {});
    stream.at(1'000'000'000, 0, nullptr, {});
    EXPECT_FALSE(stream.at(2'000'000'000, 0, nullptr, {}).empty()) << odd;
  }
}

} // namespace
} // namespace terrainseg
