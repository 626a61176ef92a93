// SPDX-License-Identifier: LGPL-2.1-or-later
#include "exchange/json_lines.hpp"

#include <algorithm>
#include <limits>

#include <gtest/gtest.h>
#include <random>
#include <vector>

#include "exchange/bytes.hpp"

namespace terrainseg {
namespace {

Estimate small_estimate(const std::vector<std::uint16_t>& boundary) {
  Estimate e;
  e.frame = 12;
  e.frame_width = 1280;
  e.frame_height = 720;
  e.horizon_row = 301;
  e.horizon_confidence = 200;
  e.confidence = 255;
  e.traversable_permille = 340;
  e.window = {448, 612, 384, 108};
  e.model_generation = 5;
  e.flags = flag_learned | flag_blocked;
  e.boundary = boundary;
  e.model_count = 1;
  e.models[0].mean = {128, 0x8000, 0xffff};
  e.models[0].variance = {0, 256, 0xffffffff};
  e.models[0].mass = 18446744073709551615ull;
  return e;
}

std::string line_of(const Estimate& e, std::int64_t pts, bool mask) {
  std::string out;
  append_json_line(out, e, pts, mask);
  return out;
}

TEST(JsonLines, MotionWhereItFoundSomething) {
  Estimate e = small_estimate({});
  EXPECT_EQ(line_of(e, 0, false).find("motion"), std::string::npos);
  e.vanishing_row = 280 * 65536 + 16384;
  e.speed_over_height = -3 * 65536 / 2;
  EXPECT_NE(line_of(e, 0, false)
                .find("}, \"motion\": {\"vanishing_row\": 280.25, \"speed_over_height\": -1.5}, \"tra"),
            std::string::npos);
  e.vanishing_row = -1;
  EXPECT_NE(line_of(e, 0, false).find("{\"vanishing_row\": null, "), std::string::npos);
}

TEST(JsonLines, WholeLine) {
  const std::vector<std::uint16_t> boundary = {0, 360, 719, 720, 65535};
  EXPECT_EQ(line_of(small_estimate(boundary), 480000000, false),
            "{\"frame\": 12, \"pts\": 480000000, \"width\": 1280, \"height\": 720, "
            "\"horizon\": {\"row\": 301, \"confidence\": 200}, \"traversable\": 0.34, \"confidence\": 255, "
            "\"boundary\": [0,0.5,0.9986,1,1], \"window\": [448,612,384,108], \"generation\": 5, "
            "\"flags\": [\"learned\",\"blocked\"], \"models\": [{\"mean\": [0.5,128,255.996], "
            "\"variance\": [0,1,16777215.996], \"mass\": 18446744073709551615}]}\n");
}

TEST(JsonLines, UnknownIsNull) {
  const Estimate e;
  EXPECT_EQ(line_of(e, -1, true),
            "{\"frame\": 0, \"pts\": null, \"width\": 0, \"height\": 0, "
            "\"horizon\": {\"row\": null, \"confidence\": 0}, \"traversable\": 0, \"confidence\": 0, "
            "\"boundary\": [], \"window\": [0,0,0,0], \"generation\": 0, \"flags\": [\"unknown\"], "
            "\"models\": [], \"mask\": {\"width\": 0, \"height\": 0, \"runs\": []}}\n");
}

TEST(JsonLines, MetresAndWallClockWhereTheyAreKnown) {
  const float nan = std::numeric_limits<float>::quiet_NaN(), free = std::numeric_limits<float>::infinity();
  const std::vector<float> ranges{1.5F, 2.125F, free, nan}, bearings{0.5F, -0.000035F, 0, nan},
      low{1.25F, 2, 7.5F, nan}, high{2, free, free, nan};
  const MetricEstimate metric{ranges, bearings,        low, high, 0.5, 0.174533, -0.0349, 0, 0.75,
                              8.25,   metric_flag_pose};
  std::string out;
  append_json_line(out, Estimate{}, -1, false, {&metric, 1795377600123456789u});
  EXPECT_EQ(out,
            "{\"frame\": 0, \"pts\": null, \"utc\": \"2026-11-22T20:00:00.123456Z\", \"width\": 0, "
            "\"height\": 0, \"horizon\": {\"row\": null, \"confidence\": 0}, \"traversable\": 0, "
            "\"confidence\": 0, \"boundary\": [], \"window\": [0,0,0,0], \"generation\": 0, \"flags\": "
            "[\"unknown\"], \"models\": [], \"metric\": {\"ranges\": [1.5,2.125,8.25,null], \"bearings\": "
            "[0.5,-0.000035,0,null], \"low\": [1.25,2,7.5,null], \"high\": [2,8.25,8.25,null], \"free\": "
            "[false,false,true,false], \"height\": 0.5, \"pitch\": 0.174533, \"roll\": -0.0349, \"yaw\": 0, "
            "\"range_min\": 0.75, \"range_max\": 8.25, \"posed\": true, \"horizon_off\": false}}\n");
}

TEST(JsonLines, WallClock) {
  EXPECT_EQ(utc_text(0), "1970-01-01T00:00:00.000000Z");
  EXPECT_EQ(utc_text(951782399999999999u), "2000-02-28T23:59:59.999999Z");
  EXPECT_EQ(utc_text(951782400000000000u), "2000-02-29T00:00:00.000000Z");
  EXPECT_EQ(utc_text(9223372036854775807u), "2262-04-11T23:47:16.854775Z");
}

TEST(JsonLines, AppendsAndEndsEveryLine) {
  std::string out;
  append_json_line(out, {}, 1, false);
  const std::string one = out;
  append_json_line(out, {}, 1, false);
  EXPECT_EQ(out, one + one);
  EXPECT_EQ(std::count(out.begin(), out.end(), '\n'), 2);
}

// Four decimals name every row: parsed back and rounded, each row of each height is itself.
TEST(JsonLines, BoundaryRowsComeBackExactly) {
  for (const int height : {1, 2, 7, 480, 719, 1080, 2160, 4999, 9999}) {
    std::vector<std::uint16_t> rows;
    for (int r = 0; r <= height; r += height > 3000 ? 3 : 1)
      rows.push_back(static_cast<std::uint16_t>(r));
    Estimate e;
    e.frame_height = height;
    e.boundary = rows;
    const std::string line = line_of(e, 0, false);
    std::size_t at = line.find("\"boundary\": [") + 13;
    for (const std::uint16_t row : rows) {
      std::size_t used = 0;
      const double fraction = std::stod(line.substr(at, 12), &used);
      EXPECT_EQ(static_cast<int>(fraction * height + 0.5), row) << height;
      EXPECT_LE(used, 6u);
      at += used + 1;
    }
    EXPECT_EQ(line[at - 1], ']');
  }
}

TEST(JsonLines, MaskRunsAreTheMask) {
  std::mt19937 random(1);
  for (int trial = 0; trial < 300; ++trial) {
    const int w = 1 + static_cast<int>(random() % 130), h = 1 + static_cast<int>(random() % 9);
    const int stride = w + static_cast<int>(random() % 5);
    std::vector<std::uint8_t> pixels(static_cast<std::size_t>(stride) * h, 77);
    constexpr std::uint8_t values[] = {0, 128, 255};
    const unsigned stay = 1 + random() % 60;
    std::uint8_t v = 0;
    for (int y = 0; y < h; ++y)
      for (int x = 0; x < w; ++x) {
        if (random() % stay == 0)
          v = values[random() % 3];
        pixels[static_cast<std::size_t>(y * stride + x)] = v;
      }
    Estimate e;
    e.mask = {{pixels.data(), stride}, w, h};
    const std::string line = line_of(e, 0, true);
    std::size_t at = line.find("\"runs\": [") + 9;
    std::vector<int> unrolled;
    int last = -1;
    while (line[at] != ']') {
      std::size_t used = 0;
      const int value = std::stoi(line.substr(at), &used);
      at += used + 1;
      const int length = std::stoi(line.substr(at), &used);
      at += used;
      EXPECT_NE(value, last) << "neighbouring runs of one value";
      EXPECT_GT(length, 0);
      last = value;
      unrolled.insert(unrolled.end(), static_cast<std::size_t>(length), value);
      if (line[at] == ',')
        ++at;
    }
    ASSERT_EQ(unrolled.size(), static_cast<std::size_t>(w) * h);
    for (int y = 0; y < h; ++y)
      for (int x = 0; x < w; ++x)
        ASSERT_EQ(unrolled[static_cast<std::size_t>(y * w + x)],
                  pixels[static_cast<std::size_t>(y * stride + x)]);
  }
}

} // namespace
} // namespace terrainseg
