// SPDX-License-Identifier: LGPL-2.1-or-later
// Stamps of ST 0604 byte for byte, and access units as encoders, parsers and liars make them.
#include "exchange/precision_stamp.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <random>
#include <string>
#include <vector>

namespace terrainseg {
namespace {

using Bytes = std::vector<std::uint8_t>;

constexpr NalFraming h264{VideoCodec::h264, 0}, h265{VideoCodec::h265, 0}, avc{VideoCodec::h264, 4},
    hvc{VideoCodec::h265, 4};
constexpr std::uint64_t time_us = 1'763'841'600'123'456; // 2025-11-22T20:00:00.123456Z

Bytes from_hex(const std::string& text) {
  Bytes bytes;
  for (std::size_t i = 0; i < text.size(); i += 2)
    bytes.push_back(static_cast<std::uint8_t>(std::stoi(text.substr(i, 2), nullptr, 16)));
  return bytes;
}

Bytes operator+(const Bytes& a, const Bytes& b) {
  Bytes both(a);
  both.insert(both.end(), b.begin(), b.end());
  return both;
}

Bytes stamp(const NalFraming& framing, std::uint64_t time = time_us, std::uint8_t temporal = 1) {
  return stamp_unit(framing, time, temporal);
}

/// A NAL unit in its frame.
Bytes nal(const NalFraming& framing, const std::string& hex) {
  const Bytes content = from_hex(hex);
  if (framing.length_bytes == 0)
    return Bytes{0, 0, 0, 1} + content;
  Bytes length;
  for (unsigned left = framing.length_bytes; left > 0; --left)
    length.push_back(static_cast<std::uint8_t>(content.size() >> 8 * (left - 1)));
  return length + content;
}

std::string slice(const NalFraming& framing) {
  return framing.codec == VideoCodec::h264 ? "65888400100000" : "2603af0088";
}

std::string before_slice(const NalFraming& framing) { // a parameter set
  return framing.codec == VideoCodec::h264 ? "6742c00d" : "42010101";
}

const std::string content_hex = "9f0006ff4434ff6f76ff6240"; // 0x000644346f766240

TEST(PrecisionStamp, ContentByteForByte) {
  const StampContent content = stamp_content(0x000644346f766240);
  EXPECT_EQ(Bytes(content.begin(), content.end()), from_hex(content_hex));
}

TEST(PrecisionStamp, UnitsByteForByte) {
  EXPECT_EQ(stamp(h264, 0x000644346f766240), from_hex("0000000106051c"
                                                      "4d4953506d6963726f73656374696d65" +
                                                      content_hex + "80"));
  EXPECT_EQ(stamp(avc, 0x000644346f766240), from_hex("0000002006051c"
                                                     "4d4953506d6963726f73656374696d65" +
                                                     content_hex + "80"));
  EXPECT_EQ(stamp(h265, 0x000644346f766240, 2), from_hex("000000014e02051c"
                                                         "a8687dd4d7593758a5cef0338b6545f1" +
                                                         content_hex + "80"));
  EXPECT_EQ(stamp({VideoCodec::h265, 2}, 0x000644346f766240), from_hex("00214e01051c"
                                                                       "a8687dd4d7593758a5cef0338b6545f1" +
                                                                       content_hex + "80"));
}

/// No time makes 0 0 followed by 0 to 3 within the NAL unit, which is what prevention bytes are for.
TEST(PrecisionStamp, NoTimeEmulatesAStartCode) {
  std::vector<std::uint64_t> times = {0,
                                      1,
                                      2,
                                      3,
                                      0x0000'0100'0001'0000,
                                      0x0000'0001'0000'0100,
                                      0x0100'0001'0000'0003,
                                      ~0ull,
                                      0xff00'00ff'0000'0000};
  for (unsigned zeros = 0; zeros < 256; ++zeros) { // each byte zero or one of 1, 2, 3
    std::uint64_t time = 0;
    for (int byte = 0; byte < 8; ++byte)
      time = time << 8 | (zeros >> byte & 1 ? 0u : 1u + static_cast<unsigned>(byte) % 3);
    times.push_back(time);
  }
  for (std::uint64_t time : times)
    for (const NalFraming& framing : {h264, h265}) {
      const Bytes unit = stamp(framing, time);
      int zeros = 0;
      for (std::size_t i = 4; i < unit.size(); ++i) {
        ASSERT_FALSE(zeros >= 2 && unit[i] <= 3) << time << " at " << i;
        zeros = unit[i] == 0 ? zeros + 1 : 0;
      }
      EXPECT_NE(unit.back(), 0);
      const StampSearch found = find_stamp(unit + nal(framing, slice(framing)), framing);
      EXPECT_EQ(found.time_us, time);
    }
}

TEST(PrecisionStamp, IsFoundWhereItBelongs) {
  for (const NalFraming& framing :
       {h264, h265, avc, hvc, NalFraming{VideoCodec::h264, 1}, NalFraming{VideoCodec::h265, 2}}) {
    const Bytes head = nal(framing, before_slice(framing)), picture = nal(framing, slice(framing));
    const StampSearch bare = find_stamp(head + picture + picture, framing);
    EXPECT_FALSE(bare.time_us);
    ASSERT_EQ(bare.place, head.size());
    EXPECT_EQ(bare.temporal, framing.codec == VideoCodec::h265 ? 3 : 1);
    const StampSearch stamped = find_stamp(head + stamp(framing) + picture, framing);
    EXPECT_EQ(stamped.time_us, time_us);
    EXPECT_FALSE(stamped.several);
    EXPECT_EQ(stamped.place, head.size() + stamp(framing).size());
    EXPECT_EQ(find_stamp(stamp(framing) + stamp(framing) + picture, framing).time_us, time_us);
    // Behind the first slice stands nothing of this picture.
    EXPECT_FALSE(find_stamp(head + picture + stamp(framing), framing).time_us);
  }
}

TEST(PrecisionStamp, ShortStartCodesAndTheSlicesPrefix) {
  const Bytes head = from_hex("0000010930"), picture = from_hex("000001419a");
  EXPECT_EQ(find_stamp(head + picture, h264).place, head.size());
  const Bytes prefix = from_hex("000000016e4081"); // NAL type 14 belongs to the slice behind it
  EXPECT_EQ(find_stamp(head + prefix + picture, h264).place, head.size());
  EXPECT_EQ(find_stamp(picture, h264).place, 0u);
}

TEST(PrecisionStamp, PartsOfTwoPicturesHaveNone) {
  const Bytes picture = nal(h264, slice(h264));
  const StampSearch found = find_stamp(stamp(h264, 40000) + stamp(h264, 80000) + picture, h264);
  EXPECT_FALSE(found.time_us);
  EXPECT_TRUE(found.several);
  EXPECT_FALSE(
      find_stamp(stamp(h264, 40000) + stamp(h264, 80000) + stamp(h264, 80000) + picture, h264).time_us);
}

TEST(PrecisionStamp, AmongOtherMessagesAndWithPreventionBytes) {
  const std::string identifier = "4d4953506d6963726f73656374696d65";
  // A message of 300 bytes of another identifier, then ours; then the trailing bits.
  std::string foreign = "05ff2d";
  for (int i = 0; i < 75; ++i)
    foreign += "a1b2c3d4";
  EXPECT_EQ(find_stamp(nal(h264, "06" + foreign + "051c" + identifier + content_hex + "80") +
                           nal(h264, slice(h264)),
                       h264)
                .time_us,
            0x000644346f766240u);
  // Another kind of message with 0 0 1 in it, which a writer has to break up.
  EXPECT_EQ(find_stamp(nal(h264, "060104"
                                 "00000301ff"
                                 "051c" +
                                     identifier + content_hex + "80") +
                           nal(h264, slice(h264)),
                       h264)
                .time_us,
            0x000644346f766240u);
  // A writer that breaks up more than it must: 0 0 3 0xff.
  EXPECT_EQ(
      find_stamp(nal(h264, "06051c" + identifier + "9f000003ff0001ff0000ff000480") + nal(h264, slice(h264)),
                 h264)
          .time_us,
      0x0000'0001'0000'0004u);
  // Bytes behind the time.
  EXPECT_EQ(
      find_stamp(nal(h264, "06051e" + identifier + content_hex + "aabb80") + nal(h264, slice(h264)), h264)
          .time_us,
      0x000644346f766240u);
}

TEST(PrecisionStamp, NanosecondsOfH265) {
  EXPECT_EQ(find_stamp(nal(h265, "4e01051ccf848278ee23306c9265e8fef22fb8b8"
                                 "9f0000ff0001ff86a9ff01f480") +
                           nal(h265, slice(h265)),
                       h265)
                .time_us,
            0x0000'0001'86a9'01f4u / 1000);
}

TEST(PrecisionStamp, WhatIsNoneOfThatFormIsNone) {
  const std::string identifier = "4d4953506d6963726f73656374696d65";
  const auto time = [](const std::string& sei) {
    return find_stamp(nal(h264, sei) + nal(h264, slice(h264)), h264).time_us;
  };
  ASSERT_TRUE(time("06051c" + identifier + content_hex + "80"));
  EXPECT_FALSE(time("06051c" + identifier + "9f0006fe4434ff6f76ff624080")); // a separator that is none
  EXPECT_FALSE(time("06051c5d" + identifier.substr(2) + content_hex + "80"));
  EXPECT_FALSE(time("06041c" + identifier + content_hex + "80")); // registered user data
  EXPECT_FALSE(time("06051b" + identifier + content_hex.substr(2) + "80"));
  EXPECT_FALSE(time("06051c" + identifier + "9f0006ff4434"));
  EXPECT_FALSE(time("0605"));
  EXPECT_FALSE(time("06"));
  EXPECT_FALSE(time("07051c" + identifier + content_hex + "80"));
  EXPECT_FALSE(stamp_time({}, {}));
}

/// The first zero of 0 0 0 1 is no part of the unit in front: a message that was cut one byte early would
/// take it for its last one. So is padding (trailing_zero_8bits, H.264 annex B.1.1).
TEST(PrecisionStamp, ZerosBehindAUnitAreNotItsOwn) {
  for (const NalFraming& framing : {h264, h265})
    for (const std::string padding : {"", "0000"}) {
      Bytes cut = stamp(framing, 0x000644346f766200); // its last byte but the trailing bits is a zero
      cut.resize(cut.size() - 2);
      const Bytes zeros = from_hex(padding), picture = nal(framing, slice(framing));
      EXPECT_FALSE(find_stamp(cut + zeros + picture, framing).time_us);
      const StampSearch whole = find_stamp(stamp(framing) + zeros + picture, framing);
      EXPECT_EQ(whole.time_us, time_us);
      EXPECT_EQ(whole.place, stamp(framing).size() + zeros.size());
    }
}

TEST(PrecisionStamp, HostileUnits) {
  EXPECT_FALSE(find_stamp({}, h264).place);
  EXPECT_FALSE(find_stamp({}, avc).place);
  for (const char* text : {"00", "0000", "000001", "00000001", "0000010000", "000000", "000001ff"}) {
    const Bytes bytes = from_hex(text);
    for (const NalFraming& framing : {h264, h265, avc, hvc, NalFraming{VideoCodec::h264, 1}})
      EXPECT_FALSE(find_stamp(bytes, framing).time_us);
  }
  // Lengths that run over, and a payload size without an end.
  EXPECT_FALSE(find_stamp(from_hex("ffffffff65"), avc).place);
  EXPECT_FALSE(find_stamp(from_hex("0000000565888400"), avc).place);
  EXPECT_FALSE(
      find_stamp(nal(h264, "0605" + std::string(200000, 'f')) + nal(h264, slice(h264)), h264).time_us);
  // A size of H.265's header alone.
  EXPECT_FALSE(find_stamp(from_hex("0000000126"), hvc).place);
}

TEST(PrecisionStamp, EveryCutAndEveryFlippedBit) {
  for (const NalFraming& framing : {h264, h265, avc, hvc}) {
    const Bytes whole = nal(framing, before_slice(framing)) + stamp(framing) + nal(framing, slice(framing));
    for (std::size_t size = 0; size < whole.size(); ++size) {
      const Bytes cut(whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(size)); // no byte behind it
      const auto time = find_stamp(cut, framing).time_us;
      EXPECT_TRUE(!time || *time == time_us) << size;
    }
    for (std::size_t bit = 0; bit < whole.size() * 8; ++bit) {
      Bytes flipped(whole);
      flipped[bit / 8] ^= static_cast<std::uint8_t>(1 << bit % 8);
      const auto time = find_stamp(flipped, framing).time_us;
      EXPECT_TRUE(!time || *time == time_us || std::popcount(*time ^ time_us) == 1) << bit;
    }
  }
}

TEST(PrecisionStamp, LengthsOfTheCodecData) {
  EXPECT_EQ(nal_length_bytes(VideoCodec::h264, from_hex("0142c00dffe1")), 4u);
  EXPECT_EQ(nal_length_bytes(VideoCodec::h264, from_hex("0142c00dfde1")), 2u);
  EXPECT_FALSE(nal_length_bytes(VideoCodec::h264, from_hex("0142c00dfee1"))); // three is none
  EXPECT_FALSE(nal_length_bytes(VideoCodec::h264, from_hex("0042c00dffe1")));
  EXPECT_FALSE(nal_length_bytes(VideoCodec::h264, from_hex("0142c00d")));
  Bytes hvcc(22, 0);
  hvcc[0] = 1;
  EXPECT_EQ(nal_length_bytes(VideoCodec::h265, hvcc), 1u);
  hvcc[21] = 3;
  EXPECT_EQ(nal_length_bytes(VideoCodec::h265, hvcc), 4u);
  EXPECT_FALSE(nal_length_bytes(VideoCodec::h265, Bytes(21)));
  EXPECT_FALSE(nal_length_bytes(VideoCodec::h265, {}));
}

} // namespace
} // namespace terrainseg
