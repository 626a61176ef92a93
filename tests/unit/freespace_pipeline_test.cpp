// SPDX-License-Identifier: LGPL-2.1-or-later
// The default pipeline as a whole: what its settings do, and what must not change its answer.
#include "terrainseg/segmenter.hpp"

#include <algorithm>
#include <array>
#include <functional>
#include <random>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "exchange/model_file.hpp"
#include "scene/scene.hpp"

namespace terrainseg {
namespace {

using Bytes = std::vector<std::uint8_t>;

const scene::Settings trail{scene::Kind::trail, scene::Light::day, scene::Motion::straight, 3};

/// Some frames of one drive, rendered once.
const std::vector<scene::Picture>& drive() {
  static const std::vector<scene::Picture> pictures = [] {
    scene::Renderer renderer(trail, 320, 240);
    std::vector<scene::Picture> list;
    for (int k = 0; k < 6; ++k) {
      list.emplace_back(PixelFormat::I420, 320, 240);
      renderer.render(static_cast<std::uint64_t>(2 * k), list.back());
    }
    return list;
  }();
  return pictures;
}

Bytes mask_of(const Estimate& e) {
  Bytes bytes;
  for (int y = 0; y < e.mask.height; ++y)
    bytes.insert(bytes.end(), e.mask.plane.row(y), e.mask.plane.row(y) + e.mask.width);
  return bytes;
}

void run(Segmenter& segmenter, std::size_t first = 0, std::size_t end = 6) {
  for (std::size_t k = first; k < end; ++k)
    ASSERT_TRUE(segmenter.process(drive()[k].frame()).ok());
}

Segmenter after_drive(const Settings& settings) {
  Segmenter segmenter(settings);
  run(segmenter);
  return segmenter;
}

TEST(FreeSpacePipeline, FillsTheWholeEstimate) {
  const Segmenter s = after_drive({});
  const Estimate& e = s.estimate();
  EXPECT_EQ(e.frame, 5u);
  EXPECT_EQ(e.flags, flag_learned);
  EXPECT_EQ(e.model_generation, 6u);
  EXPECT_GT(e.horizon_row, 0);
  EXPECT_GT(e.horizon_confidence, 0);
  EXPECT_GT(e.confidence, 64);
  EXPECT_GE(e.model_count, 1);
  EXPECT_EQ(e.window, (Rectangle{112, 204, 96, 36}));
  const Bytes mask = mask_of(e);
  EXPECT_EQ(e.traversable_permille,
            std::count(mask.begin(), mask.end(), mask_traversable) * 1000 / static_cast<long>(mask.size()));
  ASSERT_EQ(e.boundary.size(), 320u);
  for (int x = 0; x < 320; ++x) {
    const int row = e.boundary[static_cast<std::size_t>(x)];
    ASSERT_LE(row, 240);
    // Free from there to the bottom, and no higher.
    for (int y = row; y < 240; ++y)
      ASSERT_EQ(mask[static_cast<std::size_t>(y * 320 + x)], mask_traversable);
    if (row > 0 && row < 240) {
      ASSERT_NE(mask[static_cast<std::size_t>((row - 1) * 320 + x)], mask_traversable);
    }
  }
}

TEST(FreeSpacePipeline, TheModelsAreTheGroundsColour) {
  const Segmenter s = after_drive({});
  const Estimate& e = s.estimate();
  long sum = 0;
  for (int y = e.window.y; y < e.window.y + e.window.height; ++y)
    for (int x = e.window.x; x < e.window.x + e.window.width; ++x)
      sum += (drive()[5].frame().planes[0].row(y)[x] - 16) * 255 / 219; // full range, as models are told
  const auto heaviest = std::max_element(e.models.begin(), e.models.begin() + e.model_count,
                                         [](const auto& a, const auto& b) { return a.mass < b.mass; });
  EXPECT_NEAR(heaviest->mean[0] / 256.0, static_cast<double>(sum) / (e.window.width * e.window.height), 12);
}

TEST(FreeSpacePipeline, ThreadsAndRepetitionChangeNothing) {
  Settings three;
  three.n_threads = 3;
  const Bytes one = mask_of(after_drive({}).estimate());
  EXPECT_EQ(mask_of(after_drive({}).estimate()), one);
  EXPECT_EQ(mask_of(after_drive(three).estimate()), one);
}

TEST(FreeSpacePipeline, ASmallerMaskIsTheSameMask) {
  const Bytes whole = mask_of(after_drive({}).estimate());
  for (const int level : {1, 2, 3, 5}) {
    Settings settings;
    settings.mask_level = level;
    const Segmenter s = after_drive(settings);
    const Estimate& e = s.estimate();
    ASSERT_EQ(e.mask.width, subsampled(320, level));
    for (int y = 0; y < e.mask.height; ++y)
      for (int x = 0; x < e.mask.width; ++x)
        ASSERT_EQ(e.mask.plane.row(y)[x], whole[static_cast<std::size_t>((y << level) * 320 + (x << level))]);
  }
}

/// The masks of a drive, one after the other.
Bytes masks_of_drive(const Settings& settings) {
  Segmenter segmenter(settings);
  Bytes bytes;
  for (std::size_t k = 0; k < drive().size(); ++k) {
    run(segmenter, k, k + 1);
    const Bytes mask = mask_of(segmenter.estimate());
    bytes.insert(bytes.end(), mask.begin(), mask.end());
  }
  return bytes;
}

TEST(FreeSpacePipeline, EveryStageCanBeSwitchedOffAndMatters) {
  const Bytes whole = masks_of_drive({});
  const std::vector<std::pair<const char*, std::function<void(Settings&)>>> changes{
      {"texture", [](Settings& s) { s.texture = false; }},
      {"exposure", [](Settings& s) { s.exposure = false; }},
      {"row-prior", [](Settings& s) { s.row_prior = false; }},
      {"local-reference", [](Settings& s) { s.local_reference = false; }},
      {"second-look", [](Settings& s) { s.second_look = false; }},
      {"connected-ground", [](Settings& s) { s.connected_ground = false; }},
      {"ground-behind", [](Settings& s) { s.ground_behind = false; }},
      {"upright", [](Settings& s) { s.upright = false; }},
      {"odd-spots", [](Settings& s) { s.odd_spots = false; }},
      {"refine", [](Settings& s) { s.refine = false; }},
      {"free-space", [](Settings& s) { s.free_space = false; }},
      {"negatives off", [](Settings& s) { s.negatives = Negatives::off; }},
      {"negatives split", [](Settings& s) { s.negatives = Negatives::split; }},
      {"doubtful", [](Settings& s) { s.doubtful = 40; }},
      {"temporal", [](Settings& s) { s.temporal = Temporal::off; }},
      {"caution", [](Settings& s) { s.caution = 20; }}};
  for (const auto& [name, change] : changes) {
    Settings settings;
    change(settings);
    ASSERT_FALSE(validate(settings));
    const Bytes mask = masks_of_drive(settings);
    EXPECT_TRUE(mask != whole) << name;
    for (const std::uint8_t m : mask)
      ASSERT_TRUE(m == 0 || m == 128 || m == 255) << name;
  }
  // In this drive upright edges leave nothing for it to change.
  Settings with, without;
  with.upright = without.upright = without.geodesic = false;
  EXPECT_TRUE(masks_of_drive(with) != masks_of_drive(without)) << "geodesic";
}

TEST(FreeSpacePipeline, MoreCautionIsLessGround) {
  int last = 1001;
  for (const int caution : {-100, -64, -32, -24, -16, -8, 0, 8, 16, 24, 32, 64, 100}) {
    Settings settings;
    settings.caution = caution;
    ASSERT_FALSE(validate(settings));
    const int now = after_drive(settings).estimate().traversable_permille;
    EXPECT_LE(now, last + 5) << caution; // the prior follows its own horizon: not strictly
    if (caution == -100) {
      EXPECT_GT(now, 500);
    }
    if (caution == 100) {
      EXPECT_LT(now, 50);
    }
    last = now;
  }
}

TEST(FreeSpacePipeline, DoubtfulIsOffFromItsFormerEndOn) {
  const auto masks = [](int doubtful) {
    Settings settings;
    settings.doubtful = doubtful;
    return masks_of_drive(settings);
  };
  const Bytes off = masks(-96);
  EXPECT_TRUE(masks(-97) == off);
  EXPECT_TRUE(masks(-100) == off);
  EXPECT_TRUE(masks(-24) != off);
}

TEST(FreeSpacePipeline, NothingAboveAHintIsGround) {
  Settings settings;
  settings.motion = Motion::off;
  settings.horizon_hint_q8 = 256 * 3 / 4;
  const Segmenter hinted = after_drive(settings);
  const Estimate& e = hinted.estimate();
  const int first = 240 * 3 / 4 - 240 / 32 - 8; // a cell has eight rows
  for (int y = 0; y < first; ++y)
    for (int x = 0; x < e.mask.width; ++x)
      ASSERT_NE(e.mask.plane.row(y)[x], mask_traversable) << y << ' ' << x;
  EXPECT_EQ(e.vanishing_row, -1) << "a hint is no measurement";
  const Bytes mask = mask_of(e);
  EXPECT_NE(std::count(mask.begin(), mask.end(), mask_traversable), 0);
  // What is known is surer than a hint.
  settings.vanishing_row = 60;
  const Segmenter known = after_drive(settings);
  settings.horizon_hint_q8 = -256;
  EXPECT_EQ(mask_of(known.estimate()), mask_of(after_drive(settings).estimate()));
}

TEST(FreeSpacePipeline, HorizonModes) {
  Settings settings;
  settings.horizon = HorizonMode::off;
  EXPECT_EQ(after_drive(settings).estimate().horizon_row, -1);
  settings.horizon = HorizonMode::paper;
  const Segmenter s = after_drive(settings);
  const Estimate& e = s.estimate();
  const Bytes mask = mask_of(e);
  ASSERT_GT(e.horizon_row, 0);
  // The refinement may move the curve by a cell.
  for (int i = 0; i < (e.horizon_row - 8) * 320; ++i)
    ASSERT_EQ(mask[static_cast<std::size_t>(i)], 0);
}

TEST(FreeSpacePipeline, AHorizonIsHeldOverFramesThatShowNone) {
  // A view of nothing but sky: the upper eighth of the last frame, stretched over the picture.
  scene::Picture sky = drive()[5];
  const Frame source = drive()[5].frame();
  const MutableFrame target = sky.mutable_frame();
  for (std::size_t p = 0; p < 3; ++p)
    for (int y = 0; y < (p == 0 ? 240 : 120); ++y)
      std::copy_n(source.planes[p].row(y / 8), p == 0 ? 320 : 160, target.planes[p].row(y));
  for (const Temporal temporal : {Temporal::on, Temporal::off}) {
    Settings settings;
    settings.temporal = temporal;
    Segmenter s = after_drive(settings);
    ASSERT_GT(s.estimate().horizon_row, 0);
    settings.near_clear = false;
    s.configure(settings);
    bool held = false;
    for (int k = 0; k < 12 && !held; ++k) {
      const Estimate before = s.estimate();
      ASSERT_TRUE(s.process(sky.frame()).ok());
      const Estimate& e = s.estimate();
      held = e.flags & flag_horizon_held;
      if (held) {
        EXPECT_EQ(e.horizon_row, before.horizon_row);
        EXPECT_EQ(e.horizon_confidence, before.horizon_confidence / 2);
      }
    }
    EXPECT_EQ(held, temporal == Temporal::on);
  }
}

TEST(FreeSpacePipeline, NothingIsLearnedWhileTheWindowIsNotClear) {
  Segmenter s = after_drive({});
  const Terrain before = s.terrain();
  const int confidence = s.estimate().confidence;
  Settings settings;
  settings.near_clear = false;
  s.configure(settings);
  run(s, 4, 6);
  const Terrain after = s.terrain();
  EXPECT_EQ(after.models, before.models);
  EXPECT_EQ(after.negative_colors, before.negative_colors);
  EXPECT_EQ(after.terrain_texture, before.terrain_texture);
  EXPECT_EQ(s.estimate().flags & (flag_learned | flag_frozen | flag_unknown), flag_frozen);
  EXPECT_LT(s.estimate().confidence, confidence * 3 / 4);
  EXPECT_EQ(s.counters().skipped_near, 2u);
}

TEST(FreeSpacePipeline, AnIgnoredWindowSaysNothingAgainstWhatWasLearned) {
  const Segmenter teacher = after_drive({});
  Settings settings;
  settings.ignore_regions = {{0, 170, 320, 70}};
  Segmenter s(settings);
  ASSERT_TRUE(s.adopt(teacher.terrain()).ok());
  run(s, 4, 6);
  EXPECT_EQ(s.estimate().flags & (flag_learned | flag_unknown), 0u);
  EXPECT_GT(s.estimate().confidence, teacher.estimate().confidence / 3);
}

// Boxes around cells are higher than such a frame.
TEST(FreeSpacePipeline, FramesMayBeOfAFewRows) {
  std::mt19937 random(5);
  for (const int height : {1, 2, 3, 4, 5, 8, 17, 40}) {
    scene::Picture picture(PixelFormat::I420, 1600, height);
    const MutableFrame frame = picture.mutable_frame();
    Segmenter s({});
    for (int k = 0; k < 3; ++k) {
      for (int y = 0; y < height; ++y)
        for (int x = 0; x < 1600; ++x)
          frame.planes[0].row(y)[x] = static_cast<std::uint8_t>(random() % 40 + (x % 97 == 0 ? 180 : 90));
      ASSERT_TRUE(s.process(picture.frame()).ok()) << height;
      EXPECT_EQ(s.estimate().mask.height, height);
    }
  }
}

TEST(FreeSpacePipeline, WhatWasLearnedGoesToAnother) {
  Settings frozen;
  frozen.learning = false;
  frozen.temporal = Temporal::off;
  Segmenter teacher = after_drive({});
  teacher.configure(frozen);
  teacher.reset_temporal();
  Segmenter pupil(frozen);
  run(pupil, 5);
  EXPECT_TRUE(pupil.estimate().flags & flag_unknown);
  ASSERT_TRUE(pupil.adopt(teacher.terrain()).ok());
  run(teacher, 5);
  run(pupil, 5);
  EXPECT_EQ(mask_of(pupil.estimate()), mask_of(teacher.estimate()));
}

TEST(FreeSpacePipeline, IgnoredPartsAreNeitherLearnedNorLabelled) {
  // A poster in the window's colour space far away from the ground's: learned unless it is ignored.
  scene::Picture picture = drive()[5];
  const MutableFrame frame = picture.mutable_frame();
  const Rectangle poster{140, 204, 68, 36};
  for (int y = poster.y / 2; y < (poster.y + poster.height) / 2; ++y)
    for (int x = poster.x / 2; x < (poster.x + poster.width) / 2; ++x)
      frame.planes[2].row(y)[x] = 250;
  const auto redness = [&](bool ignore) {
    Settings settings;
    if (ignore)
      settings.ignore_regions = {poster};
    Segmenter s(settings);
    for (int k = 0; k < 3; ++k)
      EXPECT_TRUE(s.process(picture.frame()).ok());
    if (ignore) {
      for (int y = poster.y; y < poster.y + poster.height; ++y)
        for (int x = poster.x; x < poster.x + poster.width; ++x)
          EXPECT_EQ(s.estimate().mask.plane.row(y)[x], mask_doubtful);
    }
    int most = 0;
    for (int m = 0; m < s.estimate().model_count; ++m)
      most = std::max(most, s.estimate().models[static_cast<std::size_t>(m)].mean[2] / 256);
    return most;
  };
  EXPECT_GT(redness(false), redness(true) + 10);
}

TEST(FreeSpacePipeline, AnotherSizeKeepsTheTerrain) {
  Segmenter s = after_drive({});
  scene::Renderer renderer(trail, 161, 119);
  scene::Picture small(PixelFormat::I420, 161, 119);
  renderer.render(12, small);
  Settings settings;
  settings.learning = false;
  s.configure(settings);
  ASSERT_TRUE(s.process(small.frame()).ok());
  EXPECT_FALSE(s.estimate().flags & flag_unknown);
  EXPECT_EQ(s.estimate().mask.width, 161);
  EXPECT_GT(s.estimate().traversable_permille, 150);
  run(s, 0, 1);
  EXPECT_EQ(s.estimate().mask.width, 320);
  s.reset();
  run(s, 0, 1);
  EXPECT_TRUE(s.estimate().flags & flag_unknown);
}

/// The first row of the mask with ground.
int first_row_of_ground(const Estimate& e) {
  const Bytes mask = mask_of(e);
  const auto found = std::find(mask.begin(), mask.end(), mask_traversable);
  return static_cast<int>(found - mask.begin()) / e.mask.width;
}

// Motion's line is part of the terrain: it survives stops, cuts, and a terrain that goes from one filter to
// the next.
TEST(FreeSpacePipeline, TheLineOfMotionIsKeptWithTheTerrain) {
  const Settings settings;
  Terrain learned = after_drive(settings).terrain();
  EXPECT_EQ(learned.line, KeptLine{}) << "six frames tell motion nothing";
  const auto first_row = [](const Terrain& terrain, const Settings& set, const scene::Picture& picture) {
    Segmenter segmenter(set);
    EXPECT_TRUE(segmenter.adopt(terrain).ok());
    EXPECT_TRUE(segmenter.process(picture.frame()).ok());
    return first_row_of_ground(segmenter.estimate());
  };
  const int without = first_row(learned, settings, drive()[5]);
  learned.line = {320, 240, 180 << 8};
  const int with = first_row(learned, settings, drive()[5]);
  EXPECT_LT(without, 130);
  EXPECT_GE(with, 160);

  Segmenter segmenter(settings);
  ASSERT_TRUE(segmenter.adopt(learned).ok());
  run(segmenter);
  EXPECT_EQ(segmenter.terrain().line, learned.line);
  segmenter.reset_temporal(); // a cut
  ASSERT_TRUE(segmenter.process(drive()[0].frame()).ok());
  EXPECT_GE(first_row_of_ground(segmenter.estimate()), 160);
  for (int i = 0; i < 3; ++i) // a stop
    ASSERT_TRUE(segmenter.process(drive()[0].frame()).ok());
  EXPECT_GE(first_row_of_ground(segmenter.estimate()), 160);
  segmenter.reset();
  run(segmenter, 0, 1);
  EXPECT_EQ(segmenter.terrain().line, KeptLine{});
  EXPECT_LT(first_row_of_ground(segmenter.estimate()), 130);

  // Another mount does not take it.
  Settings told;
  told.vanishing_row = 60;
  Terrain bare = learned;
  bare.line = {};
  EXPECT_EQ(first_row(learned, told, drive()[5]), first_row(bare, told, drive()[5]));
  Settings still;
  still.motion = Motion::off;
  EXPECT_EQ(first_row(learned, still, drive()[5]), first_row(bare, still, drive()[5]));
  scene::Renderer renderer(trail, 336, 240);
  scene::Picture wider(PixelFormat::I420, 336, 240);
  renderer.render(10, wider);
  EXPECT_EQ(first_row(learned, settings, wider), first_row(bare, settings, wider));
}

TEST(FreeSpacePipeline, MotionFillsTheKeptLine) {
  scene::Renderer renderer({scene::Kind::plain, scene::Light::day, scene::Motion::straight, 101}, 320, 180);
  scene::Picture picture(PixelFormat::I420, 320, 180);
  Segmenter segmenter{Settings{}};
  for (std::uint64_t k = 0; k < 150; ++k) {
    renderer.render(k, picture);
    Frame frame = picture.frame();
    frame.pts = static_cast<std::int64_t>(k * 1'000'000'000 / 30);
    ASSERT_TRUE(segmenter.process(frame).ok());
  }
  const auto loaded = parse_terrain(serialize_terrain(segmenter.terrain())).terrain;
  ASSERT_TRUE(loaded);
  const KeptLine line = loaded->line;
  EXPECT_EQ(line.width, 320);
  EXPECT_EQ(line.height, 180);
  ASSERT_GE(segmenter.estimate().vanishing_row, 0);
  EXPECT_EQ(static_cast<int>(line.row_q8), segmenter.estimate().vanishing_row >> 8);
}

/// Another place: all but the lower quarter upside down.
scene::Picture cut_to(const scene::Picture& picture) {
  scene::Picture other = picture;
  const Frame from = picture.frame();
  const MutableFrame to = other.mutable_frame();
  for (std::size_t p = 0; p < 3; ++p) {
    const int width = p == 0 ? 320 : 160, height = p == 0 ? 240 : 120;
    for (int y = 0; y < height; ++y)
      for (int x = 0; x < width; ++x)
        to.planes[p].row(y)[x] = from.planes[p].row(y < height * 3 / 4 ? height - 1 - y : y)[x];
  }
  return other;
}

// The boundary of another place says nothing of this one's ground.
TEST(FreeSpacePipeline, NegativesAreSplitByTheSamePlacesBoundaryOnly) {
  const scene::Picture other = cut_to(drive()[5]);
  for (const Temporal temporal : {Temporal::automatic, Temporal::off}) {
    Settings split;
    split.negatives = Negatives::split;
    split.temporal = temporal;
    Segmenter cut = after_drive(split), fresh = after_drive(split);
    fresh.reset_temporal();
    ASSERT_TRUE(cut.process(other.frame()).ok());
    ASSERT_TRUE(fresh.process(other.frame()).ok());
    EXPECT_TRUE(cut.terrain().negative_colors == fresh.terrain().negative_colors);
    // Where the place stays the same it does.
    Segmenter on = after_drive(split), off = after_drive(split);
    off.reset_temporal();
    ASSERT_TRUE(on.process(drive()[5].frame()).ok());
    ASSERT_TRUE(off.process(drive()[5].frame()).ok());
    EXPECT_TRUE(on.terrain().negative_colors != off.terrain().negative_colors);
  }
}

// Each detector alone, on a plain with stones: what one switch leaves out another does not find.
TEST(FreeSpacePipeline, EachDetectorHasASwitchOfItsOwn) {
  scene::Renderer renderer({scene::Kind::plain, scene::Light::day, scene::Motion::straight, 101}, 640, 360);
  scene::Picture picture(PixelFormat::I420, 640, 360);
  renderer.render(40, picture);
  const auto doubtful_with = [&](bool near, bool far, bool stones, bool any = true) {
    Settings settings;
    settings.near_spots = near;
    settings.far_spots = far;
    settings.stone_field = stones;
    settings.odd_spots = any;
    settings.doubtful = -96; // so that nothing else is
    Segmenter segmenter(settings);
    EXPECT_TRUE(segmenter.process(picture.frame()).ok());
    EXPECT_TRUE(segmenter.process(picture.frame()).ok());
    const Bytes mask = mask_of(segmenter.estimate());
    return std::count(mask.begin(), mask.end(), mask_doubtful);
  };
  const auto none = doubtful_with(false, false, false), near = doubtful_with(true, false, false),
             far = doubtful_with(false, true, false), all = doubtful_with(true, true, true);
  EXPECT_EQ(none, 0);
  EXPECT_GT(near, 0);
  EXPECT_GT(far, 0);
  EXPECT_GE(all, std::max(near, far));
  EXPECT_LE(all, near + far + doubtful_with(false, false, true));
  EXPECT_EQ(doubtful_with(true, true, true, false), 0);
}

/// Pixels that one detector alone calls doubtful, per frame: 6 frames of a plain without stones, 4 with
/// them, 4 without. `pts` are the frames' times in milliseconds, -1 = unknown; every second frame looks
/// `jolt` rows farther down.
std::vector<long> doubtful_of(bool near, bool far, const std::function<int(int)>& pts,
                              Temporal temporal = Temporal::automatic, int jolt = 0) {
  constexpr int highest_jolt = 8;
  static const std::array<scene::Picture, 2> pictures = [] {
    constexpr int rows = 360 + highest_jolt;
    std::array<scene::Picture, 2> both{scene::Picture(PixelFormat::I420, 640, rows),
                                       scene::Picture(PixelFormat::I420, 640, rows)};
    for (const int stony : {0, 1})
      scene::Renderer({scene::Kind::plain, scene::Light::day, scene::Motion::straight, 101, 40 * stony}, 640,
                      rows)
          .render(40, both[static_cast<std::size_t>(stony)]);
    return both;
  }();
  Settings settings;
  settings.near_spots = near;
  settings.far_spots = far;
  settings.stone_field = false;
  settings.motion = Motion::off;
  settings.temporal = temporal;
  settings.doubtful = -96;
  Segmenter segmenter(settings);
  std::vector<long> counts;
  for (int k = 0; k < 14; ++k) {
    Frame frame = pictures[k >= 6 && k < 10].frame();
    frame.pts = std::int64_t{pts(k)} * 1'000'000;
    frame.height = 360;
    for (std::size_t p = 0; p < 3; ++p)
      frame.planes[p].data = frame.planes[p].row(k % 2 * jolt / (p == 0 ? 1 : 2));
    EXPECT_TRUE(segmenter.process(frame).ok());
    const Bytes mask = mask_of(segmenter.estimate());
    counts.push_back(std::count(mask.begin(), mask.end(), mask_doubtful));
  }
  return counts;
}

/// The frames, from the one with the first stones on, in which a detector's answer begins and ends.
std::pair<int, int> seen_in(const std::vector<long>& counts) {
  const long most = *std::max_element(counts.begin() + 6, counts.begin() + 10);
  EXPECT_GT(most, 400);
  EXPECT_LT(*std::max_element(counts.begin(), counts.begin() + 6), most / 8);
  const auto from = std::find_if(counts.begin() + 6, counts.end(), [&](long n) { return n > most / 2; });
  const auto end = std::find_if(from, counts.end(), [&](long n) { return n <= most / 2; });
  return {static_cast<int>(from - counts.begin()) - 6, static_cast<int>(end - counts.begin()) - 6};
}

TEST(FreeSpacePipeline, SpotsNearByAndFarAwayTakeTurnsInQuickFrames) {
  using Ends = std::pair<int, int>;
  const Ends at_once{0, 4}, later{1, 5};
  for (const int interval : {44, 33, 16}) {
    const auto quick = [=](int k) { return k * interval; };
    const Ends near = seen_in(doubtful_of(true, false, quick)),
               far = seen_in(doubtful_of(false, true, quick));
    EXPECT_TRUE((near == at_once && far == later) || (near == later && far == at_once)) << interval;
    const auto shifted = [=](int k) { return k == 0 ? 0 : 1000 + k * interval; };
    EXPECT_EQ(seen_in(doubtful_of(true, false, shifted)), near) << "a late frame changes no turn";
  }
  const auto everywhere = [&](const char* what, const std::function<int(int)>& pts,
                              Temporal temporal = Temporal::automatic, int jolt = 0) {
    EXPECT_EQ(seen_in(doubtful_of(true, false, pts, temporal, jolt)), at_once) << what;
    EXPECT_EQ(seen_in(doubtful_of(false, true, pts, temporal, jolt)), at_once) << what;
  };
  everywhere(
      "on bumps", [](int k) { return k * 20; }, Temporal::automatic, 8);
  everywhere("15 Hz", [](int k) { return k * 66; });
  everywhere("45 ms", [](int k) { return k * 45; });
  everywhere("without times", [](int) { return -1; });
  everywhere("backwards", [](int k) { return 1000 - k; });
  everywhere("late where the stones come and go",
             [](int k) { return k * 20 + (k >= 6) * 50 + (k >= 10) * 50; });
  everywhere(
      "each frame for itself", [](int k) { return k * 20; }, Temporal::off);
}

TEST(FreeSpacePipeline, ADetectorThatIsSwitchedOffIsSilentAtOnce) {
  scene::Picture picture(PixelFormat::I420, 640, 360);
  scene::Renderer({scene::Kind::plain, scene::Light::day, scene::Motion::straight, 101}, 640, 360)
      .render(40, picture);
  for (const int before : {4, 5}) { // in turn of the one or the other
    Settings settings;
    settings.doubtful = -96;
    settings.motion = Motion::off;
    Segmenter segmenter(settings);
    Frame frame = picture.frame();
    const auto doubtful = [&](int k) {
      frame.pts = std::int64_t{k} * 33'000'000;
      EXPECT_TRUE(segmenter.process(frame).ok());
      const Bytes mask = mask_of(segmenter.estimate());
      return std::count(mask.begin(), mask.end(), mask_doubtful);
    };
    long last = 0;
    for (int k = 0; k < before; ++k)
      last = doubtful(k);
    EXPECT_GT(last, 400);
    settings.odd_spots = false;
    segmenter.configure(settings);
    EXPECT_EQ(doubtful(before), 0);
  }
}

} // namespace
} // namespace terrainseg
