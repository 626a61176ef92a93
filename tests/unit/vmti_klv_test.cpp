// SPDX-License-Identifier: LGPL-2.1-or-later
// The byte sequences called "published" are from the tests of jmisb (github.com/WestRidgeSystems/jmisb,
// module st0903, Copyright 2021 jmisb.org, MIT licence), which take them from MISB ST 0903. A decoder written
// apart from this one, in Python, is tests/unit/klv_decoder.py.
#include "exchange/vmti_klv.hpp"

#include <algorithm>

#include <gtest/gtest.h>

#include "exchange/bytes.hpp"
#include "exchange_estimates.hpp"
#include "support/same_estimate.hpp"

namespace terrainseg {
namespace {

using test::OwnedEstimate;
using test::packed;
using Bytes = std::vector<std::uint8_t>;

Bytes encoded(const Estimate& e, std::uint64_t time = 0) {
  KlvEncoder encoder;
  const auto unit = encoder.encode(e, time);
  return {unit.begin(), unit.end()};
}

bool contains(const Bytes& bytes, const Bytes& part) {
  return std::search(bytes.begin(), bytes.end(), part.begin(), part.end()) != bytes.end();
}

/// The checksum by its definition in ST 0601: a running 16-bit sum, bytes at even positions in the upper
/// half.
std::uint16_t slow_sum(const Bytes& bytes, std::size_t n) {
  std::uint16_t sum = 0;
  for (std::size_t i = 0; i < n; ++i)
    sum = static_cast<std::uint16_t>(sum + (bytes[i] << (8 * ((i + 1) % 2))));
  return sum;
}

void fix_sums(Bytes& unit) {
  // the unit ends: 127 4 CRC-32, 1 2 checksum
  const std::uint32_t crc = crc32(std::span(unit).first(unit.size() - 8));
  for (std::size_t i = 0; i < 4; ++i)
    unit[unit.size() - 8 + i] = static_cast<std::uint8_t>(crc >> (24 - 8 * i));
  const std::uint16_t sum = slow_sum(unit, unit.size() - 2);
  unit[unit.size() - 2] = static_cast<std::uint8_t>(sum >> 8);
  unit[unit.size() - 1] = static_cast<std::uint8_t>(sum);
}

Bytes drawn(const KlvUnit& unit) {
  const GrayView& m = unit.estimate().mask;
  Bytes pixels(static_cast<std::size_t>(m.width) * static_cast<std::size_t>(m.height), 7);
  unit.draw_mask({pixels.data(), m.width});
  return pixels;
}

void expect_same_numbers_and_colors(const Estimate& a, const Estimate& b) {
  test::expect_same_numbers(a, b);
  for (std::size_t i = 0; i < static_cast<std::size_t>(a.model_count); ++i)
    EXPECT_EQ(a.models[i].rgb, b.models[i].rgb);
}

TEST(VmtiKlv, ComesBackAsItWas) {
  std::mt19937 random(1);
  KlvEncoder encoder;
  KlvUnit unit;
  for (int trial = 0; trial < 400; ++trial) {
    const int fw = 1 + static_cast<int>(random() % 400), fh = 1 + static_cast<int>(random() % 300);
    const OwnedEstimate o = test::noisy(fw, fh, 1 + static_cast<int>(random() % 200),
                                        1 + static_cast<int>(random() % 90), 20 + random() % 200, random);
    const std::uint64_t time = (std::uint64_t{random()} << 32) | random();
    const auto bytes = encoder.encode(o.estimate, time);
    ASSERT_LE(bytes.size(), klv_unit_limit);
    ASSERT_EQ(unit.decode(bytes), KlvVerdict::ok) << unit.error();
    EXPECT_EQ(unit.time_us(), time);
    expect_same_numbers_and_colors(unit.estimate(), o.estimate);
    ASSERT_EQ(unit.estimate().mask.width, o.estimate.mask.width);
    ASSERT_EQ(unit.estimate().mask.height, o.estimate.mask.height);
    EXPECT_EQ(unit.sender_mask_width(), o.estimate.mask.width);
    EXPECT_EQ(unit.sender_mask_height(), o.estimate.mask.height);
    EXPECT_EQ(drawn(unit), packed(o.estimate.mask));
    EXPECT_TRUE(std::ranges::equal(unit.estimate().boundary, o.estimate.boundary));
  }
}

TEST(VmtiKlv, ExtremesComeBack) {
  OwnedEstimate o = test::blank(32767, 32767, 1, 1);
  o.pixels[0] = mask_traversable;
  o.estimate.mask_region = {32766, 0, 1, 32767};
  o.estimate.window = {0, 0, 32767, 32767};
  o.estimate.horizon_row = 32766;
  o.estimate.flags = 0xffffffff;
  o.rows = {0};
  o.estimate.boundary = o.rows;
  KlvUnit unit;
  ASSERT_EQ(unit.decode(encoded(o.estimate, ~0ull)), KlvVerdict::ok) << unit.error();
  expect_same_numbers_and_colors(unit.estimate(), o.estimate);
  EXPECT_EQ(unit.time_us(), ~0ull);
  EXPECT_EQ(drawn(unit), Bytes{255});

  o.estimate.boundary = {};
  ASSERT_EQ(unit.decode(encoded(o.estimate)), KlvVerdict::ok) << unit.error();
  EXPECT_TRUE(unit.estimate().boundary.empty());
}

TEST(VmtiKlv, WhatLiesOutsideTheFrameIsRefused) {
  KlvUnit unit;
  const auto verdict = [&](auto change) {
    OwnedEstimate o = test::blank(20, 10, 20, 10);
    change(o);
    return unit.decode(encoded(o.estimate));
  };
  EXPECT_EQ(verdict([](OwnedEstimate&) {}), KlvVerdict::ok);
  EXPECT_EQ(verdict([](OwnedEstimate& o) { o.estimate.window = {10, 5, 10, 5}; }), KlvVerdict::ok);
  EXPECT_EQ(verdict([](OwnedEstimate& o) { o.estimate.window = {10, 5, 11, 5}; }), KlvVerdict::damaged);
  EXPECT_EQ(verdict([](OwnedEstimate& o) { o.estimate.mask_region.y = -1; }), KlvVerdict::damaged);
  EXPECT_EQ(verdict([](OwnedEstimate& o) { o.estimate.horizon_row = 10; }), KlvVerdict::damaged);
  EXPECT_EQ(verdict([](OwnedEstimate& o) { o.rows[3] = 11; }), KlvVerdict::damaged);
  EXPECT_EQ(verdict([](OwnedEstimate& o) { o.estimate.boundary = o.estimate.boundary.first(19); }),
            KlvVerdict::damaged);
  EXPECT_EQ(verdict([](OwnedEstimate& o) { o.estimate.frame_width = 0; }), KlvVerdict::damaged);
}

TEST(VmtiKlv, NoMaskNoUnit) {
  KlvEncoder encoder;
  EXPECT_TRUE(encoder.encode({}, 0).empty());
}

// Published: VMaskLSTest, BitMaskSeriesTest: runs (74, 2), (89, 4), (106, 2) of the standard's figure.
TEST(VmtiKlv, PublishedBitMaskSeries) {
  OwnedEstimate o = test::blank(32, 6, 32, 6);
  for (const int pixel : {74, 75, 89, 90, 91, 92, 106, 107})
    o.pixels[static_cast<std::size_t>(pixel - 1)] = mask_traversable;
  EXPECT_TRUE(contains(encoded(o.estimate), {0x65, 0x0e, 0x02, 0x0c, 0x03, 0x01, 0x4a, 0x02, 0x03, 0x01, 0x59,
                                             0x04, 0x03, 0x01, 0x6a, 0x02}));
}

// Published: VmtiLocalSetOneWithTheLotTest: time stamp, version 5, frame number, 1920 x 1080, the
// centroid 409600 = 0x064000.
TEST(VmtiKlv, PublishedValues) {
  OwnedEstimate o = test::blank(1920, 1080, 1920, 1080);
  o.estimate.frame = 78000;
  const Bytes unit = encoded(o.estimate, 0x0003824430f6ce40);
  EXPECT_TRUE(contains(unit, {0x02, 0x08, 0x00, 0x03, 0x82, 0x44, 0x30, 0xf6, 0xce, 0x40}));
  EXPECT_TRUE(contains(unit, {0x04, 0x01, 0x05}));
  EXPECT_TRUE(contains(unit, {0x07, 0x03, 0x01, 0x30, 0xb0}));
  EXPECT_TRUE(contains(unit, {0x08, 0x02, 0x07, 0x80, 0x09, 0x02, 0x04, 0x38}));

  // A horizon whose middle is pixel 409600: row 320 of 1278 columns, column 640.
  OwnedEstimate wide = test::blank(1278, 1000, 1278, 1000);
  wide.estimate.horizon_row = 320;
  wide.estimate.horizon_confidence = 204;
  ASSERT_EQ(320 * 1278 + 640, 409600);
  const Bytes horizon = encoded(wide.estimate);
  EXPECT_TRUE(contains(horizon, {0x01, 0x03, 0x06, 0x40, 0x00})) << "target centroid";
  EXPECT_TRUE(contains(horizon, {0x05, 0x01, 0x50})) << "confidence 80 %";
  EXPECT_TRUE(contains(horizon, {0x13, 0x02, 0x01, 0x41, 0x14, 0x02, 0x02, 0x80})) << "row 321, column 640";
}

// Published: VmtiLocalSetTest, a whole set with its checksum 0x9f97.
TEST(VmtiKlv, PublishedChecksum) {
  const Bytes published = {0x06, 0x0e, 0x2b, 0x34, 0x02, 0x0b, 0x01, 0x01, 0x0e, 0x01, 0x03, 0x03, 0x06, 0x00,
                           0x00, 0x00, 0x17, 0x03, 0x0e, 0x44, 0x53, 0x54, 0x4f, 0x5f, 0x41, 0x44, 0x53, 0x53,
                           0x5f, 0x56, 0x4d, 0x54, 0x49, 0x04, 0x01, 0x04, 0x01, 0x02, 0x9f, 0x97};
  ASSERT_EQ(slow_sum(published, published.size() - 2), 0x9f97);
  KlvUnit unit;
  EXPECT_EQ(unit.decode(published), KlvVerdict::foreign) << "whole, but another maker's";
  EXPECT_NE(unit.error().find("another maker"), std::string::npos) << unit.error();
  Bytes bad = published;
  bad.back() ^= 1;
  EXPECT_EQ(unit.decode(bad), KlvVerdict::damaged);

  std::mt19937 random(2);
  for (int i = 0; i < 20; ++i) { // odd and even lengths
    const OwnedEstimate o = test::noisy(90, 70, 40 + i, 30, 30, random);
    const Bytes ours = encoded(o.estimate);
    EXPECT_EQ(slow_sum(ours, ours.size() - 2), ours[ours.size() - 2] << 8 | ours.back());
  }
}

TEST(VmtiKlv, SkipsSetsBeforeOurs) {
  const OwnedEstimate o = test::blank(8, 8, 8, 8);
  const Bytes ours = encoded(o.estimate);
  Bytes two = {0x06, 0x0e, 0x2b, 0x34, 0x02, 0x0b, 0x01, 0x01, 0x0e, 0x01,
               0x03, 0x01, 0x01, 0x00, 0x00, 0x00, 0x03, 0x41, 0x01, 0x11};
  KlvUnit unit;
  EXPECT_EQ(unit.decode(two), KlvVerdict::foreign);
  two.insert(two.end(), ours.begin(), ours.end());
  EXPECT_EQ(unit.decode(two), KlvVerdict::ok) << unit.error();
}

TEST(VmtiKlv, NewerVersionIsForeign) {
  const OwnedEstimate o = test::blank(8, 8, 8, 8);
  Bytes bytes = encoded(o.estimate);
  const auto label = std::search(bytes.begin(), bytes.end(), terrain_label.begin(), terrain_label.end());
  ASSERT_NE(label, bytes.end());
  ASSERT_EQ(label[16], 1);
  label[18] = 2;
  fix_sums(bytes);
  KlvUnit unit;
  EXPECT_EQ(unit.decode(bytes), KlvVerdict::foreign);
  EXPECT_NE(unit.error().find("version 2"), std::string::npos) << unit.error();
}

// A checkerboard cannot be sent at its size: it is halved, and halving never adds free space.
TEST(VmtiKlv, HalvesUntilItFits) {
  for (const unsigned calm : {1u, 2u, 5u}) {
    std::mt19937 random(3);
    OwnedEstimate o = test::noisy(1921, 1079, 1921, 1079, calm, random);
    const Bytes bytes = encoded(o.estimate);
    ASSERT_LE(bytes.size(), klv_unit_limit);
    KlvUnit unit;
    ASSERT_EQ(unit.decode(bytes), KlvVerdict::ok) << unit.error();
    EXPECT_EQ(unit.sender_mask_width(), 1921);
    EXPECT_EQ(unit.sender_mask_height(), 1079);
    expect_same_numbers_and_colors(unit.estimate(), o.estimate);
    const int w = unit.estimate().mask.width, h = unit.estimate().mask.height;
    int level = 0;
    while (subsampled(1921, level) > w)
      ++level;
    EXPECT_GT(level, 0);
    EXPECT_EQ(w, subsampled(1921, level));
    EXPECT_EQ(h, subsampled(1079, level));
    const Bytes pixels = drawn(unit);
    ASSERT_EQ(unit.estimate().boundary.size(), static_cast<std::size_t>(w));
    for (int y = 0; y < h; ++y)
      for (int x = 0; x < w; ++x) {
        std::uint8_t least = 255;
        for (int v = y << level; v < std::min((y + 1) << level, 1079); ++v)
          for (int u = x << level; u < std::min((x + 1) << level, 1921); ++u)
            least = std::min(least, o.pixel(u, v));
        ASSERT_EQ(pixels[static_cast<std::size_t>(y * w + x)], least) << x << " " << y << " level " << level;
      }
    for (int x = 0; x < w; ++x) {
      std::uint16_t nearest = 0;
      for (int u = x << level; u < std::min((x + 1) << level, 1921); ++u)
        nearest = std::max(nearest, o.rows[static_cast<std::size_t>(u)]);
      ASSERT_EQ(unit.estimate().boundary[static_cast<std::size_t>(x)], nearest);
    }
  }
}

TEST(VmtiKlv, WideBoundaryIsHalvedToo) {
  OwnedEstimate o = test::blank(32767, 30000, 32767, 1);
  for (std::size_t i = 0; i < o.rows.size(); ++i)
    o.rows[i] = i % 2 ? 30000 : 0; // three bytes a column
  const Bytes bytes = encoded(o.estimate);
  EXPECT_LE(bytes.size(), klv_unit_limit);
  KlvUnit unit;
  ASSERT_EQ(unit.decode(bytes), KlvVerdict::ok) << unit.error();
  EXPECT_EQ(unit.estimate().boundary.size(), 16384u);
}

// What a rover sees fits at full size: the condition for a mask that arrives as it was sent.
TEST(VmtiKlv, GroundFitsAtFullHd) {
  std::mt19937 random(4);
  for (int i = 0; i < 5; ++i) {
    const OwnedEstimate o = test::ground(1920, 1080, 0, random);
    const Bytes bytes = encoded(o.estimate);
    KlvUnit unit;
    ASSERT_EQ(unit.decode(bytes), KlvVerdict::ok);
    EXPECT_EQ(unit.estimate().mask.width, 1920);
    EXPECT_EQ(drawn(unit), packed(o.estimate.mask));
    RecordProperty("bytes", static_cast<int>(bytes.size()));
  }
}

TEST(VmtiKlv, EveryPrefixAndEveryFlippedBitIsRefused) {
  std::mt19937 random(5);
  const OwnedEstimate o = test::noisy(64, 48, 32, 24, 40, random);
  const Bytes good = encoded(o.estimate);
  KlvUnit unit;
  for (std::size_t n = 0; n < good.size(); ++n) {
    EXPECT_EQ(unit.decode(std::span(good).first(n)), KlvVerdict::damaged) << n;
    EXPECT_FALSE(unit.error().empty());
  }
  for (std::size_t bit = 0; bit < good.size() * 8; ++bit) {
    Bytes bad = good;
    bad[bit / 8] ^= static_cast<std::uint8_t>(1 << (bit % 8));
    EXPECT_NE(unit.decode(bad), KlvVerdict::ok) << bit;
  }
  EXPECT_EQ(unit.decode(good), KlvVerdict::ok) << "after all that the same object still decodes";
}

// Checksums prove nothing against somebody who means harm: wrong values under right checksums.
TEST(VmtiKlv, HostileValuesUnderRightChecksums) {
  std::mt19937 random(6);
  const OwnedEstimate o = test::noisy(64, 48, 32, 24, 40, random);
  const Bytes good = encoded(o.estimate);
  KlvUnit unit;
  int accepted = 0;
  for (int i = 0; i < 40000; ++i) {
    Bytes bad = good;
    for (unsigned k = 0; k < 1 + random() % 4; ++k)
      bad[18 + random() % (bad.size() - 26)] = static_cast<std::uint8_t>(random());
    fix_sums(bad);
    if (unit.decode(bad) != KlvVerdict::ok) {
      EXPECT_FALSE(unit.error().empty());
      continue;
    }
    ++accepted;
    const Estimate& e = unit.estimate();
    ASSERT_GE(e.mask.width, 1);
    ASSERT_GE(e.mask.height, 1);
    ASSERT_LE(std::int64_t{e.mask.width} * e.mask.height, klv_mask_limit);
    if (e.mask.width * e.mask.height < 100000)
      drawn(unit);
    for (const std::uint16_t row : e.boundary)
      ASSERT_LE(row, e.frame_height);
    ASSERT_LE(e.model_count, max_models);
  }
  EXPECT_GT(accepted, 0) << "some mutations hit values that may be anything";
}

TEST(VmtiKlv, RandomBytesAreRefused) {
  std::mt19937 random(7);
  KlvUnit unit;
  for (int i = 0; i < 50000; ++i) {
    Bytes bytes(random() % 300);
    for (auto& b : bytes)
      b = static_cast<std::uint8_t>(random());
    if (i % 2 && bytes.size() >= 16)
      std::copy(vmti_label.begin(), vmti_label.end(), bytes.begin());
    EXPECT_NE(unit.decode(bytes), KlvVerdict::ok);
  }
}

TEST(VmtiKlv, RunsThatGoBackOrOutAreRefused) {
  // Three runs of the published series in a 32 x 6 mask, then the second moved.
  OwnedEstimate o = test::blank(32, 6, 32, 6);
  for (const int pixel : {74, 75, 89, 90, 91, 92, 106, 107})
    o.pixels[static_cast<std::size_t>(pixel - 1)] = mask_traversable;
  const Bytes good = encoded(o.estimate);
  const Bytes run = {0x03, 0x01, 0x59, 0x04};
  const auto at =
      static_cast<std::size_t>(std::search(good.begin(), good.end(), run.begin(), run.end()) - good.begin());
  KlvUnit unit;
  const auto with = [&](std::uint8_t pixel, std::uint8_t length) {
    Bytes bytes = good;
    bytes[at + 2] = pixel;
    bytes[at + 3] = length;
    fix_sums(bytes);
    return unit.decode(bytes);
  };
  EXPECT_EQ(with(0x59, 4), KlvVerdict::ok);
  EXPECT_EQ(with(0x4c, 0x1e), KlvVerdict::ok) << "touching its neighbours";
  EXPECT_EQ(with(0x4b, 4), KlvVerdict::damaged) << "into the first run";
  EXPECT_EQ(with(0, 4), KlvVerdict::damaged) << "pixels count from 1";
  EXPECT_EQ(with(0x59, 0), KlvVerdict::damaged) << "an empty run";
  EXPECT_EQ(with(0x59, 0x7f), KlvVerdict::damaged) << "past the end";
  EXPECT_EQ(with(0x59, 0x81), KlvVerdict::damaged) << "a length cut short";
}

} // namespace
} // namespace terrainseg
