// SPDX-License-Identifier: LGPL-2.1-or-later
#include "terrainseg/settings.hpp"

#include <gtest/gtest.h>

namespace terrainseg {
namespace {

TEST(Settings, BothPresetsAreValid) {
  EXPECT_FALSE(validate(Settings::of(Preset::standard)));
  EXPECT_FALSE(validate(Settings::of(Preset::paper)));
}

TEST(Settings, PresetsHaveTheDocumentedValues) {
  const Settings standard = Settings::of(Preset::standard), paper = Settings::of(Preset::paper);
  EXPECT_EQ(standard.training_models, 1);
  EXPECT_EQ(standard.bit_shift, 4);
  EXPECT_TRUE(standard.free_space);
  EXPECT_EQ(paper.training_models, 3);
  EXPECT_EQ(paper.bit_shift, 3);
  EXPECT_EQ(paper.pyramid_levels, 5);
  EXPECT_FALSE(paper.free_space);
  EXPECT_EQ(paper.doubtful, -96);
}

TEST(Settings, AnErrorNamesPropertyValueAndRange) {
  Settings settings;
  settings.bit_shift = 8;
  const auto error = validate(settings);
  ASSERT_TRUE(error);
  EXPECT_EQ(error->property, "bit-shift");
  EXPECT_NE(error->message().find("8"), std::string::npos);
  EXPECT_NE(error->message().find("0..7"), std::string::npos);
}

TEST(Settings, LearnedModelsMustOutnumberTrainingModels) {
  Settings settings;
  settings.training_models = 5;
  settings.learned_models = 5;
  const auto error = validate(settings);
  ASSERT_TRUE(error);
  EXPECT_EQ(error->property, "learned-models");
  EXPECT_NE(error->message().find("training-models = 5"), std::string::npos);
}

} // namespace
} // namespace terrainseg
