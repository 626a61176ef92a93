// SPDX-License-Identifier: LGPL-2.1-or-later
// The byte sequences called "published" are from the tests of jmisb (github.com/WestRidgeSystems/jmisb,
// module st0903, Copyright 2021 jmisb.org, MIT licence), which take them from MISB ST 0903. A decoder written
// apart from this one, in Python, is tests/unit/klv_decoder.py. The packet of ST 0601 is the example at the
// end of that standard.
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
    const int mw = 1 + static_cast<int>(random() % 200), mh = 1 + static_cast<int>(random() % 90);
    const int fw = mw + static_cast<int>(random() % 200), fh = mh + static_cast<int>(random() % 200);
    const OwnedEstimate o = test::noisy(fw, fh, mw, mh, 20 + random() % 200, random);
    const std::uint64_t time = (std::uint64_t{random()} << 32) | random();
    const auto bytes = encoder.encode(o.estimate, time);
    ASSERT_LE(bytes.size(), klv_unit_limit);
    ASSERT_EQ(unit.decode(bytes), KlvVerdict::ok) << unit.error();
    EXPECT_EQ(unit.time_us(), time);
    expect_same_numbers_and_colors(unit.estimate(), o.estimate);
    ASSERT_EQ(unit.estimate().mask.width, o.estimate.mask.width);
    ASSERT_EQ(unit.estimate().mask.height, o.estimate.mask.height);
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

TEST(VmtiKlv, WhatMotionToldGoesThere) {
  OwnedEstimate o = test::blank(20, 10, 20, 10);
  KlvUnit unit;
  const auto with = [&](std::int32_t row, std::int32_t speed) {
    o.estimate.vanishing_row = row;
    o.estimate.speed_over_height = speed;
    return encoded(o.estimate);
  };
  EXPECT_FALSE(contains(with(-1, 0), {0x0e, 0x08})) << "nothing is known";
  const Bytes driving = with((3 << 16) + 5, -65536);
  EXPECT_TRUE(contains(driving, {0x0e, 0x08, 0x00, 0x03, 0x00, 0x05, 0xff, 0xff, 0x00, 0x00}));
  ASSERT_EQ(unit.decode(driving), KlvVerdict::ok);
  EXPECT_EQ(unit.estimate().vanishing_row, (3 << 16) + 5);
  EXPECT_EQ(unit.estimate().speed_over_height, -65536);
  ASSERT_EQ(unit.decode(with(-1, 7)), KlvVerdict::ok);
  EXPECT_EQ(unit.estimate().vanishing_row, -1);
  EXPECT_EQ(unit.estimate().speed_over_height, 7);
  ASSERT_EQ(unit.decode(with(-1, 0)), KlvVerdict::ok);
  EXPECT_EQ(unit.estimate().speed_over_height, 0) << "nothing is left of the unit before";
  EXPECT_EQ(unit.decode(with(10 << 16, 7)), KlvVerdict::damaged) << "below the frame";
}

TEST(EstimateFlaw, OneRuleForEveryDecoder) {
  const OwnedEstimate sound = test::blank(20, 10, 20, 10);
  EXPECT_EQ(flaw_of(sound.estimate), nullptr);
  const auto flawed = [&](auto change) {
    OwnedEstimate o = test::blank(20, 10, 20, 10);
    change(o);
    return flaw_of(o.estimate) != nullptr;
  };
  EXPECT_FALSE(flawed([](OwnedEstimate& o) { o.estimate.boundary = {}; }));
  EXPECT_FALSE(flawed([](OwnedEstimate& o) { o.estimate.mask = {}; })) << "a program may send none";
  EXPECT_FALSE(flawed([](OwnedEstimate& o) { o.estimate.mask.plane = {}; })) << "only its size is known";
  EXPECT_TRUE(flawed([](OwnedEstimate& o) { o.estimate.frame_width = 0; }));
  EXPECT_TRUE(flawed([](OwnedEstimate& o) { o.estimate.frame_height = longest_picture_side + 1; }));
  EXPECT_TRUE(flawed([](OwnedEstimate& o) { o.estimate.horizon_row = -2; }));
  EXPECT_TRUE(flawed([](OwnedEstimate& o) { o.estimate.horizon_row = 10; }));
  EXPECT_FALSE(flawed([](OwnedEstimate& o) { o.estimate.vanishing_row = (10 << 16) - 1; }));
  EXPECT_TRUE(flawed([](OwnedEstimate& o) { o.estimate.vanishing_row = 10 << 16; }));
  EXPECT_TRUE(flawed([](OwnedEstimate& o) { o.estimate.vanishing_row = -2; }));
  EXPECT_TRUE(flawed([](OwnedEstimate& o) { o.estimate.window = {2147483647, 0, 2147483647, 1}; }));
  EXPECT_TRUE(flawed([](OwnedEstimate& o) { o.estimate.mask_region = {0, -2147483647, 1, 1}; }));
  EXPECT_TRUE(flawed([](OwnedEstimate& o) { o.estimate.mask.height = longest_picture_side + 1; }));
  EXPECT_TRUE(flawed([](OwnedEstimate& o) { o.estimate.mask.width = -1; }));
  EXPECT_TRUE(flawed([](OwnedEstimate& o) { o.estimate.mask.width = 0; }));
  EXPECT_TRUE(flawed([](OwnedEstimate& o) { o.rows[3] = 11; }));
  EXPECT_TRUE(flawed([](OwnedEstimate& o) { o.estimate.boundary = o.estimate.boundary.first(19); }));
  EXPECT_TRUE(flawed([](OwnedEstimate& o) { o.estimate.model_count = max_models + 1; }));
  EXPECT_TRUE(flawed([](OwnedEstimate& o) { o.estimate.traversable_permille = 1001; }));
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

/// Every prefix, and the unit with any one bit flipped.
void expect_damage_is_refused(KlvUnit& unit, const Bytes& good) {
  for (std::size_t n = 0; n < good.size(); ++n) {
    EXPECT_EQ(unit.decode(std::span(good).first(n)), KlvVerdict::damaged) << n;
    EXPECT_FALSE(unit.error().empty());
  }
  for (std::size_t bit = 0; bit < good.size() * 8; ++bit) {
    Bytes bad = good;
    bad[bit / 8] ^= static_cast<std::uint8_t>(1 << (bit % 8));
    EXPECT_NE(unit.decode(bad), KlvVerdict::ok) << bit;
  }
}

TEST(VmtiKlv, EveryPrefixAndEveryFlippedBitIsRefused) {
  std::mt19937 random(5);
  const OwnedEstimate o = test::noisy(64, 48, 32, 24, 40, random);
  const Bytes good = encoded(o.estimate);
  KlvUnit unit;
  expect_damage_is_refused(unit, good);
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

/// A unit by hand: a 4 x 2 mask of a frame of 4 x 2 with these VTarget Packs.
Bytes unit_of(const Bytes& series, int mask_width = 4, int mask_height = 2) {
  const OwnedEstimate o = test::blank(4, 2, 4, 2);
  const Bytes plain = encoded(o.estimate); // no target: the private set begins right behind the size
  const Bytes size = {0x08, 0x01, 0x04, 0x09, 0x01, 0x02};
  const auto at = std::search(plain.begin(), plain.end(), size.begin(), size.end());
  EXPECT_NE(at, plain.end());
  Bytes set(plain.begin() + 18, at);
  EXPECT_EQ(plain[16], 0x81) << "a set of 128 to 255 bytes";
  for (const auto& [tag, side] : {std::pair{8, mask_width}, std::pair{9, mask_height}}) {
    set.push_back(static_cast<std::uint8_t>(tag));
    set.push_back(2);
    set.push_back(static_cast<std::uint8_t>(side >> 8));
    set.push_back(static_cast<std::uint8_t>(side));
  }
  if (!series.empty()) {
    set.insert(set.end(), {101, 0x82, static_cast<std::uint8_t>(series.size() >> 8),
                           static_cast<std::uint8_t>(series.size())});
    set.insert(set.end(), series.begin(), series.end());
  }
  set.insert(set.end(), at + static_cast<std::ptrdiff_t>(size.size()), plain.end());
  Bytes unit(vmti_label.begin(), vmti_label.end());
  unit.insert(unit.end(),
              {0x82, static_cast<std::uint8_t>(set.size() >> 8), static_cast<std::uint8_t>(set.size())});
  unit.insert(unit.end(), set.begin(), set.end());
  fix_sums(unit);
  return unit;
}

/// Length, then the bytes.
Bytes sized(const Bytes& bytes) {
  Bytes out = {0x82, static_cast<std::uint8_t>(bytes.size() >> 8), static_cast<std::uint8_t>(bytes.size())};
  out.insert(out.end(), bytes.begin(), bytes.end());
  return out;
}
Bytes joined(std::initializer_list<Bytes> parts) {
  Bytes out;
  for (const Bytes& part : parts)
    out.insert(out.end(), part.begin(), part.end());
  return out;
}

// Rising order is checked within a series: with many of them in one target every one could draw the whole
// mask again, and a unit of 10 kB held its thread for minutes.
TEST(VmtiKlv, OneSeriesATarget) {
  const Bytes whole = {0x02, 0x04, 0x03, 0x01, 0x01, 0x08}; // runs: from pixel 1, 8 of 8 pixels
  const Bytes mask = joined({{101}, sized(whole)});
  KlvUnit unit;
  ASSERT_EQ(unit.decode(unit_of(sized(joined({{1}, mask})))), KlvVerdict::ok) << unit.error();
  EXPECT_EQ(drawn(unit), Bytes(8, mask_traversable));
  EXPECT_EQ(unit.pixels_to_draw(), 16u);
  EXPECT_EQ(unit.decode(unit_of(sized(joined({{1}, mask, mask})))), KlvVerdict::damaged);
  EXPECT_NE(unit.error().find("more than one mask"), std::string::npos) << unit.error();
  EXPECT_EQ(unit.decode(unit_of(sized(joined({{1, 101}, sized(joined({whole, whole}))})))),
            KlvVerdict::damaged);
  EXPECT_NE(unit.error().find("more than one series"), std::string::npos) << unit.error();
  const Bytes both = joined({sized(joined({{1}, mask})), sized(joined({{2}, mask}))});
  ASSERT_EQ(unit.decode(unit_of(both)), KlvVerdict::ok) << unit.error();
  EXPECT_EQ(unit.pixels_to_draw(), 24u) << "blank, traversable, doubtful: never more than three times";
}

TEST(VmtiKlv, AMaskIsNoLargerThanItsFrame) {
  KlvUnit unit;
  EXPECT_EQ(unit.decode(unit_of({})), KlvVerdict::ok) << unit.error();
  EXPECT_EQ(unit.decode(unit_of({}, 5, 2)), KlvVerdict::damaged);
  EXPECT_EQ(unit.decode(unit_of({}, 4, 3)), KlvVerdict::damaged);
  EXPECT_NE(unit.error().find("larger than its frame of 4x2"), std::string::npos) << unit.error();
  EXPECT_EQ(unit.decode(unit_of({}, 8192, 8192)), KlvVerdict::damaged);
  EXPECT_EQ(unit.decode(unit_of({}, 40000, 1)), KlvVerdict::damaged);
  EXPECT_NE(unit.error().find("40000x1 pixels"), std::string::npos) << unit.error();

  // A frame that was scaled down has a mask of its old size: the encoder halves it.
  std::mt19937 random(9);
  OwnedEstimate o = test::noisy(32, 20, 120, 75, 30, random);
  ASSERT_EQ(unit.decode(encoded(o.estimate)), KlvVerdict::ok) << unit.error();
  EXPECT_EQ(unit.estimate().mask.width, 30);
  EXPECT_EQ(unit.estimate().mask.height, 19);
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

// ---- inside a UAS Datalink Local Set (ST 0601) ------------------------------------------------------------

Bytes nested(const Estimate& e, const UasPlatform& platform, std::uint64_t time = 0) {
  KlvEncoder encoder;
  const auto unit = encoder.encode(e, time, &platform);
  return {unit.begin(), unit.end()};
}

/// Label and length of this set, its items, its checksum.
Bytes uas_unit(const Bytes& items) {
  Bytes unit = {0x06, 0x0e, 0x2b, 0x34, 0x02, 0x0b, 0x01, 0x01,
                0x0e, 0x01, 0x03, 0x01, 0x01, 0x00, 0x00, 0x00};
  const std::size_t size = items.size() + 4;
  unit.insert(unit.end(), {0x83, static_cast<std::uint8_t>(size >> 16), static_cast<std::uint8_t>(size >> 8),
                           static_cast<std::uint8_t>(size)});
  unit.insert(unit.end(), items.begin(), items.end());
  unit.insert(unit.end(), {0x01, 0x02});
  const std::uint16_t sum = slow_sum(unit, unit.size());
  unit.insert(unit.end(), {static_cast<std::uint8_t>(sum >> 8), static_cast<std::uint8_t>(sum)});
  return unit;
}

/// Item 74 with these bytes.
Bytes vmti_item(const Bytes& value) {
  Bytes item = {0x4a, 0x83, static_cast<std::uint8_t>(value.size() >> 16),
                static_cast<std::uint8_t>(value.size() >> 8), static_cast<std::uint8_t>(value.size())};
  item.insert(item.end(), value.begin(), value.end());
  return item;
}

/// The items of a unit that stands alone, of 256 to 65535 bytes: no label, no length, no checksum.
Bytes items_of(const Bytes& alone) {
  EXPECT_EQ(alone[16], 0x82);
  return {alone.begin() + 19, alone.end() - 4};
}

/// Values and bytes of the example packet in ST 0601.
const UasPlatform published_platform = {159.9744, UasAttitude{-0.4315251, 3.405814},
                                        UasPosition{60.1768229669783, 128.426759042045, 14190.7195}};
constexpr std::uint64_t published_time = 0x00046050584e0180;

// The items in front of the VMTI set byte for byte, the set itself as it stands alone, the sum by its
// definition.
TEST(UasDatalink, GoldenBytes) {
  std::mt19937 random(11);
  const OwnedEstimate o = test::noisy(64, 48, 32, 24, 40, random);
  const Bytes inner = items_of(encoded(o.estimate, published_time));
  ASSERT_GT(inner.size(), 255u);
  const Bytes items = {0x02,
                       0x08,
                       0x00,
                       0x04,
                       0x60,
                       0x50,
                       0x58,
                       0x4e,
                       0x01,
                       0x80, // time
                       0x05,
                       0x02,
                       0x71,
                       0xc2, // heading
                       0x06,
                       0x02,
                       0xfd,
                       0x3d, // pitch
                       0x07,
                       0x02,
                       0x08,
                       0xb8, // roll
                       0x0d,
                       0x04,
                       0x55,
                       0x95,
                       0xb6,
                       0x6d, // latitude
                       0x0e,
                       0x04,
                       0x5b,
                       0x53,
                       0x60,
                       0xc4, // longitude
                       0x0f,
                       0x02,
                       0xc2,
                       0x21, // altitude
                       0x12,
                       0x04,
                       0x00,
                       0x00,
                       0x00,
                       0x00, // the sensor is held as
                       0x13,
                       0x04,
                       0x00,
                       0x00,
                       0x00,
                       0x00, // the platform
                       0x14,
                       0x04,
                       0x00,
                       0x00,
                       0x00,
                       0x00, //
                       0x41,
                       0x01,
                       0x11, // ST 0601.17
                       0x4a,
                       0x82,
                       static_cast<std::uint8_t>(inner.size() >> 8),
                       static_cast<std::uint8_t>(inner.size())};
  Bytes expected = {0x06, 0x0e, 0x2b, 0x34, 0x02, 0x0b, 0x01, 0x01,
                    0x0e, 0x01, 0x03, 0x01, 0x01, 0x00, 0x00, 0x00};
  const std::size_t size = items.size() + inner.size() + 4;
  expected.insert(expected.end(),
                  {0x82, static_cast<std::uint8_t>(size >> 8), static_cast<std::uint8_t>(size)});
  expected.insert(expected.end(), items.begin(), items.end());
  expected.insert(expected.end(), inner.begin(), inner.end());
  expected.insert(expected.end(), {0x01, 0x02});
  const std::uint16_t sum = slow_sum(expected, expected.size());
  expected.insert(expected.end(), {static_cast<std::uint8_t>(sum >> 8), static_cast<std::uint8_t>(sum)});
  EXPECT_EQ(nested(o.estimate, published_platform, published_time), expected);
}

TEST(UasDatalink, WhatIsNotKnownIsLeftOut) {
  std::mt19937 random(12);
  const OwnedEstimate o = test::noisy(64, 48, 32, 24, 40, random);
  const Bytes bare = nested(o.estimate, {}, published_time);
  const Bytes items = {0x02, 0x08, 0x00, 0x04, 0x60, 0x50, 0x58, 0x4e, 0x01, 0x80, 0x41, 0x01, 0x11, 0x4a};
  EXPECT_EQ(Bytes(bare.begin() + 19, bare.begin() + 19 + 14), items);
}

TEST(UasDatalink, EndsOfTheRanges) {
  const auto items = [](const UasPlatform& platform) {
    Bytes set;
    put_platform(set, platform);
    return set;
  };
  const Bytes zeros = {0x12, 4, 0, 0, 0, 0, 0x13, 4, 0, 0, 0, 0, 0x14, 4, 0, 0, 0, 0};
  const auto attitude = [&](double pitch, double roll) {
    Bytes set = items({{}, UasAttitude{pitch, roll}, {}});
    EXPECT_GE(set.size(), zeros.size());
    EXPECT_TRUE(std::equal(zeros.begin(), zeros.end(), set.end() - 18));
    set.resize(set.size() - zeros.size());
    return set;
  };
  EXPECT_EQ(items({0, {}, {}}), (Bytes{5, 2, 0, 0}));
  EXPECT_EQ(items({360, {}, {}}), (Bytes{5, 2, 0, 0}));
  EXPECT_EQ(items({-90, {}, {}}), (Bytes{5, 2, 0xbf, 0xff})) << "270 / 360 * 65535 = 49151.25";
  EXPECT_EQ(attitude(20, -50), (Bytes{6, 2, 0x7f, 0xff, 7, 2, 0x80, 0x01}));
  EXPECT_EQ(attitude(-20, 50), (Bytes{6, 2, 0x80, 0x01, 7, 2, 0x7f, 0xff}));
  EXPECT_EQ(attitude(45, -90), (Bytes{90, 4, 0x40, 0x00, 0x00, 0x00, 91, 4, 0x80, 0x00, 0x00, 0x01}))
      << "the full items: 45 / 90 * (2^31 - 1) = 1073741823.5";
  EXPECT_EQ(attitude(91, -91), (Bytes{6, 2, 0x80, 0x00, 7, 2, 0x80, 0x00})) << "out of range";
  EXPECT_EQ(items({{}, {}, UasPosition{-90, 180, -900}}),
            (Bytes{13, 4, 0x80, 0, 0, 1, 14, 4, 0x7f, 0xff, 0xff, 0xff, 15, 2, 0, 0}));
  EXPECT_EQ(items({{}, {}, UasPosition{90, -180, 19000}}),
            (Bytes{13, 4, 0x7f, 0xff, 0xff, 0xff, 14, 4, 0x80, 0, 0, 1, 15, 2, 0xff, 0xff}));
}

TEST(UasDatalink, PositionsAreRead) {
  UasPlatform p;
  ASSERT_EQ(read_position("52.5, 13.25,-34.5", p), nullptr);
  EXPECT_EQ(p.position->latitude, 52.5);
  EXPECT_EQ(p.position->longitude, 13.25);
  EXPECT_EQ(p.position->altitude, -34.5);
  EXPECT_FALSE(p.heading);
  ASSERT_EQ(read_position("-90,-180,19000,360", p), nullptr);
  EXPECT_EQ(p.heading, 360);
  for (const char* bad :
       {"", "1", "1,2", "1,2,", "1,2,x", "1;2;3", "1,2,3,4,5", "1,2,3,", "1,2,3m", "nan,1,2", "1,inf,2",
        "91,0,0", "0,181,0", "0,0,-901", "0,0,19001", "0,0,0,361", "0,0,0,-1"}) {
    EXPECT_NE(read_position(bad, p), nullptr) << bad;
    EXPECT_EQ(p.position->latitude, -90) << bad;
  }
}

TEST(UasDatalink, ComesBackAsItWas) {
  std::mt19937 random(13);
  KlvUnit unit;
  for (int trial = 0; trial < 200; ++trial) {
    const int mw = 1 + static_cast<int>(random() % 200), mh = 1 + static_cast<int>(random() % 90);
    const OwnedEstimate o = test::noisy(mw + 5, mh + 7, mw, mh, 20 + random() % 200, random);
    const std::uint64_t time = (std::uint64_t{random()} << 32) | random();
    Bytes bytes = nested(o.estimate, trial % 2 ? published_platform : UasPlatform{}, time);
    if (trial % 3 == 0) // behind a set of somebody else
      bytes.insert(bytes.begin(), {0x06, 0x0e, 0x2b, 0x34, 0x02, 0x0b, 0x01, 0x01, 0x0e, 0x01,
                                   0x03, 0x01, 0x01, 0x00, 0x00, 0x00, 0x03, 0x41, 0x01, 0x11});
    ASSERT_EQ(unit.decode(bytes), KlvVerdict::ok) << unit.error();
    EXPECT_EQ(unit.time_us(), time);
    expect_same_numbers_and_colors(unit.estimate(), o.estimate);
    EXPECT_EQ(drawn(unit), packed(o.estimate.mask));
    EXPECT_TRUE(std::ranges::equal(unit.estimate().boundary, o.estimate.boundary));
  }
}

// Both forms of an estimate hold the same VMTI items, the private CRC-32 with them.
TEST(UasDatalink, NestedByHand) {
  std::mt19937 random(14);
  const OwnedEstimate o = test::noisy(64, 48, 32, 24, 40, random);
  const Bytes inner = items_of(encoded(o.estimate, 77));
  KlvUnit unit;
  ASSERT_EQ(unit.decode(uas_unit(vmti_item(inner))), KlvVerdict::ok) << unit.error();
  EXPECT_EQ(unit.time_us(), 77u);

  // A VMTI set in front of other items, and of items that ST 0601 does not know yet.
  Bytes more = vmti_item(inner);
  more.insert(more.end(), {0x0f, 0x02, 0xc2, 0x21, 0x87, 0x68, 0x01, 0x00});
  EXPECT_EQ(unit.decode(uas_unit(more)), KlvVerdict::ok) << unit.error();

  // The inner CRC-32 holds without the outer sum, which two changes can deceive.
  Bytes wrong = inner;
  wrong[wrong.size() / 2] ^= 1;
  EXPECT_EQ(unit.decode(uas_unit(vmti_item(wrong))), KlvVerdict::damaged);
  EXPECT_NE(unit.error().find("terrainseg's Local Set does not match"), std::string::npos) << unit.error();

  Bytes cut = vmti_item(inner);
  cut.push_back(0x0f);
  EXPECT_EQ(unit.decode(uas_unit(cut)), KlvVerdict::damaged);
  EXPECT_NE(unit.error().find("item of the UAS Datalink"), std::string::npos) << unit.error();

  EXPECT_EQ(unit.decode(uas_unit(joined({vmti_item(inner), vmti_item(inner)}))), KlvVerdict::damaged);
  EXPECT_NE(unit.error().find("more than one VMTI"), std::string::npos) << unit.error();

  EXPECT_EQ(unit.decode(uas_unit(vmti_item({0x04, 0x01, 0x05}))), KlvVerdict::foreign);
  EXPECT_NE(unit.error().find("another maker"), std::string::npos) << unit.error();
  EXPECT_EQ(unit.decode(uas_unit(vmti_item({}))), KlvVerdict::foreign);
}

// The example packet of ST 0601, whole: its sum, and the bytes of the values that published_platform has.
TEST(UasDatalink, PublishedPacket) {
  const Bytes packet = {
      0x06, 0x0e, 0x2b, 0x34, 0x02, 0x0b, 0x01, 0x01, 0x0e, 0x01, 0x03, 0x01, 0x01, 0x00, 0x00, 0x00, 0x81,
      0xd2, 0x02, 0x08, 0x00, 0x04, 0x60, 0x50, 0x58, 0x4e, 0x01, 0x80, 0x03, 0x0a, 0x4d, 0x69, 0x73, 0x73,
      0x69, 0x6f, 0x6e, 0x20, 0x31, 0x32, 0x05, 0x02, 0x71, 0xc2, 0x06, 0x02, 0xfd, 0x3d, 0x07, 0x02, 0x08,
      0xb8, 0x0a, 0x08, 0x50, 0x72, 0x65, 0x64, 0x61, 0x74, 0x6f, 0x72, 0x0b, 0x07, 0x45, 0x4f, 0x20, 0x4e,
      0x6f, 0x73, 0x65, 0x0c, 0x0e, 0x47, 0x65, 0x6f, 0x64, 0x65, 0x74, 0x69, 0x63, 0x20, 0x57, 0x47, 0x53,
      0x38, 0x34, 0x0d, 0x04, 0x55, 0x95, 0xb6, 0x6d, 0x0e, 0x04, 0x5b, 0x53, 0x60, 0xc4, 0x0f, 0x02, 0xc2,
      0x21, 0x10, 0x02, 0xcd, 0x9c, 0x11, 0x02, 0xd9, 0x17, 0x12, 0x04, 0x72, 0x4a, 0x0a, 0x20, 0x13, 0x04,
      0x87, 0xf8, 0x4b, 0x86, 0x14, 0x04, 0x00, 0x00, 0x00, 0x00, 0x15, 0x04, 0x03, 0x83, 0x09, 0x26, 0x16,
      0x02, 0x12, 0x81, 0x17, 0x04, 0xf1, 0x01, 0xa2, 0x29, 0x18, 0x04, 0x14, 0xbc, 0x08, 0x2b, 0x19, 0x02,
      0x34, 0xf3, 0x30, 0x1c, 0x01, 0x01, 0x01, 0x02, 0x01, 0x07, 0x03, 0x05, 0x2f, 0x2f, 0x55, 0x53, 0x41,
      0x0c, 0x01, 0x07, 0x0d, 0x06, 0x00, 0x55, 0x00, 0x53, 0x00, 0x41, 0x16, 0x02, 0x00, 0x0a, 0x41, 0x01,
      0x06, 0x5e, 0x22, 0x01, 0x70, 0xf5, 0x92, 0xf0, 0x23, 0x73, 0x36, 0x4a, 0xf8, 0xaa, 0x91, 0x62, 0xc0,
      0x0f, 0x2e, 0xb2, 0xda, 0x16, 0xb7, 0x43, 0x41, 0x00, 0x08, 0x41, 0xa0, 0xbe, 0x36, 0x5b, 0x5a, 0xb9,
      0x6a, 0x36, 0x45, 0x01, 0x02, 0xaa, 0x43};
  ASSERT_EQ(slow_sum(packet, packet.size() - 2), 0xaa43);
  Bytes items;
  put_platform(items, published_platform);
  for (std::size_t at = 0; at + 18 < items.size(); at += 2u + items[at + 1])
    EXPECT_TRUE(contains(packet, Bytes(items.begin() + static_cast<std::ptrdiff_t>(at),
                                       items.begin() + static_cast<std::ptrdiff_t>(at + 2u + items[at + 1]))))
        << "item " << int{items[at]};
  KlvUnit unit;
  EXPECT_EQ(unit.decode(packet), KlvVerdict::foreign) << "it holds no VMTI";
  EXPECT_NE(unit.error().find("without a VMTI"), std::string::npos) << unit.error();
}

TEST(UasDatalink, EveryPrefixAndEveryFlippedBitIsRefused) {
  std::mt19937 random(15);
  const OwnedEstimate o = test::noisy(64, 48, 32, 24, 40, random);
  const Bytes good = nested(o.estimate, published_platform, published_time);
  KlvUnit unit;
  expect_damage_is_refused(unit, good);
  Bytes bad;
  for (const std::size_t at :
       {25, 30}) { // in the time stamp; the length of an item: no VMTI is found behind it
    bad = good;
    bad[at] ^= 1;
    EXPECT_EQ(unit.decode(bad), KlvVerdict::damaged) << at;
    EXPECT_NE(unit.error().find("checksum of the UAS Datalink"), std::string::npos) << unit.error();
  }
  EXPECT_EQ(unit.decode(good), KlvVerdict::ok) << unit.error();
}

// The limit is the whole unit's: the items around the VMTI set count.
TEST(UasDatalink, SixtyThousandBytesAtMost) {
  KlvUnit unit;
  std::size_t largest = 0;
  bool halved = false;
  for (unsigned calm = 40; calm < 60; ++calm) {
    std::mt19937 random(calm);
    const OwnedEstimate o = test::noisy(1280, 720, 1280, 720, calm, random);
    const Bytes bytes = nested(o.estimate, published_platform);
    ASSERT_LE(bytes.size(), klv_unit_limit);
    largest = std::max(largest, bytes.size());
    ASSERT_EQ(unit.decode(bytes), KlvVerdict::ok) << unit.error();
    halved = halved || unit.estimate().mask.width < 1280;
  }
  EXPECT_GT(largest, 55000u);
  EXPECT_TRUE(halved);

  std::mt19937 random(16);
  const OwnedEstimate o = test::noisy(64, 48, 32, 24, 40, random);
  Bytes items = vmti_item(items_of(encoded(o.estimate)));
  const auto padded = [&](std::size_t size) {
    Bytes all = items;
    const std::size_t padding = size - uas_unit(items).size() - 4;
    all.insert(all.end(),
               {0x0a, 0x82, static_cast<std::uint8_t>(padding >> 8), static_cast<std::uint8_t>(padding)});
    all.resize(all.size() + padding, 'x');
    return uas_unit(all);
  };
  ASSERT_EQ(padded(60000).size(), 60000u);
  EXPECT_EQ(unit.decode(padded(60000)), KlvVerdict::ok) << unit.error();
  EXPECT_EQ(unit.decode(padded(60001)), KlvVerdict::damaged);
  for (const char* part : {"60001", "60000"})
    EXPECT_NE(std::string(unit.error()).find(part), std::string::npos) << unit.error();
}

} // namespace
} // namespace terrainseg
