// SPDX-License-Identifier: LGPL-2.1-or-later
// terrainseg-eval: figures worked out by hand, perturbations, the paired test, files that are not what they
// should be.
#include <atomic>
#include <filesystem>
#include <fstream>
#include <random>
#include <sstream>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>

#include "lab/eval/charts.hpp"
#include "lab/eval/comparison.hpp"
#include "lab/eval/engines.hpp"
#include "lab/eval/evaluation.hpp"
#include "lab/eval/figures.hpp"
#include "lab/eval/leave_out.hpp"
#include "lab/eval/measurement.hpp"
#include "lab/eval/options.hpp"
#include "lab/eval/parallel.hpp"
#include "lab/eval/perturbations.hpp"
#include "lab/eval/ramp_baseline.hpp"
#include "lab/eval/report.hpp"
#include "lab/eval/sequence.hpp"
#include "lab/eval/things.hpp"
#include "terrainseg/segmenter.hpp"

namespace terrainseg::eval {
namespace {

namespace fs = std::filesystem;

/// A folder that goes away.
class Folder {
 public:
  Folder() {
    std::string pattern = (fs::temp_directory_path() / "terrainseg-XXXXXX").string();
    path_ = mkdtemp(pattern.data());
  }
  ~Folder() { fs::remove_all(path_); }
  fs::path path() const { return path_; }

 private:
  fs::path path_;
};

/// Sky above row 12, an obstacle in columns 10..14 down to row 20, ground below; 30 x 30.
cv::Mat1b simple_labels() {
  cv::Mat1b l(30, 30, std::uint8_t{label_terrain});
  l.rowRange(0, 12) = label_sky;
  l(cv::Rect(10, 12, 5, 9)) = label_obstacle;
  l(cv::Rect(0, 25, 3, 5)) = label_none;
  return l;
}

cv::Mat1b below(int row) {
  cv::Mat1b m(30, 30, std::uint8_t{0});
  m.rowRange(row, 30) = 255;
  return m;
}

Figures score(const std::vector<cv::Mat1b>& masks, const cv::Mat1b& labels) {
  Scorer scorer("s", "e", "as it is");
  for (std::size_t i = 0; i < masks.size(); ++i)
    scorer.add({masks[i], 0.5, true, 100, 1.5}, labels, i);
  return scorer.finish();
}

TEST(EvalFigures, CountedByHand) {
  const Figures f = score({below(12)}, simple_labels());
  const Counts& c = f.ground;
  EXPECT_EQ(c.false_ground, 45); // the obstacle
  EXPECT_EQ(c.missed_ground, 0);
  EXPECT_EQ(c.true_rest, 360);                 // sky
  EXPECT_EQ(c.true_ground, 18 * 30 - 45 - 15); // without what is not labelled
  EXPECT_NEAR(c.error(), 100.0 * 45 / 885, 1e-9);
  EXPECT_NEAR(c.iou(), 100.0 * 480 / 525, 1e-9);
  EXPECT_NEAR(c.precision(), 100.0 * 480 / 525, 1e-9);
  EXPECT_EQ(c.recall(), 100);
  EXPECT_EQ(c.near_obstacles, 5); // row 20, in the bottom third
  EXPECT_EQ(c.unsafe_share(), 100);
  EXPECT_EQ(f.mean_error(), f.ground.error());
  EXPECT_NEAR(f.horizon->median, 100 * (0.5 - 0.4), 1e-9);
  EXPECT_NEAR(*f.boundary_within, 100.0 * 25 / 30, 1e-9);
  EXPECT_NEAR(*f.boundary_over, 100.0 * 5 / 30, 1e-9);
  EXPECT_NEAR(f.latency->median, 1.5, 1e-9);
}

TEST(EvalFigures, CellsAreCountedByWhatTheMapSays) {
  // Cells of 8 pixels: their first ones lie in rows and columns 0, 8, 16, 24; ground from row 12 on in the
  // mask.
  cv::Mat1b map(4, 4, std::uint8_t{200});
  map.row(0) = 0;
  map(2, 0) = 1;
  map(3, 3) = 255;
  map(3, 2) = 236;
  map(1, 1) = 191;
  const Sureness s = count_cells(map, below(12), simple_labels());
  EXPECT_EQ(s.all(), 16);
  EXPECT_EQ(s.cells, (std::array<long long, 8>{4, 1, 0, 0, 1, 8, 0, 2}));
  EXPECT_EQ(s.right, s.cells) << "no cell begins in the obstacle";
  // One row later the third row of cells is called no ground; the doubtful count the same.
  cv::Mat1b low = below(24);
  EXPECT_EQ(count_cells(map, low, simple_labels()).right, (std::array<long long, 8>{4, 0, 0, 0, 1, 5, 0, 2}));
  low.rowRange(16, 24) = 128;
  EXPECT_EQ(count_cells(map, low, simple_labels()).right, (std::array<long long, 8>{4, 0, 0, 0, 1, 5, 0, 2}));
  // Without a label it does not count.
  cv::Mat1b labels = simple_labels();
  labels(24, 24) = label_none;
  EXPECT_EQ(count_cells(map, below(12), labels).cells[7], 1);
  EXPECT_THROW(count_cells(cv::Mat1b(4, 5, std::uint8_t{0}), below(12), labels), std::runtime_error);

  Scorer scorer("s", "e", "as it is"), later = scorer;
  Answer answer{below(12), 0.5, true, 100, 1.5, map};
  scorer.add(answer, simple_labels(), 0);
  later.add(answer, simple_labels(), 1);
  answer.confidence_map = {};
  later.add(answer, simple_labels(), 2);
  scorer.join(std::move(later));
  EXPECT_EQ(scorer.finish().sureness.cells[5], 16);
}

TEST(EvalFigures, DoubtfulIsNotTraversable) {
  cv::Mat1b doubtful = below(12);
  doubtful(cv::Rect(10, 12, 5, 9)) = 128;
  const Figures f = score({doubtful}, simple_labels());
  EXPECT_EQ(f.ground.error(), 0);
  EXPECT_EQ(f.without_doubt_zone.false_ground, 45);
  EXPECT_EQ(*f.boundary_within, 100);
}

TEST(EvalFigures, Label2IsGroundButNotTerrain) {
  cv::Mat1b labels = simple_labels();
  labels.rowRange(25, 30).setTo(label_ground, labels.rowRange(25, 30) == label_terrain);
  const Figures f = score({below(25)}, labels);
  EXPECT_EQ(f.ground.true_ground, 5 * 30 - 15);
  EXPECT_EQ(f.terrain.true_ground, 0);
  EXPECT_EQ(f.terrain.missed_ground, 13 * 30 - 45);
  EXPECT_EQ(f.mean_other_missed(), 0);
  // All of the other ground missed, and nothing else wrong but the obstacle and the sky left as they are.
  const Figures none = score({below(30)}, labels);
  EXPECT_NEAR(none.mean_other_missed(), 100.0 * (5 * 30 - 15) / 885, 1e-9);
}

TEST(EvalFigures, FlickerIsWhatChanges) {
  EXPECT_NEAR(*score({below(12), below(15), below(15)}, simple_labels()).flicker, (10.0 + 0) / 2, 1e-9);
}

TEST(EvalFigures, RankCorrelation) {
  EXPECT_NEAR(*rank_correlation({1, 2, 3, 4}, {10, 20, 30, 90}), 1, 1e-12);
  EXPECT_NEAR(*rank_correlation({1, 2, 3, 4}, {9, 7, 5, -3}), -1, 1e-12);
  EXPECT_NEAR(*rank_correlation({1, 2, 2, 3}, {1, 2, 2, 3}), 1, 1e-12);
  EXPECT_FALSE(rank_correlation({1, 1, 1}, {1, 2, 3}));
  EXPECT_FALSE(rank_correlation({1, 2}, {1, 2}));
}

TEST(EvalComparison, SeesADifferenceAndOnlyADifference) {
  int false_alarms = 0, found = 0;
  for (unsigned seed = 1; seed <= 30; ++seed) {
    std::mt19937 random(seed);
    std::normal_distribution<double> noise(0, 1);
    std::vector<double> a, same, better;
    for (int i = 0; i < 200; ++i) {
      const double level = 10 + 3 * noise(random);
      a.push_back(level);
      same.push_back(level + 0.5 * noise(random));
      better.push_back(level - 0.3 + 0.5 * noise(random));
    }
    false_alarms += compare(a, same).p < 0.05;
    const Comparison c = compare(a, better);
    found += c.p < 0.05 && c.mean_difference < 0;
    EXPECT_LT(c.low, c.mean_difference);
    EXPECT_LT(c.mean_difference, c.high);
    EXPECT_EQ(c.pairs, 200);
  }
  EXPECT_LE(false_alarms, 5); // 1.5 of 30 are due
  EXPECT_EQ(found, 30);
  EXPECT_EQ(compare({}, {}).p, 1);
}

TEST(EvalReport, JsonComesBack) {
  const Folder folder;
  const std::string path = (folder.path() / "a.json").string();
  Figures f = score({below(12), below(14), below(20)}, simple_labels());
  f.engine = "default,\"odd\"";
  {
    std::ofstream file(path);
    Figures tabbed = f;
    tabbed.engine = "a\tb\\";
    write_json(file, {f, f, tabbed}, usual_kinds());
  }
  std::ifstream written(path);
  EXPECT_EQ(nlohmann::json::parse(written).at("runs").at(0).at("kind"), kind_of(f, usual_kinds()));
  auto back = read_json(path);
  ASSERT_EQ(back.size(), 3u);
  EXPECT_EQ(back[0].engine, f.engine);
  EXPECT_EQ(back[2].engine, "a\tb\\");
  back.pop_back();
  ASSERT_EQ(back[0].frames.size(), 3u);
  EXPECT_NEAR(back[0].frames[2].error, f.frames[2].error, 1e-3);
  std::ostringstream table;
  write_comparison(table, back, back);
  EXPECT_NE(table.str().find("too few frames to tell"), std::string::npos); // three frames are one block
  EXPECT_EQ(table.str().find("no difference shown"), std::string::npos);
  f.stills = true;
  f.frames.resize(8, f.frames[0]);
  std::ostringstream of_stills;
  write_comparison(of_stills, {f}, {f});
  EXPECT_NE(of_stills.str().find(
                "s: default,\"odd\" / default,\"odd\" | error | 8 | +0.00 [+0.00, +0.00] | 0 / 0 | "
                "1.0000 | no difference shown"),
            std::string::npos)
      << of_stills.str();
  EXPECT_THROW(read_json((folder.path() / "none.json").string()), std::runtime_error);
  std::ofstream(folder.path() / "bad.json") << "{\"runs\": [{\"engine\": 3}]}";
  EXPECT_THROW(read_json((folder.path() / "bad.json").string()), std::runtime_error);
}

TEST(EvalReport, ThingsStandSideBySide) {
  Figures a = score({below(12)}, simple_labels());
  std::ostringstream none, table;
  write_things_matrix(none, {a});
  EXPECT_EQ(none.str(), "");
  a.things = {8, 2};
  write_things_matrix(table, {a});
  EXPECT_EQ(table.str(), "\n| things missed, % | s |\n| --- | --- |\n| e | 25.0 of 8 |\n");
}

TEST(EvalReport, SurenessIsTheMeanOfTheSequences) {
  Figures a = score({below(12)}, simple_labels()), b = a, without = a;
  std::ostringstream none, table;
  write_sureness(none, {without});
  EXPECT_EQ(none.str(), "");
  a.sureness.cells = {10, 0, 0, 0, 0, 0, 0, 30};
  a.sureness.right = {5, 0, 0, 0, 0, 0, 0, 27};
  b.sequence = "t";
  b.sureness.cells = {0, 0, 0, 0, 0, 0, 0, 10};
  b.sureness.right = {0, 0, 0, 0, 0, 0, 0, 10};
  write_sureness(table, {a, without, b});
  EXPECT_EQ(
      table.str(),
      "\n| e | 0 | 1-63 | 64-127 | 128-159 | 160-191 | 192-215 | 216-235 | 236-255 |\n"
      "| --- | --- | --- | --- | --- | --- | --- | --- | --- |\n"
      "| labels expected to be right, % | 50 | 50-62 | 63-75 | 75-81 | 81-87 | 88-92 | 92-96 | 96-100 |\n"
      "| labels that are right, % | 50 | - | - | - | - | - | - | 95 |\n"
      "| of all cells, % | 12 | 0 | 0 | 0 | 0 | 0 | 0 | 88 |\n"
      "| s, right, % (of its cells, %) | 50 (25) | - | - | - | - | - | - | 90 (75) |\n"
      "| t, right, % (of its cells, %) | - | - | - | - | - | - | - | 100 (100) |\n");
}

/// A set of `count` frames that all have one error.
Figures stills_of(const std::string& set, const std::string& engine, std::size_t count, double error) {
  Figures f;
  f.sequence = set;
  f.engine = engine;
  f.stills = true;
  f.best_ramp = 7;
  f.ground.true_ground = 100;
  FrameFigures frame;
  frame.error = error;
  frame.terrain = error / 2;
  f.frames.resize(count, frame);
  return f;
}

TEST(EvalReport, SmallSetsOfStillsAreTakenTogether) {
  std::ostringstream table;
  write_stills(table, {stills_of("a", "x", 20, 10), stills_of("b", "x", 2, 4), stills_of("c", "x", 6, 8)});
  EXPECT_NE(table.str().find("| a | 20 | 10.00 | 5.00 |"), std::string::npos) << table.str();
  EXPECT_NE(table.str().find("| mean of 3 sets |  | 7.33 | 3.67 |"), std::string::npos) << table.str();
  // (2 * 4 + 6 * 8) / 8
  EXPECT_NE(table.str().find("| 2 sets of fewer than 10 frames together | 8 | 7.00 | 3.50 |"),
            std::string::npos)
      << table.str();
}

TEST(EvalReport, EnginesOfStillsStandSideBySide) {
  std::ostringstream table;
  write_stills_matrix(table,
                      {stills_of("a", "x", 20, 10), stills_of("a", "y", 20, 6), stills_of("b", "x", 2, 4)});
  EXPECT_NE(table.str().find("| a | 10.00 / 5.00 | 6.00 / 3.00 | 7.00 |"), std::string::npos) << table.str();
  EXPECT_NE(table.str().find("| b | 4.00 / 2.00 | - | 7.00 |"), std::string::npos) << table.str();
  EXPECT_NE(table.str().find("| mean of 2 sets | 7.00 / 3.50 | 6.00 / 3.00 | 7.00 |"), std::string::npos)
      << table.str();
}

/// A run over stills whose frames all have that error.
Figures run_of(const std::string& set, const std::string& engine, double error) {
  Figures f = stills_of(set, engine, 1, error);
  f.ground.near_obstacles = 100;
  f.ground.unsafe = static_cast<long long>(10 * error);
  return f;
}

TEST(EvalLeaveOut, ChoosesOnTheOtherKinds) {
  // "wide" is the best on snow and by far the worst in a flat: chosen where only the flat is left out.
  const std::vector<Figures> all{run_of("snow_a", "default", 6), run_of("snow_b", "default", 8),
                                 run_of("flat", "default", 4),   run_of("snow_a", "wide", 2),
                                 run_of("snow_b", "wide", 4),    run_of("flat", "wide", 9),
                                 run_of("snow_a", "half", 1)};
  const std::vector<LeftOut> kinds = leave_out(all, usual_kinds(), 0);
  ASSERT_EQ(kinds.size(), 2u);
  EXPECT_EQ(kinds[0].kind, "indoors");
  EXPECT_EQ(kinds[0].chosen, "wide");
  EXPECT_DOUBLE_EQ(kinds[0].error, 9);
  EXPECT_DOUBLE_EQ(kinds[0].baseline_error, 4);
  EXPECT_EQ(kinds[1].kind, "planets and snow");
  EXPECT_EQ(kinds[1].chosen, "default");
  EXPECT_EQ(kinds[1].sets, 2);
  EXPECT_DOUBLE_EQ(kinds[1].error, 7);
  EXPECT_DOUBLE_EQ(kinds[1].unsafe, 70);
  std::ostringstream table;
  write_leave_out(table, all, usual_kinds(), 0);
  EXPECT_NE(table.str().find("| mean of the kinds | 3 | 5.50 / 55.00 | 8.00 / 80.00 |  |"), std::string::npos)
      << table.str();
  EXPECT_NE(table.str().find("| wide | 6.00 / 60.00 |"), std::string::npos) << table.str();
  EXPECT_EQ(table.str().find("half"), std::string::npos) << "did not run on everything";
}

TEST(EvalLeaveOut, UnsafeMayWeighInTheChoice) {
  Figures careless = run_of("flat", "wide", 3);
  careless.ground.unsafe = 90;
  const std::vector<Figures> all{run_of("snow", "default", 4), run_of("flat", "default", 4),
                                 run_of("snow", "wide", 3), careless};
  EXPECT_EQ(leave_out(all, usual_kinds(), 0)[1].chosen, "wide");
  EXPECT_EQ(leave_out(all, usual_kinds(), 0.1)[1].chosen, "default");
}

TEST(EvalLeaveOut, KindsAreStatedOrFollowFromTheName) {
  Figures f = run_of("urban_noon", "default", 1);
  EXPECT_EQ(kind_of(f, usual_kinds()), "drives in town");
  EXPECT_EQ(kind_of(f, {parse_kind_rule("mine=NOON$")}), "mine");
  EXPECT_EQ(kind_of(f, {}), "urban_noon");
  f.kind = "stated";
  EXPECT_EQ(kind_of(f, usual_kinds()), "stated");
  EXPECT_THROW(parse_kind_rule("=x"), std::runtime_error);
  EXPECT_THROW(parse_kind_rule("a=("), std::runtime_error);
  EXPECT_THROW(leave_out({run_of("flat", "default", 1)}, usual_kinds(), 0), std::runtime_error);
}

TEST(EvalReport, CsvHasACellForEveryColumn) {
  Figures f = score({below(12)}, simple_labels());
  f.engine = "default,caution=8";
  std::ostringstream table;
  write_csv(table, {f});
  std::istringstream lines(table.str());
  std::string head, line;
  std::getline(lines, head);
  std::getline(lines, line);
  EXPECT_EQ(line.substr(0, 35), "s,\"default,caution=8\",as it is,1,30");
  // One comma more stands in the engine's name.
  EXPECT_EQ(std::count(line.begin(), line.end(), ','), std::count(head.begin(), head.end(), ',') + 1);
  EXPECT_NE(line.find(",5.085,"), std::string::npos); // 45 of 885
}

TEST(EvalComparison, FewBlocksCannotTell) {
  const std::vector<double> a(25, 10.0), b(25, 5.0), more_a(30, 10.0), more_b(30, 5.0);
  EXPECT_TRUE(compare(a, b).too_few()); // five blocks: p is at least 2 / 2^5
  EXPECT_GT(compare(a, b).p, 0.05);
  EXPECT_FALSE(compare(more_a, more_b).too_few());
  EXPECT_LT(compare(more_a, more_b).p, 0.05);
  EXPECT_FALSE(compare(a, b, 1).too_few());
}

// Against all pairs of frames.
TEST(EvalFigures, TheCurveOfTheConfidenceIsTheShareOfPairsInOrder) {
  std::mt19937 random(23);
  for (int trial = 0; trial < 50; ++trial) {
    std::vector<Figures> runs(1 + trial % 3);
    std::vector<const Figures*> all;
    for (Figures& run : runs) {
      run.frames.resize(1 + random() % 20);
      for (FrameFigures& frame : run.frames) {
        frame.error = static_cast<double>(random() % 61);
        frame.confidence = static_cast<int>(random() % 12) * 23;
      }
      all.push_back(&run);
    }
    double ordered = 0, pairs = 0;
    for (const Figures& a : runs)
      for (const FrameFigures& wrong : a.frames)
        for (const Figures& b : runs)
          for (const FrameFigures& other : b.frames)
            if (wrong.error > 30 && other.error <= 30) {
              const double weight = 1.0 / static_cast<double>(a.frames.size() * b.frames.size());
              pairs += weight;
              ordered += wrong.confidence < other.confidence    ? weight
                         : wrong.confidence == other.confidence ? weight / 2
                                                                : 0;
            }
    const auto found = found_by_confidence(all, 30);
    ASSERT_EQ(found.has_value(), pairs > 0);
    if (pairs > 0) {
      EXPECT_NEAR(*found, ordered / pairs, 1e-9);
    }
  }
  EXPECT_FALSE(found_by_confidence({}, 30));
}

TEST(EvalPerturbations, EachChangesThePictureAndKeepsItsLabelsInStep) {
  cv::Mat1b labels(240, 320, std::uint8_t{label_obstacle});
  labels.rowRange(100, 240) = label_terrain;
  cv::Mat3b bgr(240, 320, cv::Vec3b(220, 180, 160));
  bgr.rowRange(100, 240) = cv::Vec3b(60, 70, 80);
  for (int y = 0; y < 240; ++y)
    for (int x = y % 7; x < 320; x += 7)
      bgr(y, x) += cv::Vec3b(9, 9, 9);
  const Sample sample{Picture::of(bgr, {}), labels};
  const cv::Mat3b before = sample.picture.bgr();
  for (const std::string& name : perturbation_names()) {
    if (name == "h264")
      continue; // needs an encoder
    std::vector<Sample> samples{sample};
    perturb(name, samples);
    EXPECT_EQ(cv::norm(sample.picture.bgr(), before, cv::NORM_L1), 0) << name << " changed what it was given";
    const cv::Mat3b after = samples[0].picture.bgr();
    const cv::Mat1b& there = samples[0].labels;
    ASSERT_EQ(after.size(), there.size()) << name;
    EXPECT_TRUE(after.size() != before.size() || cv::norm(after, before, cv::NORM_L1) > 0) << name;
    // Where the label says ground the picture is darker than half a step between both, near enough.
    int agree = 0, known = 0;
    const double middle = name == "dark" ? 60 : name == "bright" ? 170 : 120;
    for (int y = 0; y < there.rows; ++y)
      for (int x = 0; x < there.cols; ++x) {
        if (there(y, x) == label_none)
          continue;
        ++known;
        agree += (there(y, x) == label_terrain) == (after(y, x)[1] < middle);
      }
    EXPECT_GT(agree, known * 0.98) << name;
  }
  std::vector<Sample> samples{sample};
  EXPECT_THROW(perturb("sepia", samples), std::runtime_error);
}

TEST(EvalPerturbations, H264TakesPicturesOfSeveralAndOddSizes) {
  std::vector<Sample> samples;
  for (const cv::Size size : {cv::Size(318, 240), cv::Size(301, 199)}) { // rows of 954 bytes
    cv::Mat3b bgr(size, cv::Vec3b(60, 70, 80));
    bgr.rowRange(0, 100) = cv::Vec3b(220, 180, 160);
    bgr.colRange(200, 240) = cv::Vec3b(10, 10, 10);
    samples.push_back({Picture::of(bgr, {}), cv::Mat1b(size, std::uint8_t{label_terrain})});
  }
  try {
    perturb("h264", samples);
  } catch (const std::runtime_error& error) {
    if (std::string(error.what()).find("x264enc") != std::string::npos)
      GTEST_SKIP() << error.what();
    throw;
  }
  ASSERT_EQ(samples.size(), 2u);
  for (const Sample& sample : samples) {
    const cv::Mat3b after = sample.picture.bgr();
    ASSERT_EQ(after.size(), sample.labels.size());
    EXPECT_NEAR(after(20, 20)[1], 180, 25);
    EXPECT_NEAR(after(after.rows - 20, after.cols - 20)[1], 70, 25);
    for (int row = 20; row < after.rows; row += 40)
      EXPECT_NEAR(after(row, 220)[1], 10, 25) << row << ": a skewed picture";
  }
}

/// An open plain under a sky: 640 x 200, ground from row 60 on.
cv::Mat1b open_plain() {
  cv::Mat1b labels(200, 640, std::uint8_t{label_terrain});
  labels.rowRange(0, 60) = label_sky;
  return labels;
}

TEST(EvalThings, StandInTheOpen) {
  cv::Mat1b labels = open_plain(), none(labels.size(), std::uint8_t{0}),
            all(labels.size(), std::uint8_t{255});
  EXPECT_EQ(count_things(labels, all).count, 0);
  labels(cv::Rect(100, 120, 10, 4)) = label_obstacle; // 40 pixels: a thing
  labels(cv::Rect(200, 120, 13, 3)) = label_obstacle; // 39 pixels: too small
  labels(cv::Rect(300, 50, 10, 20)) = label_obstacle; // the sky is above it
  labels(cv::Rect(0, 120, 20, 20)) = label_obstacle;  // at the edge
  labels(cv::Rect(400, 180, 20, 20)) = label_obstacle;
  labels(cv::Rect(500, 150, 20, 20)) = label_obstacle; // a thing on other ground
  labels(cv::Rect(470, 120, 80, 80)).setTo(label_ground, labels(cv::Rect(470, 120, 80, 80)) == label_terrain);
  const Things seen = count_things(labels, none), missed = count_things(labels, all);
  EXPECT_EQ(seen.count, 2);
  EXPECT_EQ(seen.missed, 0);
  EXPECT_EQ(missed.missed, 2);
  EXPECT_EQ(missed.missed_share(), 100);
  cv::Mat1b half = none.clone();
  half(cv::Rect(100, 120, 5, 4)) = 255; // half of it is enough
  half(cv::Rect(500, 150, 20, 9)) = 255;
  EXPECT_EQ(count_things(labels, half).missed, 1);
}

TEST(EvalThings, GrowWithThePicture) {
  cv::Mat1b labels(400, 1280, std::uint8_t{label_terrain});
  labels(cv::Rect(600, 200, 13, 12)) = label_obstacle; // 156 pixels, 160 are 40 at 640 columns
  EXPECT_EQ(count_things(labels, labels).count, 0);
  labels(cv::Rect(600, 200, 16, 10)) = label_obstacle;
  EXPECT_EQ(count_things(labels, labels).count, 1);
}

TEST(EvalThings, LabelsWithoutAGroundAroundAreNone) {
  cv::Mat1b labels = open_plain();
  labels(cv::Rect(300, 100, 60, 60)) = label_sky;
  labels(cv::Rect(320, 120, 20, 20)) = label_obstacle;
  EXPECT_EQ(count_things(labels, labels).count, 0);
}

TEST(EvalRamp, IsTheBestOfItsGrid) {
  cv::Mat1b flat(400, 400, std::uint8_t{label_obstacle}), roof = flat.clone();
  flat.rowRange(180, 400) = label_terrain; // 0.45 of the height: in the grid
  for (int x = 0; x < 400; ++x)
    roof.col(x).rowRange(static_cast<int>(400 * (0.36 + 0.2 * std::abs(x / 400.0 - 0.5) * 2)), 400) =
        label_ground;
  EXPECT_NEAR(best_ramp_error({flat}), 0, 0.01);
  EXPECT_LT(best_ramp_error({roof}), 0.5);
  // Of both together: the best single edge between them is wrong somewhere.
  EXPECT_GT(best_ramp_error({flat, roof}), 1);
  cv::Mat1b unknown = flat.clone();
  unknown.rowRange(0, 180) = label_none;
  EXPECT_EQ(best_ramp_error({unknown}), 0); // everything above the edge is not asked for
}

TEST(EvalParallel, EachItemOnceAndTheFirstErrorComesOut) {
  std::vector<std::atomic<int>> seen(1000);
  for_each_in_parallel(seen.size(), [&](std::size_t item, std::size_t worker) {
    EXPECT_LT(worker, worker_count(seen.size()));
    ++seen[item];
  });
  for (const auto& s : seen)
    EXPECT_EQ(s, 1);
  EXPECT_EQ(worker_count(1), 1u);
  EXPECT_THROW(for_each_in_parallel(50,
                                    [](std::size_t item, std::size_t) {
                                      if (item == 7)
                                        throw std::runtime_error("seven");
                                    }),
               std::runtime_error);
}

TEST(EvalPicture, BackAndForthIsTheSamePicture) {
  for (const ColorRange range : {ColorRange::limited, ColorRange::full}) {
    const Picture picture =
        Picture::of(cv::Mat3b(31, 17, cv::Vec3b(40, 120, 200)), {range, ColorMatrix::bt601});
    const cv::Vec3b there = picture.bgr()(15, 8);
    const int tolerance = range == ColorRange::full ? 2 : 5; // GStreamer's short cut for limited range
    EXPECT_NEAR(there[0], 40, tolerance);
    EXPECT_NEAR(there[1], 120, tolerance);
    EXPECT_NEAR(there[2], 200, tolerance);
    // BT.601: 0.299 R + 0.587 G + 0.114 B = 134.8, in limited range 16 + 134.8 * 219 / 255.
    EXPECT_NEAR(picture.frame().planes[0].row(15)[8], range == ColorRange::full ? 134.8 : 131.8, 1.5);
    EXPECT_EQ(picture.size(), cv::Size(17, 31));
  }
}

class EvalSequence : public testing::Test {
 protected:
  EvalSequence() {
    fs::create_directories(folder_.path() / "frames");
    fs::create_directories(folder_.path() / "labels");
    for (int i = 0; i < 4; ++i) {
      cv::Mat3b picture(120, 160, cv::Vec3b(200, 170, 150));
      cv::Mat1b labels(120, 160, std::uint8_t{label_sky});
      picture.rowRange(50 + i, 120) = cv::Vec3b(70, 80, 90);
      labels.rowRange(50 + i, 120) = label_terrain;
      cv::RNG random(static_cast<std::uint64_t>(i + 1));
      cv::Mat grain(picture.size(), CV_8UC3);
      random.fill(grain, cv::RNG::UNIFORM, 0, 12);
      picture += grain;
      const std::string name = "000" + std::to_string(i) + ".png";
      cv::imwrite((folder_.path() / "frames" / name).string(), picture);
      cv::imwrite((folder_.path() / "labels" / name).string(), labels);
    }
    std::ofstream(folder_.path() / "sequence.json") << R"({"name": "x", "fps": 1.5, "window_bottom": 6})";
  }
  Figures run(const std::string& engine) {
    const Sequence sequence = open_sequence(folder_.path().string());
    return measure(sequence, read_all(sequence), engine, "as it is");
  }
  Folder folder_;
};

TEST_F(EvalSequence, IsReadAsDescribed) {
  const Sequence s = open_sequence(folder_.path().string(), {3, 1});
  EXPECT_EQ(s.size(), 3u);
  EXPECT_FALSE(s.stills);
  EXPECT_EQ(open_sequence(folder_.path().string(), {0, 3}).size(), 2u);
  EXPECT_EQ(s.fps, 1.5);
  EXPECT_EQ(s.window_bottom, 6);
  EXPECT_THROW(open_sequence((folder_.path() / "frames").string()), std::runtime_error);
  fs::remove_all(folder_.path() / "labels");
  EXPECT_THROW(open_sequence(folder_.path().string()), std::runtime_error);
}

TEST_F(EvalSequence, AColumnOfHorizonsIsHandedIn) {
  const auto describe = [&](const std::string& horizon) {
    std::ofstream(folder_.path() / "sequence.json")
        << R"({"fps": 1, "kind": "model", "stills": true, "horizon": )" << horizon << "}";
  };
  const auto row_of = [](const Sequence& s, std::size_t i) {
    return s.read(i).picture.frame().vanishing_row;
  };
  describe("0.5");
  const Sequence one = open_sequence(folder_.path().string());
  EXPECT_EQ(one.kind, "model");
  EXPECT_EQ(row_of(one, 3), 256 * 60);
  describe("[0.1, 0.2, 0.3, 0.75]");
  EXPECT_EQ(row_of(open_sequence(folder_.path().string()), 3), 256 * 90);
  EXPECT_EQ(row_of(open_sequence(folder_.path().string(), {0, 3}), 1), 256 * 90);
  // All ground begins below row 50: a line far below it takes most of it away.
  EXPECT_GT(run("default").frames.back().error, run("default,motion=off").frames.front().error + 10);
  describe("[0.1, 0.2]");
  EXPECT_THROW(open_sequence(folder_.path().string()), std::runtime_error);
}

TEST_F(EvalSequence, LabelsOfAnotherSizeAreRefused) {
  cv::imwrite((folder_.path() / "labels/0002.png").string(), cv::Mat1b(60, 80, std::uint8_t{label_terrain}));
  const Sequence s = open_sequence(folder_.path().string());
  try {
    s.read(2);
    FAIL() << "labels of 80x60 for a frame of 160x120";
  } catch (const std::runtime_error& error) {
    EXPECT_NE(std::string(error.what()).find("0002.png: 80x60"), std::string::npos) << error.what();
  }
}

TEST_F(EvalSequence, FilesThatAreNotPicturesAreNamed) {
  std::ofstream(folder_.path() / "frames/0001.png") << "no picture";
  try {
    open_sequence(folder_.path().string()).read(1);
    FAIL() << "a text file was decoded";
  } catch (const std::runtime_error& error) {
    EXPECT_NE(std::string(error.what()).find("0001.png"), std::string::npos) << error.what();
  }
  std::ofstream(folder_.path() / "sequence.json") << R"({"fps": "fast"})";
  EXPECT_THROW(open_sequence(folder_.path().string()), std::runtime_error);
}

TEST_F(EvalSequence, AStillIsScoredAloneAfterFourLooks) {
  std::ofstream(folder_.path() / "sequence.json") << R"({"fps": 1, "window_bottom": 6, "stills": true})";
  const Sequence s = open_sequence(folder_.path().string());
  ASSERT_TRUE(s.stills);
  const std::vector<Sample> samples = read_all(s);
  std::vector<cv::Mat1b> masks;
  const Figures all = measure(s, samples, "default", "as it is", &masks);
  EXPECT_TRUE(all.stills);
  ASSERT_EQ(all.frames.size(), 4u);
  EXPECT_FALSE(all.flicker); // other places, no flicker
  for (std::size_t i = 0; i < samples.size(); ++i) {
    Settings settings;
    settings.window_bottom = 6;
    Segmenter segmenter(settings);
    Frame frame = samples[i].picture.frame();
    for (int k = 0; k < 4; ++k) {
      frame.pts = k * 40'000'000;
      ASSERT_TRUE(segmenter.process(frame).ok());
    }
    const GrayView& mask = segmenter.estimate().mask;
    const cv::Mat view(mask.height, mask.width, CV_8UC1, const_cast<std::uint8_t*>(mask.plane.data),
                       static_cast<std::size_t>(mask.plane.stride));
    EXPECT_EQ(cv::norm(view, masks[i], cv::NORM_L1), 0) << i;
    EXPECT_EQ(all.frames[i].index, i);
  }
  // Without labels 2, terrain is all ground.
  EXPECT_EQ(all.mean_error(), all.mean_terrain_error());
  std::ostringstream table;
  write_stills(table, {all});
  EXPECT_NE(table.str().find("| 4 |"), std::string::npos) << table.str();
}

TEST(FilterSettings, RoundAsTheElementDoes) {
  EXPECT_EQ(filter_settings("paper,threshold=2.1", 0).threshold_q8, 538); // 537.6: was cut off to 537
  EXPECT_EQ(filter_settings("default,window-sigma=0.3", 0).window_sigma_q8, 77);
}

TEST(FilterSettings, StartFromThePresetAndTheSequence) {
  const Settings s = filter_settings("paper,free-space=true,caution=-8,texture=true,horizon=auto,seed=7", 6);
  EXPECT_EQ(s.mass_cap, 64);
  EXPECT_EQ(s.window_bottom, 6);
  EXPECT_EQ(s.caution, -8);
  EXPECT_TRUE(s.texture);
  EXPECT_EQ(s.horizon, HorizonMode::automatic);
  EXPECT_EQ(s.seed, 7u);
  EXPECT_EQ(filter_settings("default,window-bottom=9", 6).window_bottom, 9);
}

TEST(FilterSettings, ErrorsNameNameValueAndRule) {
  const auto error = [](const std::string& text) {
    try {
      filter_settings(text, 0);
    } catch (const std::runtime_error& e) {
      return std::string(e.what());
    }
    return std::string();
  };
  EXPECT_EQ(error("default,threshold=2x"), "threshold = 2x: not a number");
  EXPECT_EQ(error("default,caution=1.5"), "caution = 1.5: not a whole number");
  EXPECT_EQ(error("default,caution=101"), "caution = 101: outside -100..100");
  EXPECT_EQ(error("default,texture=yes"), "texture = yes: not one of false, true");
  EXPECT_EQ(error("default,horizon=low"), "horizon = low: not one of off, paper, auto");
  EXPECT_EQ(error("default,texture"), "texture = : not one of false, true");
  EXPECT_EQ(error("default,colour=red"), "colour = red: no such setting");
}

TEST_F(EvalSequence, EnginesDoWhatTheySay) {
  EXPECT_LT(run("default").ground.error(), 4);
  EXPECT_LT(run("paper").ground.error(), 20);
  EXPECT_LT(run("paper,input=BGR").ground.error(), 20);
  EXPECT_LT(run("reference").ground.error(), 20);
  EXPECT_LT(run("rows").ground.error(), 2); // rows 50 to 53 of 120: 0.43 fits best
  EXPECT_NEAR(run("rows:0.5").ground.error(), 100.0 * (60 - 51.5) / 120, 0.1);
  EXPECT_LT(run("mean-mask").ground.error(), 2.5);
  EXPECT_LE(run("ramp").ground.error(), run("rows").ground.error());
  EXPECT_EQ(run("default,learning=false").ground.recall(), 0); // the setting arrives: nothing is known
  EXPECT_EQ(run("masks:" + (folder_.path() / "labels").string()).ground.recall(), 0); // 1 is below 192
}

TEST_F(EvalSequence, MarksForReportsAreInFilesOnly) {
  EvalOptions options;
  options.sequences = {folder_.path().string()};
  options.engines = {"rows:0.43"};
  const std::string mark = "<!-- section engines -->";
  testing::internal::CaptureStdout();
  evaluate(options);
  const std::string shown = testing::internal::GetCapturedStdout();
  EXPECT_NE(shown.find("rows:0.43"), std::string::npos) << shown;
  EXPECT_EQ(shown.find("<!--"), std::string::npos) << shown;
  options.markdown = (folder_.path() / "tables.md").string();
  evaluate(options);
  std::ifstream file(options.markdown);
  const std::string written{std::istreambuf_iterator<char>(file), {}};
  EXPECT_NE(written.find(mark), std::string::npos) << written;
}

TEST_F(EvalSequence, MasksOfAPipelineBringTheirEstimates) {
  const fs::path all = folder_.path() / "written", own = all / folder_.path().filename();
  fs::create_directories(own);
  for (int i = 0; i < 4; ++i) {
    cv::Mat1b mask(120, 160, std::uint8_t{0});
    mask.rowRange(50 + i, 120) = 255;
    cv::imwrite((own / ("000" + std::to_string(i) + ".png")).string(), mask);
  }
  const std::string engine = "masks:" + all.string();
  Figures f = run(engine);
  EXPECT_EQ(f.ground.error(), 0);
  EXPECT_FALSE(f.horizon); // nobody said
  const auto write = [&](int lines, const char* last) {
    std::ofstream file(own / "estimates.ndjson");
    for (int i = 0; i < lines; ++i)
      file << R"({"frame": 0, "height": 240, "horizon": {"row": )" << 2 * (50 + i) + 12
           << R"(, "confidence": 9}, "confidence": 200})" << '\n';
    file << last;
  };
  write(3, R"({"height": 240, "horizon": {"row": null, "confidence": 0}, "confidence": 0})");
  f = run(engine);
  EXPECT_NEAR(f.horizon.value_or(Spread()).median, 5, 0.01); // 6 rows of 120
  EXPECT_EQ(f.horizon_null, 25);
  write(3, "");
  EXPECT_THROW(run(engine), std::runtime_error); // a line is missing
  write(4, "{\"height\": 1}");
  EXPECT_THROW(run(engine), std::runtime_error);
}

TEST(Rendered, PlacesNeedNoFolder) {
  const Sequence s = open_sequence("scene:trail:dusk:7", {25, 1});
  EXPECT_EQ(s.name, "trail dusk 7");
  ASSERT_EQ(s.size(), 25u);
  EXPECT_NEAR(s.fps, 10 / 3.0, 1e-9);
  const Sample first = s.read(0), other_place = s.read(20);
  ASSERT_EQ(first.picture.size(), first.labels.size());
  EXPECT_GT(cv::countNonZero(first.labels == label_terrain), 1000);
  EXPECT_GT(cv::norm(first.picture.bgr(), other_place.picture.bgr(), cv::NORM_L1), 0);
  EXPECT_EQ(cv::norm(first.picture.bgr(), s.read(0).picture.bgr(), cv::NORM_L1), 0);
  EXPECT_EQ(open_sequence("scene:road:day").size(), 120u);
  const Sequence wet = open_sequence("scene:road:sun+wet:7", {2, 1}),
                 dry = open_sequence("scene:road:sun:7", {2, 1});
  EXPECT_EQ(wet.name, "road sun+wet 7");
  EXPECT_EQ(cv::countNonZero(wet.read(1).labels != dry.read(1).labels), 0);
  EXPECT_GT(cv::norm(wet.read(1).picture.bgr(), dry.read(1).picture.bgr(), cv::NORM_L1), 0);
}

TEST(Rendered, DrivesRunAtThirtyHertzAndForgetBetweenSeeds) {
  const Sequence s = open_sequence("scene:plain:day:straight@160x90#7-8");
  EXPECT_EQ(s.name, "plain day straight@160x90#7-8");
  ASSERT_EQ(s.size(), 180u);
  EXPECT_EQ(s.fps, 30);
  EXPECT_EQ(s.run_length(), 90u);
  EXPECT_FALSE(s.is_scored(59));
  EXPECT_TRUE(s.is_scored(60));
  EXPECT_FALSE(s.is_scored(90));
  EXPECT_EQ(s.read(0).picture.size(), cv::Size(160, 90));
  // The second drive is that of the second seed, from its first frame.
  const Sequence second = open_sequence("scene:plain:day:straight@160x90#8");
  EXPECT_EQ(cv::norm(s.read(91).picture.bgr(), second.read(1).picture.bgr(), cv::NORM_L1), 0);
  const Figures both = measure(s, read_all(s), "default", "as it is"),
                alone = measure(second, read_all(second), "default", "as it is");
  ASSERT_EQ(both.frames.size(), 60u);
  ASSERT_EQ(alone.frames.size(), 30u);
  EXPECT_EQ(both.frames[30].index, 150u);
  for (std::size_t i = 0; i < 30; ++i)
    EXPECT_EQ(both.frames[30 + i].error, alone.frames[i].error) << i;
  EXPECT_GT(both.things.count, alone.things.count);
  EXPECT_THROW(measure(open_sequence("scene:plain:day:still@64x64", {60, 1}), {}, "default", "as it is"),
               std::runtime_error); // nothing is scored
}

TEST(Rendered, WhatThereIsIsSaid) {
  for (const char* wrong :
       {"scene:", "scene:road", "scene:road:noon", "scene:road:sun+dry", "scene:road:+wet", "scene:wood:day",
        "scene:road:day:x", "scene:road:day:1:2", "scene:road:day:fly", "scene:road:day:turn@10x10",
        "scene:road:day:turn@640", "scene:road:day:turn#8-7", "scene:road:day:turn#1-99999",
        "scene:road:day@640x360", "scene:road:day:99999999999999999999"})
    EXPECT_THROW(open_sequence(wrong), std::runtime_error) << wrong;
  EXPECT_THROW(open_sequence("scene:road:day", {0, 2}), std::runtime_error);
}

TEST_F(EvalSequence, WrongNamesAreNamed) {
  for (const char* engine : {"nonsense", "default,texture=maybe", "default,colour=1", "default,caution=101",
                             "rows:x", "reference,texture=false", "default,caution=2x", "masks:/nowhere"})
    EXPECT_THROW(run(engine), std::runtime_error) << engine;
}

// Nobody measures a setting that nothing reads.
TEST_F(EvalSequence, SettingsWithoutEffectAreNamed) {
  for (const char* engine : {"default,threshold=2.1", "default,bit-shift=3", "paper,texture=true",
                             "default,free-space=false,geodesic=true", "paper,doubtful=3"})
    try {
      filter_settings(engine, 0);
      ADD_FAILURE() << engine;
    } catch (const std::runtime_error& error) {
      const std::string told = error.what(), words = engine;
      const std::size_t name = words.rfind(',') + 1;
      EXPECT_NE(told.find(words.substr(name, words.rfind('=') - name) + " has "), std::string::npos) << told;
    }
  for (const char* engine : {"paper,texture=false", "paper,threshold=2.1", "default,motion=off",
                             "default,threshold=2.1,free-space=false", "paper,window-bottom=4"})
    EXPECT_NO_THROW(run(engine)) << engine;
}

TEST(Sheet, ShowsEachFrameOnce) {
  using Frames = std::vector<int>;
  EXPECT_EQ(frames_of_sheet(0), Frames());
  EXPECT_EQ(frames_of_sheet(3), (Frames{0, 1, 2}));
  EXPECT_EQ(frames_of_sheet(5), (Frames{0, 1, 2, 3, 4}));
  EXPECT_EQ(frames_of_sheet(12), (Frames{0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11}));
  EXPECT_EQ(frames_of_sheet(100), (Frames{0, 1, 2, 3, 48, 49, 50, 51, 96, 97, 98, 99}));
}

} // namespace
} // namespace terrainseg::eval
