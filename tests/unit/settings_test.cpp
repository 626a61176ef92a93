// SPDX-License-Identifier: LGPL-2.1-or-later
#include "terrainseg/settings.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <random>
#include <set>

#include "terrainseg/settings_table.hpp"

namespace terrainseg {
namespace {

TEST(Settings, BothPresetsAreValid) {
  EXPECT_FALSE(validate(Settings::of(Preset::standard)));
  EXPECT_FALSE(validate(Settings::of(Preset::paper)));
}

TEST(Settings, PresetsHaveTheDocumentedValues) {
  const Settings standard = Settings::of(Preset::standard), paper = Settings::of(Preset::paper);
  EXPECT_EQ(standard.training_models, 3);
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

TEST(Settings, CautionAndDoubtfulTakeAHundredEachWay) {
  for (int value = -100; value <= 100; ++value) {
    Settings settings;
    settings.caution = settings.doubtful = value;
    EXPECT_FALSE(validate(settings)) << value;
  }
  for (const int value : {-101, 101}) {
    Settings cautious, doubting;
    cautious.caution = value;
    doubting.doubtful = value;
    ASSERT_TRUE(validate(cautious));
    EXPECT_EQ(validate(cautious)->property, "caution");
    ASSERT_TRUE(validate(doubting));
    EXPECT_EQ(validate(doubting)->property, "doubtful");
  }
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

TEST(SettingTable, HoldsTheDefaultsAndThePapersColumn) {
  const Settings standard, paper = Settings::of(Preset::paper);
  std::set<std::string> names;
  for (const Setting& setting : setting_table()) {
    EXPECT_TRUE(names.insert(setting.name).second) << setting.name;
    EXPECT_EQ(find_setting(setting.name), &setting);
    EXPECT_EQ(setting.get(standard), setting.standard) << setting.name;
    EXPECT_EQ(setting.get(paper), setting.paper) << setting.name;
    EXPECT_LE(setting.low, std::min(setting.standard, setting.paper)) << setting.name;
    EXPECT_GE(setting.high, std::max(setting.standard, setting.paper)) << setting.name;
    EXPECT_EQ(setting.kind == SettingKind::choice, !setting.choices.empty()) << setting.name;
    EXPECT_FALSE(std::string(setting.blurb).empty()) << setting.name;
  }
  EXPECT_EQ(find_setting("no-such"), nullptr);
}

TEST(SettingTable, EveryRowSetsAFieldOfItsOwn) {
  for (const Setting& setting : setting_table()) {
    Settings settings;
    const std::int64_t other = setting.get(settings) == setting.low ? setting.high : setting.low;
    setting.set(settings, other);
    for (const Setting& each : setting_table())
      EXPECT_EQ(each.get(settings), &each == &setting ? other : each.standard)
          << setting.name << " and " << each.name;
  }
}

TEST(SettingTable, BothEndsOfEveryRangeAreValidAndNoMore) {
  for (const Setting& setting : setting_table()) {
    if (setting.kind == SettingKind::choice || setting.kind == SettingKind::truth ||
        setting.kind == SettingKind::natural)
      continue;                                                               // the field holds nothing else
    const bool about_models = std::string(setting.name).ends_with("-models"); // contradict each other
    for (const std::int64_t good : {setting.low, setting.high}) {
      Settings settings;
      setting.set(settings, good);
      EXPECT_TRUE(about_models || !validate(settings)) << setting.name;
    }
    for (const std::int64_t bad : {setting.low - 1, setting.high + 1}) {
      Settings settings;
      setting.set(settings, bad);
      const auto error = validate(settings);
      ASSERT_TRUE(error) << setting.name;
      EXPECT_EQ(error->property, setting.name);
    }
  }
}

TEST(SettingTable, FractionsAreToldAsTheyAreWritten) {
  Settings settings;
  settings.threshold_q8 = 16 * 256 + 1;
  EXPECT_EQ(validate(settings)->message(), "threshold = 16.00390625: outside 0..16 standard deviations");
  settings.threshold_q8 = -384;
  EXPECT_EQ(validate(settings)->value, "-1.5");
}

TEST(SettingTable, SaysWhichPipelineUsesWhat) {
  const Settings standard, paper = Settings::of(Preset::paper);
  for (const char* name : {"threshold", "bit-shift"}) {
    EXPECT_FALSE(is_used(*find_setting(name), standard)) << name;
    EXPECT_TRUE(is_used(*find_setting(name), paper)) << name;
  }
  for (const char* name :
       {"texture",     "exposure",         "row-prior",    "local-reference", "geodesic",
        "second-look", "connected-ground", "odd-spots",    "ground-behind",   "refine",
        "light-ahead", "upright",          "long-lines",   "near-spots",      "far-spots",
        "stone-field", "window-guard",     "vivid-colors", "negatives",       "temporal",
        "motion",      "vanishing-row",    "horizon-hint", "caution",         "doubtful"}) {
    EXPECT_TRUE(is_used(*find_setting(name), standard)) << name;
    EXPECT_FALSE(is_used(*find_setting(name), paper)) << name;
  }
  EXPECT_TRUE(is_used(*find_setting("window-width"), paper));
  // The stage was removed: neither value has an effect.
  Settings removed;
  for (const bool value : {false, true}) {
    removed.own_shadow = value;
    EXPECT_FALSE(is_used(*find_setting("own-shadow"), removed)) << value;
    EXPECT_TRUE(is_idle(*find_setting("own-shadow"), removed)) << value;
    EXPECT_FALSE(validate(removed)) << value;
  }
}

TEST(SettingText, RoundsToTheNearestHalvesAwayFromZero) {
  // Worked out by hand.
  EXPECT_EQ(kept_value(2'100'000'000, 256), 538); // 537.6
  EXPECT_EQ(kept_value(1'953'125, 256), 1);       // one half
  EXPECT_EQ(kept_value(1'953'124, 256), 0);       // just under
  EXPECT_EQ(kept_value(-1'953'125, 256), -1);
  EXPECT_EQ(kept_value(-1'953'124, 256), 0);
  EXPECT_EQ(kept_value(4'294'967'295'000'000'000, 1), 4'294'967'295);
  // And against floating point.
  std::mt19937 random(1);
  for (int i = 0; i < 20000; ++i) {
    const int thousandths = static_cast<int>(random() % 16001);
    char text[16];
    std::snprintf(text, sizeof text, "%d.%03d", thousandths / 1000, thousandths % 1000);
    Settings settings;
    ASSERT_FALSE(set_from_text(settings, "threshold", text)) << text;
    EXPECT_EQ(settings.threshold_q8, std::lround(thousandths / 1000.0 * 256)) << text;
  }
}

TEST(SettingText, ReadsDecimalNumbersAndNothingElse) {
  EXPECT_EQ(billionths_of("2.5"), 2'500'000'000);
  EXPECT_EQ(billionths_of(" -0.000000001 "), -1);
  EXPECT_EQ(billionths_of(".5"), 500'000'000);
  EXPECT_EQ(billionths_of("+3."), 3'000'000'000);
  EXPECT_EQ(billionths_of("0.99999999999"), 999'999'999);
  EXPECT_EQ(billionths_of("4294967295"), 4'294'967'295'000'000'000);
  for (const char* text :
       {"", "-", ".", "1e3", "0x10", "1,5", "1.2.3", "--1", "9999999999", "99999999999", "nan"})
    EXPECT_FALSE(billionths_of(text)) << text;
}

TEST(SettingText, WritesWhatItReads) {
  for (const Setting& setting : setting_table())
    for (const std::int64_t value : {setting.low, setting.standard, setting.paper, setting.high}) {
      Settings settings;
      const std::string text = setting_text(setting, value);
      const auto error = set_from_text(settings, setting.name, text);
      ASSERT_FALSE(error) << error->message();
      EXPECT_EQ(setting.get(settings), value) << setting.name << " = " << text;
    }
}

TEST(SettingText, AnErrorChangesNothing) {
  Settings settings;
  for (const auto& [name, text] : {std::pair{"threshold", "17"}, {"caution", "a"}, {"window-rect", "1,2"}}) {
    EXPECT_TRUE(set_from_text(settings, name, text)) << name;
    EXPECT_EQ(settings, Settings{});
  }
}

TEST(WindowRect, IsReadInFractions) {
  Rectangle rect;
  EXPECT_FALSE(parse_window_rect("0.25, 0.5,0.5,.125", rect));
  EXPECT_EQ(rect, (Rectangle{16384, 32768, 32768, 8192}));
  for (const char* text : {"0,0,1,1", "0.7,0.1,0.3,0.9", "0.000011444,0,0.999988556,1"})
    EXPECT_FALSE(parse_window_rect(text, rect)) << text;
  EXPECT_FALSE(parse_window_rect("", rect));
  EXPECT_TRUE(rect.empty());
}

TEST(WindowRect, ErrorsNamePropertyValueAndReason) {
  Rectangle rect{1, 2, 3, 4};
  for (const char* text : {"0.1,0.2,0.3", "0.1,0.2,0.3,0.4,0.5", "a,b,c,d", "0.1;0.2;0.3;0.4", "0,0,0,0.5",
                           "-0.1,0,0.5,0.5", "0,0,2,1", "0.6,0,0.5,0.5", "0,0.6,0.5,0.5", ",,,"}) {
    const auto error = parse_window_rect(text, rect);
    ASSERT_TRUE(error) << text;
    EXPECT_EQ(error->property, "window-rect");
    EXPECT_EQ(error->value, text);
    EXPECT_FALSE(error->reason.empty());
  }
  EXPECT_EQ(rect, (Rectangle{1, 2, 3, 4}));
}

} // namespace
} // namespace terrainseg
