// SPDX-License-Identifier: LGPL-2.1-or-later
// Masks are the same bytes on every processor and in every build. One hash a format and preset, over the
// masks and boundaries of eight generated frames, and one a rendered place: those have what the stages are
// for.
//
// When a change of the pipeline is meant to change masks, write the hashes anew and say so in the commit:
//   TERRAINSEG_WRITE_GOLDEN=tests/golden/mask_hashes.txt build/tests/golden/mask_hashes_test
#include <cstdlib>
#include <fstream>
#include <iomanip>
#include <map>
#include <sstream>
#include <string>
#include <utility>

#include <gtest/gtest.h>

#include "scene/scene.hpp"
#include "support/frames.hpp"
#include "terrainseg/segmenter.hpp"

namespace terrainseg {
namespace {

constexpr const char* names[pixel_format_count] = {
    "I420", "YV12", "NV12", "NV21",  "Y42B",      "Y444",      "YUY2",      "UYVY",     "RGB",  "BGR",
    "RGBx", "BGRx", "xRGB", "xBGR",  "RGBA",      "BGRA",      "ARGB",      "ABGR",     "NV16", "NV61",
    "NV24", "YVYU", "VYUY", "GRAY8", "GRAY16_LE", "P010_10LE", "I420_10LE", "I422_10LE"};

constexpr std::pair<const char*, scene::Kind> places[] = {{"road", scene::Kind::road},
                                                          {"trail", scene::Kind::trail},
                                                          {"corridor", scene::Kind::corridor},
                                                          {"plain", scene::Kind::plain}};

/// FNV-1a.
class Hash {
 public:
  void add(std::uint8_t byte) { value_ = (value_ ^ byte) * 0x100000001b3u; }
  std::string text() const {
    std::ostringstream out;
    out << std::hex << std::setw(16) << std::setfill('0') << value_;
    return out.str();
  }

 private:
  std::uint64_t value_ = 0xcbf29ce484222325u;
};

void add(const Estimate& e, Hash& hash) {
  for (int y = 0; y < e.mask.height; ++y) {
    const std::uint8_t* row = e.mask.plane.row(y);
    for (int x = 0; x < e.mask.width; ++x)
      hash.add(row[x]);
  }
  for (std::uint16_t row : e.boundary) {
    hash.add(static_cast<std::uint8_t>(row));
    hash.add(static_cast<std::uint8_t>(row >> 8));
  }
}

constexpr int width = 323, height = 241; // odd, so that every edge is there

std::string hash_of(Preset preset, PixelFormat format) {
  static std::map<int, test::Painter> drive; // every format shows the same
  Segmenter segmenter(Settings::of(preset));
  Hash hash;
  for (int i = 0; i < 8; ++i) {
    test::Painter& paint = drive[i];
    if (!paint)
      paint = test::remembered(test::drive(width, height, i), width, height);
    test::OwnedFrame frame(format, width, height, paint, 3);
    frame.frame().pts = i * std::int64_t{66666667};
    if (!segmenter.process(frame.frame()).ok())
      return "refused";
    add(segmenter.estimate(), hash);
  }
  return hash.text();
}

std::string hash_of(Preset preset, scene::Kind kind) {
  scene::Renderer renderer({kind, scene::Light::day, scene::Motion::turn, 2}, 480, 270);
  scene::Picture picture(PixelFormat::I420, 480, 270);
  Segmenter segmenter(Settings::of(preset));
  Hash hash;
  for (std::uint64_t i = 0; i < 6; ++i) {
    renderer.render(12 * i, picture);
    if (!segmenter.process(picture.frame()).ok())
      return "refused";
    add(segmenter.estimate(), hash);
  }
  return hash.text();
}

/// A drive past stones, at 30 Hz: motion needs some frames to begin.
std::string hash_of_drive() {
  scene::Renderer renderer({scene::Kind::plain, scene::Light::day, scene::Motion::straight, 101}, 480, 270);
  scene::Picture picture(PixelFormat::I420, 480, 270);
  Segmenter with(Settings::of(Preset::standard));
  Settings off = Settings::of(Preset::standard);
  off.motion = Motion::off;
  Segmenter without(off);
  Hash hash, other;
  for (std::uint64_t i = 0; i < 50; ++i) {
    renderer.render(i, picture);
    Frame frame = picture.frame();
    frame.pts = static_cast<std::int64_t>(i) * 1000000000 / 30;
    if (!with.process(frame).ok() || !without.process(frame).ok())
      return "refused";
    add(with.estimate(), hash);
    add(without.estimate(), other);
  }
  EXPECT_NE(hash.text(), other.text()) << "motion saw nothing";
  return hash.text();
}

using Hashes = std::map<std::string, std::string>;

Hashes compute() {
  Hashes hashes;
  for (Preset preset : {Preset::paper, Preset::standard}) {
    const std::string name = preset == Preset::paper ? "paper " : "default ";
    for (int format = 0; format < pixel_format_count; ++format)
      hashes[name + names[format]] = hash_of(preset, static_cast<PixelFormat>(format));
    for (const auto& [place, kind] : places)
      hashes[name + place] = hash_of(preset, kind);
  }
  hashes["default drive"] = hash_of_drive();
  return hashes;
}

const Hashes& computed() {
  static const Hashes hashes = compute();
  return hashes;
}

TEST(MaskHashes, AreThoseOnRecord) {
  const Hashes& now = computed();
  if (const char* path = std::getenv("TERRAINSEG_WRITE_GOLDEN")) {
    std::ofstream out(path);
    for (const auto& [name, hash] : now)
      out << name << ' ' << hash << '\n';
    ASSERT_TRUE(out.good()) << path;
    GTEST_SKIP() << "wrote " << path;
  }
  std::ifstream in(TERRAINSEG_GOLDEN_FILE);
  ASSERT_TRUE(in) << TERRAINSEG_GOLDEN_FILE;
  Hashes recorded;
  for (std::string preset, what, hash; in >> preset >> what >> hash;)
    recorded[preset + ' ' + what] = hash;
  ASSERT_EQ(recorded.size(), now.size());
  for (const auto& [name, hash] : now)
    EXPECT_EQ(hash, recorded[name]) << name;
}

TEST(MaskHashes, DependOnThePicture) {
  const Hashes& now = computed();
  EXPECT_NE(now.at("paper I420"), now.at("paper RGB"));
  EXPECT_EQ(now.at("paper I420"), now.at("paper NV21"));
  EXPECT_EQ(now.at("default RGB"), now.at("default ABGR"));
}

// Frames of more bits that hold the same upper 8, and other layouts of the same samples.
TEST(MaskHashes, OfOnePictureInSeveralFormatsAgree) {
  const Hashes& now = computed();
  for (const std::string preset : {"default ", "paper "}) {
    for (const char* format : {"NV12", "P010_10LE", "I420_10LE"})
      EXPECT_EQ(now.at(preset + format), now.at(preset + "I420")) << preset << format;
    for (const char* format : {"NV16", "NV61", "YVYU", "VYUY", "I422_10LE"})
      EXPECT_EQ(now.at(preset + format), now.at(preset + "Y42B")) << preset << format;
    EXPECT_EQ(now.at(preset + "NV24"), now.at(preset + "Y444"));
    EXPECT_EQ(now.at(preset + "GRAY16_LE"), now.at(preset + "GRAY8"));
    EXPECT_NE(now.at(preset + "GRAY8"), now.at(preset + "Y444"));
  }
}

} // namespace
} // namespace terrainseg
