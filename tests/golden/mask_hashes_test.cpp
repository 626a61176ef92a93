// SPDX-License-Identifier: LGPL-2.1-or-later
// Estimates are the same bytes on every processor and in every build. One line a format and preset, over
// eight generated frames, one a rendered place, which has what the stages are for, and one for a drive past
// stones. A line has two hashes: of the mask and the boundary, and of all other fields of the estimate.
//
// When a change of the pipeline is meant to change estimates, write the hashes again and say so in the
// commit:
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
  /// The low bytes of a number, the lowest first.
  void add(std::uint64_t number, int bytes) {
    for (int i = 0; i < bytes; ++i)
      add(static_cast<std::uint8_t>(number >> (8 * i)));
  }
  void add(const GrayView& view) {
    add(static_cast<std::uint64_t>(view.width), 2);
    add(static_cast<std::uint64_t>(view.height), 2);
    for (int y = 0; y < view.height; ++y)
      for (int x = 0; x < view.width; ++x)
        add(view.plane.row(y)[x]);
  }
  void add(const Rectangle& r) {
    for (const int side : {r.x, r.y, r.width, r.height})
      add(static_cast<std::uint64_t>(side), 4);
  }
  std::string text() const {
    std::ostringstream out;
    out << std::hex << std::setw(16) << std::setfill('0') << value_;
    return out.str();
  }

 private:
  std::uint64_t value_ = 0xcbf29ce484222325u;
};

/// Of a sequence of estimates.
struct Hashes {
  Hash mask; ///< and boundary
  Hash rest; ///< all other fields

  void add(const Estimate& e) {
    for (int y = 0; y < e.mask.height; ++y)
      for (int x = 0; x < e.mask.width; ++x)
        mask.add(e.mask.plane.row(y)[x]);
    for (const std::uint16_t row : e.boundary)
      mask.add(row, 2);
    rest.add(e.frame, 8);
    for (const int number :
         {e.frame_width, e.frame_height, e.horizon_row, int{e.horizon_confidence}, e.vanishing_row,
          e.speed_over_height, int{e.confidence}, e.traversable_permille, e.model_count})
      rest.add(static_cast<std::uint64_t>(number), 4);
    rest.add(e.mask_region);
    rest.add(e.window);
    rest.add(e.confidence_map);
    rest.add(e.model_generation, 4);
    rest.add(e.flags, 4);
    for (const ModelSummary& model : e.models) {
      for (const std::uint16_t mean : model.mean)
        rest.add(mean, 2);
      for (const std::uint32_t variance : model.variance)
        rest.add(variance, 4);
      rest.add(model.mass, 8);
      for (const std::uint8_t component : model.rgb)
        rest.add(component);
    }
  }
  std::string text() const { return mask.text() + ' ' + rest.text(); }
};

constexpr int width = 323, height = 241; // odd, so that every edge is there

std::string hash_of(Preset preset, PixelFormat format) {
  static std::map<int, test::Painter> drive; // every format shows the same
  Segmenter segmenter(Settings::of(preset));
  Hashes hashes;
  for (int i = 0; i < 8; ++i) {
    test::Painter& paint = drive[i];
    if (!paint)
      paint = test::remembered(test::drive(width, height, i), width, height);
    test::OwnedFrame frame(format, width, height, paint, 3);
    frame.frame().pts = i * std::int64_t{66666667};
    if (!segmenter.process(frame.frame()).ok())
      return "refused";
    hashes.add(segmenter.estimate());
  }
  return hashes.text();
}

std::string hash_of(Preset preset, scene::Kind kind) {
  scene::Renderer renderer({kind, scene::Light::day, scene::Motion::turn, 2}, 480, 270);
  scene::Picture picture(PixelFormat::I420, 480, 270);
  Segmenter segmenter(Settings::of(preset));
  Hashes hashes;
  for (std::uint64_t i = 0; i < 6; ++i) {
    renderer.render(12 * i, picture);
    if (!segmenter.process(picture.frame()).ok())
      return "refused";
    hashes.add(segmenter.estimate());
  }
  return hashes.text();
}

/// A drive past stones, at 30 Hz: motion needs some frames to begin.
std::string hash_of_drive() {
  scene::Renderer renderer({scene::Kind::plain, scene::Light::day, scene::Motion::straight, 101}, 480, 270);
  scene::Picture picture(PixelFormat::I420, 480, 270);
  Segmenter with(Settings::of(Preset::standard));
  Settings off = Settings::of(Preset::standard);
  off.motion = Motion::off;
  Segmenter without(off);
  Hashes hashes, other;
  for (std::uint64_t i = 0; i < 50; ++i) {
    renderer.render(i, picture);
    Frame frame = picture.frame();
    frame.pts = static_cast<std::int64_t>(i) * 1000000000 / 30;
    if (!with.process(frame).ok() || !without.process(frame).ok())
      return "refused";
    hashes.add(with.estimate());
    other.add(without.estimate());
  }
  EXPECT_NE(hashes.mask.text(), other.mask.text()) << "motion saw nothing";
  return hashes.text();
}

/// By preset and format, place or drive: the text of its hashes.
using Record = std::map<std::string, std::string>;

Record compute() {
  Record hashes;
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

const Record& computed() {
  static const Record hashes = compute();
  return hashes;
}

TEST(MaskHashes, AreThoseOnRecord) {
  const Record& now = computed();
  if (const char* path = std::getenv("TERRAINSEG_WRITE_GOLDEN")) {
    std::ofstream out(path);
    for (const auto& [name, hash] : now)
      out << name << ' ' << hash << '\n';
    ASSERT_TRUE(out.good()) << path;
    GTEST_SKIP() << "wrote " << path;
  }
  std::ifstream in(TERRAINSEG_GOLDEN_FILE);
  ASSERT_TRUE(in) << TERRAINSEG_GOLDEN_FILE;
  Record recorded;
  for (std::string preset, what, mask, rest; in >> preset >> what >> mask >> rest;)
    recorded[preset + ' ' + what] = mask + ' ' + rest;
  ASSERT_EQ(recorded.size(), now.size());
  for (const auto& [name, hash] : now)
    EXPECT_EQ(hash, recorded[name]) << name;
}

TEST(MaskHashes, DependOnThePicture) {
  const Record& now = computed();
  EXPECT_NE(now.at("paper I420"), now.at("paper RGB"));
  EXPECT_EQ(now.at("paper I420"), now.at("paper NV21"));
  EXPECT_EQ(now.at("default RGB"), now.at("default ABGR"));
}

// Frames of more bits that hold the same upper 8, and other layouts of the same samples.
TEST(MaskHashes, OfOnePictureInSeveralFormatsAgree) {
  const Record& now = computed();
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
