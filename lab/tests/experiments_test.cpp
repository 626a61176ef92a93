// SPDX-License-Identifier: LGPL-2.1-or-later
// The paper's experiments: the transcription of the paper against cases worked out by hand, and the parts
// that score and report.
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <sstream>

#include <unistd.h>

#include <gtest/gtest.h>
#include <opencv2/imgproc.hpp>

#include "lab/eval/charts.hpp"
#include "lab/eval/engines.hpp"
#include "lab/eval/figures.hpp"
#include "lab/eval/options.hpp"
#include "lab/eval/paper.hpp"
#include "lab/eval/table.hpp"
#include "lab/reference/paper_reading.hpp"

namespace terrainseg {
namespace {

using namespace eval;
using reference::HorizonRule;
using reference::PaperReading;
using reference::Readings;

/// Sky, a band unlike anything, ground; 320x192, bands at rows 64 and 96.
cv::Mat banded() {
  cv::Mat picture(192, 320, CV_8UC3, cv::Scalar(90, 100, 110));
  picture.rowRange(0, 64).setTo(cv::Scalar(100, 106, 112)); // looks like ground to a wide variance
  picture.rowRange(64, 96).setTo(cv::Scalar(250, 20, 20));
  for (int y = 96; y < 192; ++y)
    for (int x = 0; x < 320; ++x)
      picture.at<cv::Vec3b>(y, x) += cv::Vec3b::all(static_cast<std::uint8_t>((x * 5 + y * 3) % 12));
  return picture;
}

Readings fine(HorizonRule horizon) {
  Readings r;
  r.levels = 2;
  r.horizon = horizon;
  r.horizon_floor = 100; // 2 sigma = 20: the sky counts as ground
  return r;
}

TEST(PaperReading, TheHorizonIsTheRowUnlikeTheGround) {
  // Rows 16 to 23 of the grid hold no ground: all tie at zero but those that the filter blurs.
  PaperReading first(fine(HorizonRule::first_minimum)), lowest(fine(HorizonRule::lowest_minimum)),
      with_null(fine(HorizonRule::lowest_or_null)), off(fine(HorizonRule::off));
  const cv::Mat picture = banded();
  for (PaperReading* reading : {&first, &lowest, &with_null, &off})
    reading->process(picture);
  EXPECT_NEAR(first.horizon_row(), 64, 4);
  EXPECT_NEAR(lowest.horizon_row(), 92, 4);
  EXPECT_EQ(with_null.horizon_row(), lowest.horizon_row());
  EXPECT_EQ(off.horizon_row(), -1);
}

TEST(PaperReading, TerrainIsKeptBelowTheHorizonOrAsPrintedAbove) {
  const cv::Mat picture = banded();
  PaperReading kept(fine(HorizonRule::lowest_or_null)), flipped(fine(HorizonRule::flipped));
  EXPECT_EQ(kept.process(picture).at<std::uint8_t>(150, 160), 255);
  EXPECT_EQ(cv::countNonZero(kept.mask().rowRange(0, kept.horizon_row())), 0);
  EXPECT_EQ(flipped.process(picture).at<std::uint8_t>(150, 160), 0);
  EXPECT_GT(cv::countNonZero(flipped.mask().rowRange(0, 64)), 0);
}

TEST(PaperReading, NullWhereNoRowIsPoorer) {
  PaperReading reading(fine(HorizonRule::lowest_or_null));
  cv::Mat plain(192, 320, CV_8UC3, cv::Scalar(90, 100, 110));
  reading.process(plain);
  EXPECT_EQ(reading.horizon_row(), -1);
  EXPECT_EQ(cv::countNonZero(reading.mask() == 255), 192 * 320);
}

TEST(PaperReading, CentresFromTheCubeDieOut) {
  Readings samples = fine(HorizonRule::off), cube = samples;
  samples.bit_shift = cube.bit_shift = samples.levels = cube.levels = 0;
  cube.centres = reference::CentreRule::color_cube;
  PaperReading a(samples), b(cube);
  const cv::Mat picture = banded();
  a.process(picture);
  b.process(picture);
  EXPECT_EQ(a.live_clusters(), 3);
  EXPECT_EQ(b.live_clusters(), 1);
}

TEST(PaperReading, AgreesWithTheFilterOnAPlainScene) {
  // Written apart from the core: the integer preset and the transcription in doubles give the same mask.
  const cv::Mat picture = banded();
  Readings r;
  r.training_models = 1; // no random centres in between
  PaperReading reading(r);
  Settings settings = Settings::of(Preset::paper);
  settings.training_models = 1;
  const auto filter = make_filter(settings, 0, PixelFormat::BGR);
  const Picture frame = Picture::of(picture, {ColorRange::full, ColorMatrix::bt601});
  double horizon = -1;
  for (std::size_t i = 0; i < 3; ++i) {
    const Answer answer = filter->look(frame, i);
    EXPECT_LE(cv::countNonZero(answer.mask != reading.process(frame.bgr())), 192 * 320 / 100);
    horizon = answer.horizon.value_or(-1) * 192;
  }
  EXPECT_NEAR(horizon, reading.horizon_row(), 0.01);
}

TEST(Counts, SayWhatIsWrongAndWhatIsUnsafe) {
  // Six rows: the bottom third is rows 4 and 5.
  cv::Mat labels(6, 4, CV_8UC1, cv::Scalar(0)), mask = cv::Mat::zeros(6, 4, CV_8UC1);
  labels.row(5).setTo(1);
  labels.at<std::uint8_t>(5, 0) = 255; // not labelled
  labels.at<std::uint8_t>(4, 0) = 2;
  mask.row(5).setTo(255);
  mask.at<std::uint8_t>(4, 0) = 128; // doubtful is not traversable: wrong
  mask.at<std::uint8_t>(4, 1) = 255; // an obstacle called ground: wrong and unsafe
  const Counts counts = count_pixels(mask, labels);
  EXPECT_EQ(counts.known(), 23);
  EXPECT_EQ(counts.false_ground + counts.missed_ground, 2);
  EXPECT_EQ(counts.near_obstacles, 3);
  EXPECT_EQ(counts.unsafe, 1);
  EXPECT_THROW(count_pixels(mask, cv::Mat(2, 2, CV_8UC1)), std::runtime_error);
}

TEST(Report, SpreadAndTable) {
  const Spread s = spread_of({4, 1, 3, 2, 10}).value();
  EXPECT_EQ(s.least, 1);
  EXPECT_EQ(s.median, 3);
  EXPECT_NEAR(s.p90, 4 + 0.6 * 6, 1e-9);
  EXPECT_EQ(s.largest, 10);
  EXPECT_NEAR(s.deviation, std::sqrt(10.0), 1e-9);
  EXPECT_FALSE(spread_of({}));
  Table table({"a", "b"});
  table.add({"1", "2"});
  EXPECT_EQ(table.text(), "| a | b |\n| --- | --- |\n| 1 | 2 |\n");
}

TEST(Report, ChartHasItsCurves) {
  const auto path =
      std::filesystem::temp_directory_path() / ("terrainseg-" + std::to_string(getpid()) + ".chart.json");
  save_chart(path, {"t", "x", "l", "r", {{"c", {{0, 1}, {1, 0.5}}, false}, {"d", {{0, 2}}, true}}});
  std::ostringstream text;
  text << std::ifstream(path).rdbuf();
  EXPECT_EQ(text.str(), R"({"title":"t","x":"x","left":"l","right":"r","curves":[)"
                        R"({"name":"c","right":false,"points":[[0.0,1.0],[1.0,0.5]]},)"
                        R"({"name":"d","right":true,"points":[[0.0,2.0]]}]})"
                        "\n");
  std::filesystem::remove(path);
  EXPECT_THROW(save_chart("/nowhere/a.chart.json", {}), std::runtime_error);
}

TEST(Experiments, TablesOfRenderedScenesAreWritten) {
  const auto folder =
      std::filesystem::temp_directory_path() / ("terrainseg-paper-" + std::to_string(getpid()));
  testing::internal::CaptureStdout();
  testing::internal::CaptureStderr();
  run_paper({"--only", "table2", "--only", "training", "--limit", "2", "--out", folder.string()});
  testing::internal::GetCapturedStdout();
  testing::internal::GetCapturedStderr();
  std::ostringstream text;
  text << std::ifstream(folder / "paper.md").rdbuf();
  EXPECT_NE(text.str().find("rendered scenes (no data folder was given)"), std::string::npos);
  EXPECT_NE(text.str().find("| rendered corridor |"), std::string::npos);
  EXPECT_NE(text.str().find("Left out: nothing here has depth"), std::string::npos);
  std::filesystem::remove_all(folder);
}

TEST(Options, ArriveWhereTheyBelong) {
  const EvalOptions o =
      parse_eval_options({"a", "--ablation", "--engine", "paper", "b", "--limit=7", "--perturb", "blur",
                          "--every", "2", "--csv", "x.csv", "--engine", "paper"});
  EXPECT_EQ(o.sequences, (std::vector<std::string>{"a", "b"}));
  EXPECT_EQ(o.engines.front(), "paper");
  EXPECT_EQ(std::count(o.engines.begin(), o.engines.end(), "paper"), 1);
  EXPECT_EQ(std::count(o.engines.begin(), o.engines.end(), "default,texture=false"), 1);
  EXPECT_EQ(o.inputs, std::vector<std::string>{"blur"});
  EXPECT_EQ(o.selection.limit, 7);
  EXPECT_EQ(o.selection.every, 2);
  EXPECT_EQ(o.csv, "x.csv");
  EXPECT_EQ(parse_eval_options({"a"}).engines, std::vector<std::string>{"default"});
  EXPECT_EQ(parse_eval_options({"a", "--caution-sweep"}).engines.size(), 6u);
  EXPECT_TRUE(parse_eval_options({"a", "--confidence"}).confidence);
  EXPECT_FALSE(parse_eval_options({"a"}).confidence);
  EXPECT_GT(parse_eval_options({"a", "--perturb", "all"}).inputs.size(), 5u);
  EXPECT_NE(eval_help().find("--caution-sweep"), std::string::npos);
  EXPECT_NE(eval_help().find("h264"), std::string::npos);
}

TEST(Options, EveryEngineOfTheAblationCanBeMeasured) {
  for (const std::string& engine : parse_eval_options({"a", "--ablation"}).engines)
    EXPECT_NO_THROW(filter_settings(engine, 0)) << engine;
}

TEST(Experiments, WrongWordsAreRefused) {
  EXPECT_THROW(run_paper({"--only", "table9"}), UsageError);
  EXPECT_THROW(run_paper({"--limit", "many"}), UsageError);
  EXPECT_THROW(run_figures({"--only", "table1"}), UsageError);
  EXPECT_THROW(run_figures({"folder"}), UsageError);
  EXPECT_THROW(run_paper({"--limit", "-3"}), UsageError);
  EXPECT_THROW(parse_eval_options({}), UsageError);
  EXPECT_THROW(parse_eval_options({"a", "--limit"}), UsageError);
  EXPECT_THROW(parse_eval_options({"a", "--colour"}), UsageError);
  EXPECT_THROW(parse_eval_options({"a", "--every", "0"}), UsageError);
  EXPECT_THROW(parse_eval_options({"a", "--engine", "default,learned-models=2"}), UsageError);
  EXPECT_THROW(parse_eval_options({"a", "--engine", "default,tuning.nothing=1"}), UsageError);
  EXPECT_THROW(parse_eval_options({"a", "--perturb", "upside-down"}), UsageError);
  EXPECT_THROW(run_paper({"--only", "table2", "--data", "/nowhere", "--out",
                          (std::filesystem::temp_directory_path() / "terrainseg-none").string()}),
               std::runtime_error);
  std::filesystem::remove_all(std::filesystem::temp_directory_path() / "terrainseg-none");
}

} // namespace
} // namespace terrainseg
