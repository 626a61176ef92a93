// SPDX-License-Identifier: LGPL-2.1-or-later
// The default pipeline on rendered scenes with their truth: limits on its error, the same answer whatever the
// size and format, and a confidence that means something. Limits are measured figures with a margin; the
// scenes were never tuned on.
#include <algorithm>
#include <cmath>
#include <numeric>
#include <vector>

#include <gtest/gtest.h>

#include "scene/scene.hpp"
#include "support/frames.hpp"
#include "terrainseg/segmenter.hpp"

namespace terrainseg {
namespace {

using scene::Kind;
using scene::Light;
using scene::Motion;

struct Score {
  double error = 0;   ///< percent of the labelled pixels; ground = labels 1 and 2
  double unsafe = 0;  ///< percent of what is no ground that is called traversable
  double horizon = 0; ///< median distance to the first row of ground, percent of the height
  std::vector<double> errors, confidences;
};

bool is_ground(int label) {
  return label == scene::driven_terrain || label == scene::other_traversable;
}

// Pixels of a frame or of several.
struct Count {
  long ground = 0, other = 0, missed = 0, unsafe = 0;

  void add(const Estimate& e, const GrayView& labels) {
    for (int y = 0; y < labels.height; ++y) {
      const std::uint8_t *label = labels.plane.row(y), *mask = e.mask.plane.row(y);
      for (int x = 0; x < labels.width; ++x) {
        if (label[x] == scene::not_labelled)
          continue;
        const bool is = is_ground(label[x]), said = mask[x] == mask_traversable;
        ++(is ? ground : other);
        missed += is && !said;
        unsafe += !is && said;
      }
    }
  }
  double error_percent() const {
    return 100.0 * static_cast<double>(missed + unsafe) / static_cast<double>(ground + other);
  }
  double unsafe_percent() const {
    return 100.0 * static_cast<double>(unsafe) / static_cast<double>(std::max(other, 1L));
  }
};

double error_of(const Estimate& e, const GrayView& labels) {
  Count count;
  count.add(e, labels);
  return count.error_percent();
}

int first_ground_row(const GrayView& labels) {
  for (int y = 0; y < labels.height; ++y) {
    const std::uint8_t* row = labels.plane.row(y);
    if (50 * std::count_if(row, row + labels.width, is_ground) >= labels.width)
      return y;
  }
  return -1;
}

Score drive(const scene::Settings& world, int frames = 16, int stride = 6, const Settings& settings = {},
            int taught_rows = 0) {
  scene::Renderer renderer(world, 320, 240);
  scene::Picture picture(PixelFormat::I420, 320, 240);
  Segmenter segmenter(settings);
  Score score;
  Count count;
  std::vector<double> horizons;
  for (int k = 0; k < frames; ++k) {
    renderer.render(static_cast<std::uint64_t>(k * stride), picture);
    // A range sensor's training pixels: the floor from the bottom up to so many rows.
    Supervision floor;
    std::vector<std::uint8_t> trains;
    if (taught_rows > 0) {
      const GrayView labels = picture.labels();
      for (int y = 0; y < labels.height; ++y)
        for (int x = 0; x < labels.width; ++x)
          trains.push_back(y >= labels.height - taught_rows && is_ground(labels.plane.row(y)[x]) ? 255 : 0);
      floor.mask = {{trains.data(), labels.width}, labels.width, labels.height};
    }
    EXPECT_TRUE(segmenter.process(picture.frame(), floor).ok());
    const Estimate& e = segmenter.estimate();
    if (k < 2)
      continue;
    count.add(e, picture.labels());
    score.errors.push_back(error_of(e, picture.labels()));
    score.confidences.push_back(e.confidence);
    const int truth = first_ground_row(picture.labels());
    if (truth >= 0 && e.horizon_row >= 0)
      horizons.push_back(100.0 * std::abs(truth - e.horizon_row) / 240);
  }
  score.error = std::accumulate(score.errors.begin(), score.errors.end(), 0.0) /
                static_cast<double>(score.errors.size());
  score.unsafe = count.unsafe_percent();
  std::sort(horizons.begin(), horizons.end());
  score.horizon = horizons.empty() ? 100 : horizons[horizons.size() / 2];
  return score;
}

struct Case {
  const char* name;
  scene::Settings world;
  double error_limit, unsafe_limit, horizon_limit;
};

class SceneAccuracy : public testing::TestWithParam<Case> {};

TEST_P(SceneAccuracy, StaysWithinItsLimits) {
  const Case& c = GetParam();
  const Score score = drive(c.world);
  RecordProperty("error_percent", std::to_string(score.error));
  RecordProperty("unsafe_percent", std::to_string(score.unsafe));
  RecordProperty("horizon_percent", std::to_string(score.horizon));
  EXPECT_LE(score.error, c.error_limit);
  EXPECT_LE(score.unsafe, c.unsafe_limit);
  EXPECT_LE(score.horizon, c.horizon_limit);
}

INSTANTIATE_TEST_SUITE_P(
    Scenes, SceneAccuracy,
    testing::Values(Case{"road_day",
                         {Kind::road, Light::day, Motion::straight, 1},
                         6.5,
                         1.5,
                         4.5}, // verges are ground now
                    Case{
                        "road_shadow", {Kind::road, Light::day, Motion::straight, 3}, 14, 9, 1.8}, // of trees
                    Case{"road_dusk", {Kind::road, Light::dusk, Motion::straight, 1}, 6, 3, 2.5},
                    // The verges, traversable as they are, are another terrain than the window's. Ground that
                    // is joined to the window brings some low things with it.
                    Case{"road_turn", {Kind::road, Light::day, Motion::turn, 2}, 16, 5.8, 5.2},
                    Case{"trail_day", {Kind::trail, Light::day, Motion::straight, 1}, 6, 4.5, 2},
                    Case{"trail_bumpy", {Kind::trail, Light::day, Motion::bumpy, 2}, 2.5, 1.2, 1.2},
                    Case{"trail_drift", {Kind::trail, Light::drift, Motion::straight, 2}, 2.5, 1.2, 1.8},
                    Case{"corridor_day", {Kind::corridor, Light::day, Motion::straight, 1}, 1.5, 0.5, 6},
                    Case{"corridor_dusk", {Kind::corridor, Light::dusk, Motion::straight, 2}, 3.1, 4, 11.5},
                    Case{"plain_day", {Kind::plain, Light::day, Motion::straight, 1}, 1.6, 2.2, 1.2},
                    // Rocks of the sand's own colour, everywhere.
                    Case{"plain_rocks", {Kind::plain, Light::day, Motion::turn, 3, 100}, 5, 7.5, 1.2},
                    Case{"plain_dusk", {Kind::plain, Light::dusk, Motion::turn, 2}, 2.8, 4, 1.2},
                    Case{"plain_bumpy", {Kind::plain, Light::day, Motion::bumpy, 1}, 1.6, 2, 1.2}),
    [](const auto& info) { return std::string(info.param.name); });

// Hills of the ground's colour begin without an edge; the plane that motion fits ends at their foot.
TEST(Motion, EndsTheGroundAtItsVanishingLine) {
  scene::Renderer renderer({Kind::plain, Light::day, Motion::straight, 101}, 640, 360);
  scene::Picture picture(PixelFormat::I420, 640, 360);
  Settings off;
  off.motion = terrainseg::Motion::off;
  Segmenter without(off), with{Settings()};
  Count unknown, told;
  for (std::uint64_t k = 0; k < 90; ++k) {
    renderer.render(k, picture);
    EXPECT_TRUE(without.process(picture.frame()).ok());
    EXPECT_TRUE(with.process(picture.frame()).ok());
    if (k < 70) // it takes a while until the line is known
      continue;
    unknown.add(without.estimate(), picture.labels());
    told.add(with.estimate(), picture.labels());
  }
  RecordProperty("unsafe_percent_without", std::to_string(unknown.unsafe_percent()));
  RecordProperty("unsafe_percent_with", std::to_string(told.unsafe_percent()));
  EXPECT_GT(unknown.unsafe_percent(), 20); // 23.0
  EXPECT_LT(told.unsafe_percent(), 5);     // 3.7
}

// The window comes from the sun into the shade of trees, and all beyond is another ground: what is lost must
// not stay lost because the horizon went down with it.
TEST(Motion, FindsTheGroundBeyondAChangeOfLightAgain) {
  scene::Renderer renderer({Kind::trail, Light::day, Motion::straight, 220}, 480, 270);
  scene::Picture picture(PixelFormat::I420, 480, 270);
  Segmenter segmenter{Settings()};
  Count lost, found;
  for (std::uint64_t k = 0; k < 68; ++k) {
    renderer.render(k, picture);
    EXPECT_TRUE(segmenter.process(picture.frame()).ok());
    if (k >= 60)
      (k < 62 ? lost : found).add(segmenter.estimate(), picture.labels());
  }
  RecordProperty("error_percent_lost", std::to_string(lost.error_percent()));
  RecordProperty("error_percent_found", std::to_string(found.error_percent()));
  EXPECT_GT(lost.error_percent(), 30);
  EXPECT_LT(found.error_percent(),
            28); // 26.3, without `upright` 18.8; 36.7 where the prior follows the boundary alone
}

// A trail in a low sun: shadows of trees lie across the whole of it.
TEST(LightAhead, FindsTheGroundBeyondShadows) {
  Settings without;
  without.light_ahead = false;
  double with_it = 0, without_it = 0;
  for (const std::uint32_t seed : {201u, 203u, 204u}) {
    const scene::Settings world{Kind::trail, Light::sun, Motion::straight, seed};
    with_it += drive(world).error / 3;
    without_it += drive(world, 16, 6, without).error / 3;
  }
  RecordProperty("error_percent", std::to_string(with_it));
  RecordProperty("error_percent_without", std::to_string(without_it));
  EXPECT_LT(with_it, 0.92 * without_it) << without_it; // 13.2 and 14.8
}

// An orange box beside the road, as smooth as the road and cut by the picture's lower edge.
TEST(VividThings, AreNoGround) {
  scene::Renderer renderer({Kind::road, Light::day, Motion::straight, 207}, 640, 360);
  scene::Picture picture(PixelFormat::I420, 640, 360);
  Segmenter segmenter{Settings()};
  Count count;
  for (std::uint64_t k = 0; k < 76; ++k) {
    renderer.render(k, picture);
    EXPECT_TRUE(segmenter.process(picture.frame()).ok());
    if (k >= 70)
      count.add(segmenter.estimate(), picture.labels());
  }
  RecordProperty("unsafe_percent", std::to_string(count.unsafe_percent()));
  EXPECT_LT(count.unsafe_percent(), 4.5); // 3.5; 5.7 where texture makes up for any colour
}

// 3.9 % with the prior for ground that a window needs.
TEST(Supervision, OfMostOfTheGroundIsSafe) {
  const Score score = drive({Kind::corridor, Light::dusk, Motion::straight, 2}, 16, 6, {}, 150);
  EXPECT_LE(score.error, 3);
  EXPECT_LE(score.unsafe, 3);
}

// The mask after a few frames of the same moment, as a share of pixels that agree with another's.
class Answer {
 public:
  Answer(const scene::Settings& world, PixelFormat format, int width, int height)
      : width_(width), height_(height) {
    const ColorRange range = layout_of(format).rgb ? ColorRange::full : ColorRange::limited;
    scene::Renderer renderer(world, width, height);
    scene::Picture picture(format, width, height, {range, ColorMatrix::bt601});
    Segmenter segmenter{Settings()};
    renderer.render(30, picture);
    for (int k = 0; k < 3; ++k)
      EXPECT_TRUE(segmenter.process(picture.frame()).ok());
    const Estimate& e = segmenter.estimate();
    for (int y = 0; y < height; ++y)
      mask_.insert(mask_.end(), e.mask.plane.row(y), e.mask.plane.row(y) + width);
    horizon = static_cast<double>(e.horizon_row) / height;
    free = e.traversable_permille;
  }
  double agreement(const Answer& other) const {
    long same = 0;
    for (int y = 0; y < height_; ++y)
      for (int x = 0; x < width_; ++x)
        same += (mask_[static_cast<std::size_t>(y) * width_ + x] == 255) ==
                (other.mask_[static_cast<std::size_t>(y * other.height_ / height_) * other.width_ +
                             x * other.width_ / width_] == 255);
    return 100.0 * static_cast<double>(same) / width_ / height_;
  }
  double horizon = 0;
  int free = 0;

 private:
  int width_, height_;
  std::vector<std::uint8_t> mask_;
};

TEST(SameScene, FourSizesGiveOneAnswer) {
  for (const Kind kind : {Kind::trail, Kind::plain}) {
    const scene::Settings world{kind, Light::day, Motion::straight, 3};
    const Answer reference(world, PixelFormat::I420, 640, 360);
    for (const auto& [w, h] : {std::pair{192, 108}, {1280, 720}, {3840, 2160}}) {
      const Answer a(world, PixelFormat::I420, w, h);
      // Small frames show other links of ground than large ones.
      EXPECT_GE(reference.agreement(a), w < 640 ? 89.5 : 94.5) << w;
      EXPECT_NEAR(a.horizon, reference.horizon, w < 640 ? 0.1 : 0.01) << w;
    }
  }
}

TEST(SameScene, AllFormatsGiveOneAnswer) {
  for (const Kind kind : {Kind::road, Kind::trail, Kind::plain}) {
    const scene::Settings world{kind, Light::day, Motion::straight, 2};
    const Answer reference(world, PixelFormat::I420, 480, 270);
    for (const PixelFormat format : {PixelFormat::NV12, PixelFormat::Y444, PixelFormat::YUY2,
                                     PixelFormat::RGB, PixelFormat::BGRx, PixelFormat::ARGB}) {
      const Answer a(world, format, 480, 270);
      EXPECT_GE(reference.agreement(a), 96.0) << static_cast<int>(format);
      EXPECT_NEAR(a.horizon, reference.horizon, 0.02);
    }
  }
}

double rank_correlation(const std::vector<double>& a, const std::vector<double>& b) {
  const auto ranks = [](const std::vector<double>& v) {
    std::vector<double> r;
    for (const double x : v) // the middle of equals
      r.push_back(static_cast<double>(std::count_if(v.begin(), v.end(), [x](double y) { return y < x; })) +
                  static_cast<double>(std::count(v.begin(), v.end(), x)) / 2);
    return r;
  };
  const auto x = ranks(a), y = ranks(b);
  const double mean = static_cast<double>(x.size()) / 2;
  double xy = 0, xx = 0, yy = 0;
  for (std::size_t i = 0; i < x.size(); ++i) {
    xy += (x[i] - mean) * (y[i] - mean);
    xx += (x[i] - mean) * (x[i] - mean);
    yy += (y[i] - mean) * (y[i] - mean);
  }
  return xy / std::sqrt(xx * yy);
}

TEST(Confidence, FallsWhereTheErrorGrows) {
  std::vector<double> errors, confidences;
  for (const Kind kind : {Kind::road, Kind::trail, Kind::corridor, Kind::plain})
    for (const Light light : {Light::day, Light::dusk, Light::drift})
      for (const std::uint32_t seed : {1, 2, 4, 6, 8, 9}) { // easy places and some with walls like the floor
        const Score score = drive({kind, light, Motion::straight, seed}, 6, 25);
        errors.insert(errors.end(), score.errors.begin(), score.errors.end());
        confidences.insert(confidences.end(), score.confidences.begin(), score.confidences.end());
      }
  const double correlation = rank_correlation(errors, confidences);
  RecordProperty("rank_correlation", std::to_string(correlation));
  EXPECT_LT(correlation, -0.3); // measured -0.38 over four kinds of place; most of the errors are grass
}

// What no label tells: situations in which nothing should be believed. A drive over noisy ground, then
// `after`.
class Situation {
 public:
  explicit Situation(const test::Painter& after, int frames = 3, bool near_clear = true) {
    const test::OwnedFrame ground(PixelFormat::I420, 320, 240, road),
        then(PixelFormat::I420, 320, 240, after);
    for (int k = 0; k < 10; ++k)
      EXPECT_TRUE(segmenter_.process(ground.frame()).ok());
    before = segmenter_.estimate();
    Settings settings;
    settings.near_clear = near_clear;
    segmenter_.configure(settings);
    for (int k = 0; k < frames; ++k)
      EXPECT_TRUE(segmenter_.process(then.frame()).ok());
    now = segmenter_.estimate();
  }
  static test::Components road(int x, int y) {
    if (y < 96)
      return {static_cast<std::uint8_t>(190 + test::noise_at(x / 3, y / 3, 5, 5)), 140, 116};
    return {static_cast<std::uint8_t>(90 + test::noise_at(x, y, 0, 4)), 120, 134};
  }
  Estimate before, now;

 private:
  Segmenter segmenter_{Settings()};
};

TEST(NothingToBelieve, TheDriveBeforehandIsBelieved) {
  const Situation s(Situation::road);
  EXPECT_GT(s.before.confidence, 128);
  EXPECT_NEAR(s.before.horizon_row, 96, 4);
  EXPECT_EQ(s.now.flags, flag_learned);
}

TEST(NothingToBelieve, ALensCap) {
  const Situation s([](int x, int y) {
    return test::Components{static_cast<std::uint8_t>(16 + test::noise_at(x, y, 2, 1)), 128, 128};
  });
  EXPECT_TRUE(s.now.flags & flag_unknown);
  EXPECT_TRUE(s.now.flags & flag_blocked);
  EXPECT_EQ(s.now.horizon_row, -1);
  EXPECT_EQ(s.now.confidence, 0);
}

test::Components wall(int x, int y) {
  return {static_cast<std::uint8_t>(150 + test::noise_at(x / 2, y / 2, 3, 5)), 118, 140};
}

// One that fills the view looks like a plain that does: after a second it is learned as one, unless the
// near-range sensor says what it is.
TEST(NothingToBelieve, AWall) {
  const Situation s(wall, 10);
  EXPECT_EQ(s.now.horizon_row, -1);
  EXPECT_LT(s.now.confidence, s.before.confidence / 2);
}

TEST(NothingToBelieve, AWallThatTheSensorSees) {
  const Situation s(wall, 60, false);
  EXPECT_TRUE(s.now.flags & flag_frozen);
  EXPECT_TRUE(s.now.flags & flag_blocked);
  EXPECT_LT(s.now.traversable_permille, 200);
  EXPECT_LT(s.now.confidence, s.before.confidence / 2);
}

TEST(NothingToBelieve, ALeadCarInTheWindow) {
  const Situation s([](int x, int y) {
    const bool car = x >= 90 && x < 230 && y >= 110;
    return car ? test::Components{static_cast<std::uint8_t>(60 + 30 * (y / 20 % 2)), 90, 190}
               : Situation::road(x, y);
  });
  EXPECT_TRUE(s.now.flags & flag_starved); // it is not learned
  EXPECT_TRUE(s.now.flags & flag_blocked);
  EXPECT_LT(s.now.confidence, s.before.confidence * 2 / 3);
}

// A drive in frames far enough apart that each changes the picture; with `dashboard` a picture of one hides
// the bottom. The number of the 30 frames that have flag_window_still.
int still_frames(Kind kind, Motion motion, bool dashboard, std::uint8_t* confidence = nullptr) {
  scene::Renderer renderer({kind, Light::day, motion, 3}, 320, 240);
  scene::Picture picture(PixelFormat::I420, 320, 240);
  Segmenter segmenter{Settings()};
  int frames = 0;
  for (int k = 0; k < 30; ++k) {
    renderer.render(static_cast<std::uint64_t>(12 * k), picture);
    const Frame& f = picture.frame();
    const test::OwnedFrame shown(PixelFormat::I420, 320, 240, [&](int x, int y) {
      if (dashboard && y >= 190)
        return test::Components{static_cast<std::uint8_t>(70 + test::noise_at(x / 6, y / 6, 1, 6)), 124, 130};
      return test::Components{f.planes[0].row(y)[x], f.planes[1].row(y / 2)[x / 2],
                              f.planes[2].row(y / 2)[x / 2]};
    });
    EXPECT_TRUE(segmenter.process(shown.frame()).ok());
    frames += (segmenter.estimate().flags & flag_window_still) != 0;
  }
  if (confidence)
    *confidence = segmenter.estimate().confidence;
  return frames;
}

TEST(WindowStill, ADashboardIsNoted) {
  std::uint8_t with = 255, without = 0;
  EXPECT_GT(still_frames(Kind::trail, Motion::straight, true, &with), 10);
  EXPECT_EQ(still_frames(Kind::trail, Motion::straight, false, &without), 0);
  EXPECT_LE(with, 63); // a quarter of 255
  EXPECT_GT(without, 63);
}

TEST(WindowStill, NoPlaceIsTakenForADashboard) {
  for (const auto& [kind, motion] :
       {std::pair(Kind::road, Motion::straight), std::pair(Kind::trail, Motion::turn),
        std::pair(Kind::corridor, Motion::straight), std::pair(Kind::plain, Motion::bumpy)})
    EXPECT_EQ(still_frames(kind, motion, false), 0) << static_cast<int>(kind);
}

} // namespace
} // namespace terrainseg
