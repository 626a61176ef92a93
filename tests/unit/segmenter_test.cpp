// SPDX-License-Identifier: LGPL-2.1-or-later
// The whole filter: what it promises for good input, and what it does with bad input.
#include "terrainseg/segmenter.hpp"

#include <algorithm>
#include <cstring>

#include <gtest/gtest.h>

#include "support/frames.hpp"

namespace terrainseg {
namespace {

using test::Components;
using test::drive;
using test::OwnedFrame;
using test::Painter;

Settings paper() {
  return Settings::of(Preset::paper);
}

/// Ground of one noisy colour under a sky of another; 320 x 240, ground from row 96 down.
Painter plain(Components ground = {100, 120, 134}, Components sky = {210, 140, 116}) {
  return [=](int x, int y) -> Components {
    const Components& base = y < 96 ? sky : ground;
    const int noise = test::noise_at(x, y, 0, 3);
    return {static_cast<std::uint8_t>(base[0] + noise), base[1], base[2]};
  };
}

Painter constant(Components color) {
  return [=](int, int) { return color; };
}

OwnedFrame i420(const Painter& paint, int width = 320, int height = 240) {
  return OwnedFrame(PixelFormat::I420, width, height, paint);
}

std::uint8_t mask_at(const Estimate& e, int x, int y) {
  return e.mask.plane.row(y)[x];
}

/// Share of mask pixels in a rectangle that have a value, in permille.
int share(const Estimate& e, const Rectangle& r, std::uint8_t value) {
  int count = 0;
  for (int y = r.y; y < r.y + r.height; ++y)
    for (int x = r.x; x < r.x + r.width; ++x)
      count += mask_at(e, x, y) == value;
  return count * 1000 / (r.width * r.height);
}

const Rectangle everything{0, 0, 320, 240};

TEST(Segmenter, KnowsNothingBeforeTheFirstFrame) {
  const Segmenter segmenter(paper());
  EXPECT_EQ(segmenter.estimate().flags, flag_unknown);
  EXPECT_EQ(segmenter.estimate().horizon_row, -1);
  EXPECT_TRUE(segmenter.estimate().mask.empty());
}

TEST(Segmenter, SeesThePlainInBothPresets) {
  for (Preset preset : {Preset::paper, Preset::standard}) {
    Segmenter segmenter(Settings::of(preset));
    const auto frame = i420(plain());
    for (int i = 0; i < 5; ++i)
      ASSERT_TRUE(segmenter.process(frame.frame()).ok());
    const Estimate& e = segmenter.estimate();
    EXPECT_EQ(e.frame, 4u);
    EXPECT_EQ(e.flags, flag_learned);
    EXPECT_GT(share(e, {0, 130, 320, 110}, mask_traversable), 950);
    EXPECT_LT(share(e, {0, 0, 320, 70}, mask_traversable), 20);
    EXPECT_NEAR(e.traversable_permille, 600, 60);
    EXPECT_GT(e.confidence, 128);
    ASSERT_EQ(e.boundary.size(), 320u);
    for (std::uint16_t row : e.boundary)
      EXPECT_NEAR(row, 96, 12);
    EXPECT_NEAR(e.horizon_row, 96, 36); // the paper's horizon is a row of a grid of 32 pixels
    ASSERT_GE(e.model_count, 1);
    EXPECT_NEAR(e.models[0].mean[0] / 256, 103, 8);
    EXPECT_EQ(e.model_generation, 5u);
    EXPECT_EQ(segmenter.counters().learned, 5u);
  }
}

TEST(Segmenter, TheTraversableShareIsThatOfTheMask) {
  Settings settings = paper();
  settings.ignore_regions = {{0, 0, 100, 240}, {50, 100, 100, 10}};
  Segmenter segmenter(settings);
  const auto frame = i420(drive(320, 240, 0));
  ASSERT_TRUE(segmenter.process(frame.frame()).ok());
  const Estimate& e = segmenter.estimate();
  EXPECT_EQ(e.traversable_permille, share(e, everything, mask_traversable));
}

TEST(Segmenter, TheBoundaryStopsAtAnObstacle) {
  const Painter ground = plain();
  const auto with_wall = [&](int x, int y) -> Components {
    if (x >= 144 && x < 176 && y >= 128 && y < 176)
      return {30, 170, 90};
    return ground(x, y);
  };
  Segmenter segmenter(paper());
  const auto frame = i420(with_wall);
  ASSERT_TRUE(segmenter.process(frame.frame()).ok());
  EXPECT_NEAR(segmenter.estimate().boundary[160], 176, 12);
  EXPECT_NEAR(segmenter.estimate().boundary[64], 96, 12);
}

TEST(Segmenter, IsBlockedWhenTheGroundEndsAtTheWindow) {
  const Painter ground = plain();
  const auto walled = [&](int x, int y) -> Components {
    return y < 206 ? Components{30, 170, 90} : ground(x, y);
  };
  Segmenter segmenter(paper());
  const auto open = i420(plain()), shut = i420(walled);
  ASSERT_TRUE(segmenter.process(open.frame()).ok());
  EXPECT_FALSE(segmenter.estimate().flags & flag_blocked);
  ASSERT_TRUE(segmenter.process(shut.frame()).ok());
  EXPECT_TRUE(segmenter.estimate().flags & flag_blocked);
}

TEST(Segmenter, IgnoredRegionsAre128AndNotLearned) {
  Settings settings = paper();
  settings.ignore_regions = {{0, 200, 320, 40}};
  settings.window_bottom = 40;
  const Painter ground = plain();
  const auto bonnet = [&](int x, int y) -> Components {
    return y >= 200 ? Components{20, 60, 200} : ground(x, y);
  };
  Segmenter segmenter(settings);
  const auto frame = i420(bonnet);
  ASSERT_TRUE(segmenter.process(frame.frame()).ok());
  EXPECT_EQ(share(segmenter.estimate(), {0, 200, 320, 40}, mask_doubtful), 1000);
  EXPECT_GT(share(segmenter.estimate(), {0, 130, 320, 60}, mask_traversable), 950);
}

TEST(Segmenter, AnIgnoredWindowStarves) {
  Settings settings = paper();
  settings.ignore_regions = {{0, 120, 320, 120}};
  Segmenter segmenter(settings);
  const auto frame = i420(plain());
  ASSERT_TRUE(segmenter.process(frame.frame()).ok());
  EXPECT_EQ(segmenter.estimate().flags, flag_starved | flag_unknown | flag_blocked);
  EXPECT_EQ(share(segmenter.estimate(), everything, mask_doubtful), 1000);
  EXPECT_EQ(segmenter.counters().skipped_starved, 1u);
  for (std::uint16_t row : segmenter.estimate().boundary)
    EXPECT_EQ(row, 240);
}

TEST(Segmenter, SupervisionTrainsInsteadOfTheWindow) {
  const Painter ground = plain();
  const auto obstacle_in_window = [&](int x, int y) -> Components {
    return y >= 180 ? Components{30, static_cast<std::uint8_t>(168 + test::noise_at(x, y, 5, 2)), 90}
                    : ground(x, y);
  };
  const auto frame = i420(obstacle_in_window);
  const std::array<Rectangle, 1> rectangles{{{40, 110, 240, 60}}};
  std::vector<std::uint8_t> laser(32 * 24, 0);
  std::fill(laser.begin() + 11 * 32, laser.begin() + 17 * 32, std::uint8_t{255});
  for (const Supervision& supervision :
       {Supervision{rectangles, {}}, Supervision{{}, {{laser.data(), 32}, 32, 24}}}) {
    Segmenter segmenter(paper());
    ASSERT_TRUE(segmenter.process(frame.frame(), supervision).ok());
    EXPECT_TRUE(segmenter.estimate().flags & flag_learned);
    EXPECT_GT(share(segmenter.estimate(), {0, 130, 320, 40}, mask_traversable), 950);
    EXPECT_LT(share(segmenter.estimate(), {0, 190, 320, 50}, mask_traversable), 50);
    EXPECT_GE(segmenter.estimate().window.y, 104);
    EXPECT_LE(segmenter.estimate().window.y + segmenter.estimate().window.height, 176);
  }
  Segmenter segmenter(paper());
  const std::array<Rectangle, 1> outside{{{1000, 1000, 10, 10}}};
  ASSERT_TRUE(segmenter.process(frame.frame(), {outside, {}}).ok());
  EXPECT_TRUE(segmenter.estimate().flags & flag_starved);
}

// The lowest row of a veto in a column, and the ground that remains below it.
TEST(Segmenter, VetoedPixelsAreNeverTraversable) {
  const auto frame = i420(plain());
  std::vector<std::uint8_t> blob(64 * 48, 0);
  for (int y = 30; y < 36; ++y) // stretched by 5: columns 50 to 79, rows 150 to 179
    std::fill_n(blob.begin() + y * 64 + 10, 6, std::uint8_t{200});
  const std::array<GrayView, 1> masks{{{{blob.data(), 64}, 64, 48}}};
  const std::array<Rectangle, 2> rectangles{
      {{200, 150, 3, 40}, {300, 100, 400, 500}}}; // one leaves the frame
  for (Preset preset : {Preset::paper, Preset::standard})
    for (int mask_level : {0, 2}) {
      Settings settings = Settings::of(preset);
      settings.mask_level = mask_level;
      Segmenter segmenter(settings), untouched(settings);
      for (int i = 0; i < 3; ++i) {
        ASSERT_TRUE(segmenter.process(frame.frame(), {}, {}, {rectangles, masks}).ok());
        ASSERT_TRUE(untouched.process(frame.frame()).ok());
      }
      const Estimate &vetoed = segmenter.estimate(), &free = untouched.estimate();
      EXPECT_TRUE(vetoed.flags & flag_learned);
      int pixels = 0, traversable = 0;
      for (int y = 0; y < vetoed.mask.height; ++y)
        for (int x = 0; x < vetoed.mask.width; ++x) {
          const int left = x << mask_level, top = y << mask_level, right = (x + 1) << mask_level,
                    bottom = (y + 1) << mask_level;
          const auto meets = [&](int x0, int y0, int x1, int y1) {
            return left < x1 && right > x0 && top < y1 && bottom > y0;
          };
          const bool under =
              meets(50, 150, 80, 180) || meets(200, 150, 203, 190) || meets(300, 100, 320, 240);
          if (under) {
            EXPECT_EQ(mask_at(vetoed, x, y), mask_not_traversable) << x << "," << y;
          } else {
            EXPECT_EQ(mask_at(vetoed, x, y), mask_at(free, x, y)) << x << "," << y;
          }
          pixels += under;
          traversable += mask_at(vetoed, x, y) == mask_traversable;
        }
      EXPECT_GE(pixels, (30 * 30 + 3 * 40 + 20 * 140) >> (2 * mask_level));
      EXPECT_EQ(vetoed.traversable_permille, traversable * 1000 / (vetoed.mask.width * vetoed.mask.height));
      EXPECT_GT(free.traversable_permille, vetoed.traversable_permille);
      for (std::size_t x = 0; x < vetoed.boundary.size(); ++x) {
        const int left = static_cast<int>(x) << mask_level, right = static_cast<int>(x + 1) << mask_level;
        if (right > 300) {
          EXPECT_EQ(vetoed.boundary[x], 240) << x;
        } else if (left < 203 && right > 200) {
          EXPECT_GE(vetoed.boundary[x], 190) << x;
          EXPECT_LT(vetoed.boundary[x], 216) << x;
        } else if (left < 80 && right > 50) {
          EXPECT_GE(vetoed.boundary[x], 180) << x;
          EXPECT_LT(vetoed.boundary[x], 204) << x;
        }
      }
      EXPECT_LT(vetoed.boundary[static_cast<std::size_t>(150 >> mask_level)], 120);
    }
}

TEST(Segmenter, VetoedPixelsInTheWindowAreNotLearned) {
  const Painter ground = plain();
  // The window is rows 204 to 239 and columns 112 to 207: half of it is a red thing.
  const auto thing_in_window = [&](int x, int y) -> Components {
    return x >= 160 && y >= 180
               ? Components{90, 100, static_cast<std::uint8_t>(190 + test::noise_at(x, y, 5, 2))}
               : ground(x, y);
  };
  const auto frame = i420(thing_in_window), bare = i420(ground);
  const std::array<Rectangle, 1> thing{{{150, 170, 170, 70}}};
  // The largest V of what was learned.
  const auto reddest = [](const Segmenter& segmenter) {
    int most = 0;
    for (const TerrainModel& model : segmenter.terrain().models)
      most = std::max(most, model.mass > 0 ? model.mean[2] >> 8 : 0);
    return most;
  };
  for (Preset preset : {Preset::paper, Preset::standard}) {
    const Settings settings = Settings::of(preset);
    Segmenter with(settings), without(settings), of_ground(settings);
    for (int i = 0; i < 3; ++i) {
      ASSERT_TRUE(with.process(frame.frame(), {}, {}, {thing, {}}).ok());
      ASSERT_TRUE(without.process(frame.frame()).ok());
      ASSERT_TRUE(of_ground.process(bare.frame()).ok());
    }
    EXPECT_TRUE(with.estimate().flags & flag_learned);
    EXPECT_LE(reddest(with), reddest(of_ground) + 2);
    EXPECT_GT(reddest(without), reddest(of_ground) + 20) << "the same window without a veto teaches red";
  }
}

// Nor as what is no terrain: a detector's box holds ground too.
TEST(Segmenter, TheColoursUnderAVetoAreNotLearned) {
  const auto blue = i420(plain()), green = i420(plain({100, 120, 134}, {210, 60, 60}));
  const std::array<Rectangle, 1> sky{{{0, 0, 320, 120}}}; // and what its colours reach in coarse cells
  const auto learned = [](const OwnedFrame& frame, std::span<const Rectangle> vetoed) {
    Segmenter segmenter{Settings{}};
    EXPECT_TRUE(segmenter.process(frame.frame(), {}, {}, {vetoed, {}}).ok());
    return segmenter.terrain().negative_colors;
  };
  EXPECT_EQ(learned(blue, sky), learned(green, sky));
  EXPECT_NE(learned(blue, {}), learned(green, {}));
}

TEST(Segmenter, AVetoOfTheWholeWindowStarves) {
  const auto frame = i420(plain());
  const std::array<Rectangle, 1> all{{{0, 0, 320, 240}}};
  for (Preset preset : {Preset::paper, Preset::standard}) {
    Segmenter segmenter(Settings::of(preset));
    ASSERT_TRUE(segmenter.process(frame.frame(), {}, {}, {all, {}}).ok());
    EXPECT_EQ(segmenter.estimate().flags, flag_starved | flag_unknown | flag_blocked);
    EXPECT_EQ(share(segmenter.estimate(), everything, mask_doubtful), 1000);
    ASSERT_TRUE(segmenter.process(frame.frame()).ok());
    const Terrain learned = segmenter.terrain();
    ASSERT_TRUE(segmenter.process(frame.frame(), {}, {}, {all, {}}).ok());
    EXPECT_EQ(segmenter.terrain(), learned);
    EXPECT_EQ(share(segmenter.estimate(), everything, mask_not_traversable), 1000);
    EXPECT_EQ(segmenter.estimate().flags & (flag_starved | flag_blocked), flag_starved | flag_blocked);
    EXPECT_EQ(segmenter.estimate().traversable_permille, 0);
  }
}

TEST(Segmenter, AnEmptyVetoChangesNothing) {
  const std::array<Rectangle, 2> nothing{{{1000, 1000, 10, 10}, {5, 5, 0, 7}}};
  const std::vector<std::uint8_t> black(8 * 8, 127);
  const std::array<GrayView, 2> masks{{{{black.data(), 8}, 8, 8}, {}}};
  for (Preset preset : {Preset::paper, Preset::standard}) {
    Segmenter with(Settings::of(preset)), without(Settings::of(preset));
    for (int i = 0; i < 4; ++i) {
      const auto frame = i420(drive(320, 240, i));
      ASSERT_TRUE(with.process(frame.frame(), {}, {}, {nothing, masks}).ok());
      ASSERT_TRUE(without.process(frame.frame()).ok());
      EXPECT_EQ(with.terrain(), without.terrain());
      EXPECT_TRUE(std::ranges::equal(with.estimate().boundary, without.estimate().boundary));
      for (int y = 0; y < 240; ++y)
        EXPECT_EQ(std::memcmp(with.estimate().mask.plane.row(y), without.estimate().mask.plane.row(y), 320),
                  0);
    }
  }
}

TEST(Segmenter, GatesKeepTheTerrainAsItIs) {
  Segmenter segmenter(paper());
  const auto ground = i420(plain()), obstacle = i420(plain({60, 180, 80}));
  ASSERT_TRUE(segmenter.process(ground.frame()).ok());
  const Terrain before = segmenter.terrain();

  Settings settings = paper();
  settings.near_clear = false;
  segmenter.configure(settings);
  ASSERT_TRUE(segmenter.process(obstacle.frame()).ok());
  EXPECT_TRUE(segmenter.estimate().flags & flag_frozen);
  EXPECT_EQ(segmenter.terrain(), before);
  EXPECT_LT(share(segmenter.estimate(), {0, 130, 320, 110}, mask_traversable), 50);
  EXPECT_LT(segmenter.estimate().confidence, 20);

  settings.learning = false;
  segmenter.configure(settings);
  ASSERT_TRUE(segmenter.process(obstacle.frame()).ok());
  EXPECT_EQ(segmenter.terrain(), before);
  EXPECT_EQ(segmenter.counters().skipped_near, 1u);
  EXPECT_EQ(segmenter.counters().skipped_frozen, 1u);
  EXPECT_EQ(segmenter.counters().learned, 1u);
  EXPECT_EQ(segmenter.counters().frames, 3u);
}

TEST(Segmenter, UnknownWhileNothingWasLearned) {
  Settings settings = paper();
  settings.learning = false;
  Segmenter segmenter(settings);
  const auto frame = i420(plain());
  ASSERT_TRUE(segmenter.process(frame.frame()).ok());
  EXPECT_EQ(segmenter.estimate().flags, flag_frozen | flag_unknown | flag_blocked);
  EXPECT_EQ(share(segmenter.estimate(), everything, mask_doubtful), 1000);
  EXPECT_EQ(segmenter.estimate().horizon_row, -1);
}

TEST(Segmenter, BlankFramesAreUnknownAndTeachNothing) {
  for (Preset preset : {Preset::paper, Preset::standard})
    for (Components color : {Components{16, 128, 128}, Components{0, 0, 0}, Components{120, 100, 90},
                             Components{255, 255, 255}}) {
      Segmenter segmenter(Settings::of(preset));
      const auto blank = i420(constant(color)), ground = i420(plain());
      ASSERT_TRUE(segmenter.process(blank.frame()).ok());
      EXPECT_EQ(segmenter.estimate().flags, flag_starved | flag_unknown | flag_blocked);
      EXPECT_EQ(share(segmenter.estimate(), everything, mask_doubtful), 1000);
      ASSERT_TRUE(segmenter.process(ground.frame()).ok());
      const Terrain learned = segmenter.terrain();
      ASSERT_TRUE(segmenter.process(blank.frame()).ok());
      EXPECT_TRUE(segmenter.estimate().flags & flag_unknown);
      EXPECT_EQ(segmenter.estimate().traversable_permille, 0);
      EXPECT_EQ(segmenter.terrain(), learned);
    }
}

TEST(Segmenter, TinyFramesHaveADefinedResult) {
  for (Preset preset : {Preset::paper, Preset::standard})
    for (int format = 0; format < pixel_format_count; ++format)
      for (auto [width, height] : {std::pair{1, 1}, {1, 7}, {7, 1}, {2, 2}, {3, 5}, {16, 16}, {17, 64}}) {
        Segmenter segmenter(Settings::of(preset));
        const OwnedFrame frame(static_cast<PixelFormat>(format), width, height, drive(width, height, 0));
        for (int i = 0; i < 2; ++i)
          ASSERT_TRUE(segmenter.process(frame.frame()).ok());
        EXPECT_EQ(segmenter.estimate().mask.width, width);
        EXPECT_EQ(segmenter.estimate().mask.height, height);
        EXPECT_TRUE(width * height >= 16 || segmenter.estimate().flags & flag_unknown);
        for (std::uint16_t row : segmenter.estimate().boundary)
          EXPECT_LE(row, height);
      }
}

TEST(Segmenter, AWindowThatDoesNotFitIsNamed) {
  Settings settings = paper();
  settings.window_width = 128;
  settings.window_height = 64;
  Segmenter segmenter(settings);
  const auto small = i420(plain(), 100, 80), large = i420(plain());
  const Status status = segmenter.process(small.frame());
  EXPECT_EQ(status.code(), Status::Code::window_outside_frame);
  EXPECT_NE(status.message().find("128"), std::string::npos);
  EXPECT_NE(status.message().find("100x80"), std::string::npos);
  EXPECT_EQ(segmenter.counters().frames, 0u);
  EXPECT_TRUE(segmenter.process(large.frame()).ok());
}

TEST(Segmenter, BadFramesAreRefusedAndChangeNothing) {
  Segmenter segmenter(paper());
  auto good = i420(plain());
  ASSERT_TRUE(segmenter.process(good.frame()).ok());
  const Terrain before = segmenter.terrain();
  const auto refused = [&](const Frame& frame) {
    const Status status = segmenter.process(frame);
    EXPECT_EQ(status.code(), Status::Code::bad_frame);
    EXPECT_FALSE(status.message().empty());
  };
  Frame bad = good.frame();
  bad.width = 0;
  refused(bad);
  bad = good.frame();
  bad.height = 40000;
  refused(bad);
  bad = good.frame();
  bad.planes[2].data = nullptr;
  refused(bad);
  bad = good.frame();
  bad.planes[1].stride = 100;
  refused(bad);
  EXPECT_EQ(segmenter.terrain(), before);
  EXPECT_EQ(segmenter.counters().frames, 1u);
}

TEST(RowBytes, AreThoseOfTheFormats) {
  using enum PixelFormat;
  const auto bytes = [](PixelFormat format, int plane) { return row_bytes(layout_of(format), plane, 17); };
  EXPECT_EQ(bytes(I420, 0), 17);
  EXPECT_EQ(bytes(I420, 2), 9);
  EXPECT_EQ(bytes(NV21, 1), 18);
  EXPECT_EQ(bytes(Y444, 1), 17);
  EXPECT_EQ(bytes(YUY2, 0), 36);
  EXPECT_EQ(bytes(UYVY, 0), 36);
  EXPECT_EQ(bytes(BGR, 0), 51);
  EXPECT_EQ(bytes(xRGB, 0), 68);
  EXPECT_EQ(bytes(RGBx, 0), 68);
  EXPECT_EQ(bytes(NV16, 1), 18);
  EXPECT_EQ(bytes(NV24, 1), 34);
  EXPECT_EQ(bytes(VYUY, 0), 36);
  EXPECT_EQ(bytes(GRAY8, 0), 17);
  EXPECT_EQ(bytes(GRAY16_LE, 0), 34);
  EXPECT_EQ(bytes(P010_10LE, 0), 34);
  EXPECT_EQ(bytes(P010_10LE, 1), 36);
  EXPECT_EQ(bytes(I422_10LE, 2), 18);
}

TEST(Segmenter, MaskTargetsAreCheckedAndFilled) {
  Segmenter segmenter(paper());
  const auto frame = i420(plain());
  std::vector<std::uint8_t> target(330 * 240, 7);
  EXPECT_EQ(segmenter.process(frame.frame(), {}, {{target.data(), 330}, 319, 240}).code(),
            Status::Code::bad_target);
  EXPECT_EQ(segmenter.process(frame.frame(), {}, {{target.data(), 300}, 320, 240}).code(),
            Status::Code::bad_target);
  ASSERT_TRUE(segmenter.process(frame.frame(), {}, {{target.data(), 330}, 320, 240}).ok());
  EXPECT_EQ(segmenter.estimate().mask.plane.data, target.data());
  EXPECT_EQ(target[320], 7);
  Segmenter own(paper());
  ASSERT_TRUE(own.process(frame.frame()).ok());
  for (int y = 0; y < 240; ++y)
    ASSERT_TRUE(std::equal(own.estimate().mask.plane.row(y), own.estimate().mask.plane.row(y) + 320,
                           &target[y * 330]));
}

TEST(Segmenter, MaskLevelsShrinkTheMask) {
  for (Preset preset : {Preset::paper, Preset::standard})
    for (int level = 0; level <= max_mask_level; ++level) {
      Settings settings = Settings::of(preset);
      settings.mask_level = level;
      Segmenter segmenter(settings);
      const auto frame = i420(plain(), 321, 243);
      ASSERT_TRUE(segmenter.process(frame.frame()).ok());
      ASSERT_TRUE(segmenter.process(frame.frame()).ok());
      const Estimate& e = segmenter.estimate();
      ASSERT_EQ(e.mask.width, mask_extent(321, level));
      ASSERT_EQ(e.mask.height, mask_extent(243, level));
      ASSERT_EQ(e.boundary.size(), static_cast<std::size_t>(e.mask.width));
      EXPECT_EQ(e.mask_region, (Rectangle{0, 0, 321, 243}));
      EXPECT_EQ(mask_at(e, e.mask.width / 2, (200 >> level)), mask_traversable) << level;
      EXPECT_EQ(mask_at(e, e.mask.width / 2, 0), mask_not_traversable) << level;
    }
}

TEST(Segmenter, TheSameInputGivesTheSameBytes) {
  for (Preset preset : {Preset::paper, Preset::standard}) {
    Settings threaded = Settings::of(preset);
    threaded.n_threads = 3;
    Segmenter a(Settings::of(preset)), b(Settings::of(preset)), c(threaded);
    for (int i = 0; i < 6; ++i) {
      const auto frame = i420(drive(320, 240, i));
      for (Segmenter* s : {&a, &b, &c})
        ASSERT_TRUE(s->process(frame.frame()).ok());
      for (Segmenter* s : {&b, &c}) {
        ASSERT_EQ(std::memcmp(a.estimate().mask.plane.data, s->estimate().mask.plane.data, 320 * 240), 0);
        EXPECT_TRUE(std::equal(a.estimate().boundary.begin(), a.estimate().boundary.end(),
                               s->estimate().boundary.begin()));
        EXPECT_EQ(a.estimate().confidence, s->estimate().confidence);
        EXPECT_EQ(a.terrain(), s->terrain());
      }
    }
  }
}

TEST(Segmenter, PaddingAndStridesDoNotMatter) {
  for (int format = 0; format < pixel_format_count; ++format) {
    Segmenter tight(paper()), padded(paper()), flipped(paper());
    const auto f = static_cast<PixelFormat>(format);
    const OwnedFrame a(f, 319, 241, drive(319, 241, 1)), b(f, 319, 241, drive(319, 241, 1), 37);
    // The same picture stored bottom up, read with negative strides.
    OwnedFrame c(f, 319, 241, drive(319, 241, 1));
    ASSERT_TRUE(tight.process(a.frame()).ok());
    ASSERT_TRUE(padded.process(b.frame()).ok());
    std::array<std::vector<std::uint8_t>, 3> upside_down;
    const FormatLayout& layout = layout_of(f);
    for (int p = 0; p < layout.planes; ++p) {
      int rows = 0;
      for (const auto& part : layout.components)
        if (part.plane == p)
          rows = std::max(rows, subsampled(241, part.y_shift));
      Plane& plane = c.frame().planes[p];
      for (int y = rows - 1; y >= 0; --y)
        upside_down[p].insert(upside_down[p].end(), plane.row(y), plane.row(y) + plane.stride);
      plane = {upside_down[p].data() + (rows - 1) * plane.stride, -plane.stride};
    }
    ASSERT_TRUE(flipped.process(c.frame()).ok());
    EXPECT_EQ(std::memcmp(tight.estimate().mask.plane.data, padded.estimate().mask.plane.data, 319 * 241), 0);
    EXPECT_EQ(std::memcmp(tight.estimate().mask.plane.data, flipped.estimate().mask.plane.data, 319 * 241),
              0);
  }
}

TEST(Segmenter, FormatsOfOneLayoutAgree) {
  using enum PixelFormat;
  const std::vector<std::vector<PixelFormat>> families = {
      {I420, YV12, NV12, NV21, P010_10LE, I420_10LE},
      {Y42B, YUY2, UYVY, YVYU, VYUY, NV16, NV61, I422_10LE},
      {Y444, NV24},
      {GRAY8, GRAY16_LE},
      {RGB, BGR, RGBx, BGRx, xRGB, xBGR, RGBA, BGRA, ARGB, ABGR}};
  for (const auto& family : families) {
    Segmenter first(paper());
    const OwnedFrame a(family[0], 321, 239, drive(321, 239, 2));
    ASSERT_TRUE(first.process(a.frame()).ok());
    for (PixelFormat format : family) {
      Segmenter other(paper());
      const OwnedFrame b(format, 321, 239, drive(321, 239, 2));
      ASSERT_TRUE(other.process(b.frame()).ok());
      EXPECT_EQ(std::memcmp(first.estimate().mask.plane.data, other.estimate().mask.plane.data, 321 * 239), 0)
          << static_cast<int>(format);
      EXPECT_EQ(first.terrain().models, other.terrain().models);
    }
  }
}

TEST(Segmenter, AnotherColourSpaceForgets) {
  Segmenter segmenter(paper());
  auto yuv = i420(plain());
  ASSERT_TRUE(segmenter.process(yuv.frame()).ok());
  ASSERT_TRUE(segmenter.process(yuv.frame()).ok());
  const std::uint64_t two_frames = segmenter.terrain().models[0].mass;
  yuv.frame().colorimetry.matrix = ColorMatrix::bt709;
  ASSERT_TRUE(segmenter.process(yuv.frame()).ok());
  EXPECT_LT(segmenter.terrain().models[0].mass, two_frames);
  EXPECT_EQ(segmenter.terrain().space.colorimetry.matrix, ColorMatrix::bt709);
  EXPECT_GT(segmenter.estimate().model_generation, 2u);

  OwnedFrame rgb(PixelFormat::RGB, 320, 240, plain());
  ASSERT_TRUE(segmenter.process(rgb.frame()).ok());
  const Terrain learned = segmenter.terrain();
  EXPECT_TRUE(learned.space.rgb);
  rgb.frame().colorimetry.matrix = ColorMatrix::bt709; // means nothing for RGB
  ASSERT_TRUE(segmenter.process(rgb.frame()).ok());
  EXPECT_GT(segmenter.terrain().models[0].mass, learned.models[0].mass);
}

TEST(Segmenter, AnotherSizeKeepsTheTerrain) {
  for (Preset preset : {Preset::paper, Preset::standard}) {
    Settings settings = Settings::of(preset);
    Segmenter segmenter(settings);
    const auto small = i420(plain()), large = OwnedFrame(PixelFormat::I420, 640, 480,
                                                         [](int x, int y) { return plain()(x, y / 2); });
    ASSERT_TRUE(segmenter.process(small.frame()).ok());
    settings.learning = false;
    segmenter.configure(settings);
    for (int i = 0; i < 2; ++i)
      ASSERT_TRUE(segmenter.process(large.frame()).ok());
    EXPECT_EQ(segmenter.estimate().mask.width, 640);
    EXPECT_GT(share(segmenter.estimate(), {0, 260, 640, 220}, mask_traversable), 900);
    ASSERT_TRUE(segmenter.process(small.frame()).ok());
    EXPECT_EQ(segmenter.estimate().mask.width, 320);
  }
}

TEST(Segmenter, ConfigureWhileRunning) {
  Settings settings = paper();
  Segmenter segmenter(settings);
  for (int i = 0; i < 8; ++i) {
    const auto frame = i420(drive(320, 240, i * 3));
    ASSERT_TRUE(segmenter.process(frame.frame()).ok());
  }
  const Terrain before = segmenter.terrain();
  settings.learned_models = 2;
  settings.training_models = 1;
  settings.learning = false;
  segmenter.configure(settings);
  EXPECT_EQ(segmenter.settings(), settings);
  const auto frame = i420(drive(320, 240, 30));
  ASSERT_TRUE(segmenter.process(frame.frame()).ok());
  ASSERT_EQ(segmenter.terrain().models.size(), 2u);
  std::uint64_t most = 0;
  for (const TerrainModel& model : before.models)
    most = std::max(most, model.mass);
  EXPECT_EQ(std::max(segmenter.terrain().models[0].mass, segmenter.terrain().models[1].mass), most);

  settings.bit_shift = 5;
  settings.threshold_q8 = 4096;
  segmenter.configure(settings);
  ASSERT_TRUE(segmenter.process(frame.frame()).ok());
  const int generous = segmenter.estimate().traversable_permille;
  settings.threshold_q8 = 128;
  segmenter.configure(settings);
  ASSERT_TRUE(segmenter.process(frame.frame()).ok());
  EXPECT_LT(segmenter.estimate().traversable_permille, generous);
}

TEST(Segmenter, ThresholdIsInSigmas) {
  int last = -1;
  for (int threshold_q8 : {0, 128, 256, 512, 768, 1536, 4096}) {
    Settings settings = paper();
    settings.threshold_q8 = threshold_q8;
    Segmenter segmenter(settings);
    const auto frame = i420(drive(320, 240, 0));
    ASSERT_TRUE(segmenter.process(frame.frame()).ok());
    EXPECT_GE(segmenter.estimate().traversable_permille, last);
    last = segmenter.estimate().traversable_permille;
  }
  EXPECT_GT(last, 500);
}

TEST(Segmenter, TheHorizonCanBeSwitchedOff) {
  Settings settings = paper();
  settings.horizon = HorizonMode::off;
  Segmenter segmenter(settings);
  const auto frame = i420(plain());
  ASSERT_TRUE(segmenter.process(frame.frame()).ok());
  EXPECT_EQ(segmenter.estimate().horizon_row, -1);
}

TEST(Segmenter, NothingAboveThePapersHorizonIsTerrain) {
  // A patch of ground colour in the sky, as the paper's figure 7.
  const Painter ground = plain();
  const auto with_patch = [&](int x, int y) {
    return x >= 40 && x < 104 && y < 32 ? ground(x, 200) : ground(x, y);
  };
  Settings settings = paper();
  Segmenter with(settings);
  const auto frame = i420(with_patch);
  ASSERT_TRUE(with.process(frame.frame()).ok());
  EXPECT_GT(with.estimate().horizon_row, 32);
  EXPECT_EQ(share(with.estimate(), {40, 0, 64, 32}, mask_traversable), 0);
  settings.horizon = HorizonMode::off;
  Segmenter without(settings);
  ASSERT_TRUE(without.process(frame.frame()).ok());
  EXPECT_GT(share(without.estimate(), {40, 0, 64, 32}, mask_traversable), 900);
}

TEST(Segmenter, TerrainIsKeptAndAdopted) {
  for (Preset preset : {Preset::paper, Preset::standard}) {
    Settings settings = Settings::of(preset);
    Segmenter teacher(settings);
    for (int i = 0; i < 4; ++i) {
      const auto frame = i420(drive(320, 240, i));
      ASSERT_TRUE(teacher.process(frame.frame()).ok());
    }
    settings.learning = false;
    Segmenter pupil(settings);
    ASSERT_TRUE(pupil.adopt(teacher.terrain()).ok());
    EXPECT_EQ(pupil.terrain(), teacher.terrain());
    const auto frame = i420(drive(320, 240, 5));
    ASSERT_TRUE(pupil.process(frame.frame()).ok());
    EXPECT_FALSE(pupil.estimate().flags & flag_unknown);
    EXPECT_GT(pupil.estimate().traversable_permille, 150);
  }
}

TEST(Segmenter, ForeignTerrainIsRefused) {
  Segmenter segmenter(paper());
  const auto frame = i420(plain());
  ASSERT_TRUE(segmenter.process(frame.frame()).ok());
  const Terrain own = segmenter.terrain();
  const auto refused = [&](const Terrain& terrain) {
    const Status status = segmenter.adopt(terrain);
    EXPECT_EQ(status.code(), Status::Code::foreign_terrain);
    EXPECT_FALSE(status.message().empty());
    EXPECT_EQ(segmenter.terrain(), own);
  };
  Terrain terrain = own;
  terrain.space.rgb = true;
  refused(terrain);
  terrain = own;
  terrain.models.resize(max_models + 1);
  refused(terrain);
  terrain = own;
  terrain.models[0].variance[1] = 0;
  refused(terrain);
  terrain = own;
  terrain.exposure_mean = 100000000; // a gain of 0: division by zero in the next frame
  refused(terrain);
  terrain = own;
  terrain.models[0].mass = ~0ull; // with the next frame's it is 0: division by zero
  refused(terrain);
  terrain = own;
  terrain.horizon = 0x80000000;
  refused(terrain);
  terrain = own;
  terrain.negative_colors.resize(7);
  refused(terrain);
}

TEST(Segmenter, TheOtherPipelinesTerrainIsWelcomeAfterTheSwitch) {
  Segmenter teacher(paper()), pupil{Settings{}};
  const auto frame = i420(plain());
  ASSERT_TRUE(teacher.process(frame.frame()).ok());
  ASSERT_TRUE(pupil.process(frame.frame()).ok());
  EXPECT_FALSE(pupil.adopt(teacher.terrain()).ok());
  pupil.configure(paper());
  ASSERT_TRUE(pupil.adopt(teacher.terrain()).ok());
  Settings settings = paper();
  settings.learning = false;
  pupil.configure(settings);
  ASSERT_TRUE(pupil.process(frame.frame()).ok());
  EXPECT_FALSE(pupil.estimate().flags & flag_unknown);
  EXPECT_EQ(pupil.terrain(), teacher.terrain());
}

TEST(Segmenter, ResetForgets) {
  Settings settings = paper();
  Segmenter segmenter(settings);
  const auto frame = i420(plain());
  ASSERT_TRUE(segmenter.process(frame.frame()).ok());
  const std::uint32_t generation = segmenter.estimate().model_generation;
  settings.learning = false;
  segmenter.configure(settings);
  segmenter.reset_temporal();
  ASSERT_TRUE(segmenter.process(frame.frame()).ok());
  EXPECT_FALSE(segmenter.estimate().flags & flag_unknown);
  segmenter.reset();
  ASSERT_TRUE(segmenter.process(frame.frame()).ok());
  EXPECT_TRUE(segmenter.estimate().flags & flag_unknown);
  EXPECT_GT(segmenter.estimate().model_generation, generation);
}

TEST(Segmenter, StagesTakeTime) {
  const auto frame = i420(plain());
  for (const Preset preset : {Preset::paper, Preset::standard}) {
    Segmenter segmenter(Settings::of(preset));
    ASSERT_TRUE(segmenter.process(frame.frame()).ok());
    const auto time_of = [&](Stage stage) {
      return segmenter.stage_times()[static_cast<std::size_t>(stage)];
    };
    for (Stage stage : {Stage::pyramid, Stage::prefilter, Stage::clustering, Stage::update, Stage::scoring,
                        Stage::boundary, Stage::mask}) {
      EXPECT_GT(time_of(stage), 0) << name_of(stage);
      EXPECT_NE(std::string(name_of(stage)), "");
    }
    // The paper's pipeline bins pixels, not cells, and knows no texture.
    EXPECT_EQ(time_of(Stage::features) > 0, preset == Preset::standard);
  }
}

TEST(Segmenter, EveryParameterOfThePaperWorksAtItsLimits) {
  const auto frame = i420(drive(320, 240, 0), 128, 96);
  for (int levels = -1; levels <= max_pyramid_levels; ++levels)
    for (int b = 0; b <= 7; ++b) {
      Settings settings = paper();
      settings.pyramid_levels = levels;
      settings.bit_shift = b;
      settings.training_models = 7;
      settings.learned_models = 8;
      settings.window_sigma_q8 = 1024;
      settings.match_threshold_q8 = 4096;
      settings.mass_cap = 1 << 20;
      settings.forget_shift = 15;
      Segmenter segmenter(settings);
      for (int i = 0; i < 2; ++i)
        ASSERT_TRUE(segmenter.process(frame.frame()).ok());
      EXPECT_FALSE(segmenter.estimate().flags & flag_unknown) << levels << " " << b;
    }
}

} // namespace
} // namespace terrainseg
