// SPDX-License-Identifier: LGPL-2.1-or-later
// Forgotten means fresh: a filter that has driven and then forgets answers, frame by frame and field by
// field, as one that has never seen anything else.
#include "terrainseg/segmenter.hpp"

#include <algorithm>
#include <string>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "scene/scene.hpp"
#include "support/same_estimate.hpp"

namespace terrainseg {
namespace {

constexpr int width = 320, height = 180;

/// Frames at 20 Hz, so that motion passes none by.
std::vector<scene::Picture> rendered(const scene::Settings& place, int frames) {
  scene::Renderer renderer(place, width, height);
  std::vector<scene::Picture> pictures;
  for (int k = 0; k < frames; ++k) {
    pictures.emplace_back(PixelFormat::I420, width, height);
    renderer.render(static_cast<std::uint64_t>(k), pictures.back());
  }
  return pictures;
}

/// Stones that are driven past, by which motion finds its line.
const std::vector<scene::Picture>& plain() {
  static const auto pictures =
      rendered({scene::Kind::plain, scene::Light::day, scene::Motion::straight, 101}, 48);
  return pictures;
}
const std::vector<scene::Picture>& trail() {
  static const auto pictures =
      rendered({scene::Kind::trail, scene::Light::sun, scene::Motion::bumpy, 103}, 30);
  return pictures;
}

Frame with_time(const scene::Picture& picture, std::size_t index) {
  Frame frame = picture.frame();
  frame.pts = static_cast<std::int64_t>(index) * 50'000'000;
  return frame;
}

void drive(Segmenter& segmenter, const std::vector<scene::Picture>& pictures) {
  for (std::size_t k = 0; k < pictures.size(); ++k)
    ASSERT_TRUE(segmenter.process(with_time(pictures[k], k)).ok());
}

/// Every field but the counts, which go on.
void expect_same_answer(const Estimate& a, const Estimate& b) {
  Estimate counted = a;
  counted.frame = b.frame;
  counted.model_generation = b.model_generation;
  test::expect_same(counted, b);
  EXPECT_EQ(a.vanishing_row, b.vanishing_row);
  EXPECT_EQ(a.speed_over_height, b.speed_over_height);
  EXPECT_EQ(test::packed(a.confidence_map), test::packed(b.confidence_map));
  for (std::size_t m = 0; m < max_models; ++m)
    EXPECT_EQ(a.models[m].rgb, b.models[m].rgb);
}

void expect_same_drive(Segmenter& used, Segmenter& fresh, const std::vector<scene::Picture>& pictures) {
  for (std::size_t k = 0; k < pictures.size() && !testing::Test::HasFailure(); ++k) {
    SCOPED_TRACE("frame " + std::to_string(k));
    ASSERT_TRUE(used.process(with_time(pictures[k], k)).ok());
    ASSERT_TRUE(fresh.process(with_time(pictures[k], k)).ok());
    expect_same_answer(used.estimate(), fresh.estimate());
  }
}

std::vector<std::pair<std::string, Settings>> kinds() {
  Settings everything;
  everything.horizon = HorizonMode::automatic;
  Settings split = everything;
  split.negatives = Negatives::split;
  split.temporal = Temporal::on;
  return {{"default", everything}, {"split", split}, {"paper", Settings::of(Preset::paper)}};
}

TEST(Forgotten, ByAResetIsFresh) {
  for (const auto& [name, settings] : kinds()) {
    SCOPED_TRACE(name);
    Segmenter used(settings), fresh(settings);
    drive(used, plain());
    if (settings.free_space) {
      EXPECT_GT(used.estimate().speed_over_height, 0); // there is something to forget
    }
    used.reset();
    expect_same_drive(used, fresh, trail());
  }
}

TEST(Forgotten, ByASeekIsFreshButForTheTerrain) {
  for (const auto& [name, settings] : kinds()) {
    SCOPED_TRACE(name);
    Segmenter used(settings), fresh(settings);
    drive(used, plain());
    used.reset_temporal();
    ASSERT_TRUE(fresh.adopt(used.terrain()).ok());
    expect_same_drive(used, fresh, plain());
  }
}

// Frames of another size come from another picture.
TEST(Forgotten, ByAnotherSizeIsFreshButForTheTerrain) {
  scene::Renderer renderer({scene::Kind::road, scene::Light::day, scene::Motion::straight, 3}, 400, 224);
  scene::Picture other(PixelFormat::I420, 400, 224);
  Segmenter used{Settings{}}, fresh{Settings{}};
  drive(used, trail());
  renderer.render(0, other);
  ASSERT_TRUE(used.process(with_time(other, 0)).ok());
  ASSERT_TRUE(fresh.adopt(used.terrain()).ok());
  expect_same_drive(used, fresh, plain());
}

} // namespace
} // namespace terrainseg
