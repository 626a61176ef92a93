// SPDX-License-Identifier: LGPL-2.1-or-later
// terrainseg-eval: figures worked out by hand, perturbations, the paired test, files that are not what they
// should be.
#include <filesystem>
#include <fstream>
#include <random>
#include <sstream>

#include <gtest/gtest.h>
#include <opencv2/imgcodecs.hpp>

#include "tools/eval/comparison.hpp"
#include "tools/eval/engines.hpp"
#include "tools/eval/figures.hpp"
#include "tools/eval/perturbations.hpp"
#include "tools/eval/report.hpp"
#include "tools/eval/sequence.hpp"

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
  for (const cv::Mat1b& m : masks)
    scorer.add({m, 0.5, true, 100, 1.5}, labels);
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
  EXPECT_NEAR(*f.horizon.median, 100 * (0.5 - 0.4), 1e-9);
  EXPECT_NEAR(*f.boundary_within, 100.0 * 25 / 30, 1e-9);
  EXPECT_NEAR(*f.boundary_over, 100.0 * 5 / 30, 1e-9);
  EXPECT_NEAR(*f.latency.median, 1.5, 1e-9);
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
    write_json(file, {f, f});
  }
  const auto back = read_json(path);
  ASSERT_EQ(back.size(), 2u);
  EXPECT_EQ(back[0].engine, f.engine);
  ASSERT_EQ(back[0].frames.size(), 3u);
  EXPECT_NEAR(back[0].frames[2].error, f.frames[2].error, 1e-3);
  std::ostringstream table;
  write_comparison(table, back, back);
  EXPECT_NE(table.str().find("no difference shown"), std::string::npos);
  EXPECT_THROW(read_json((folder.path() / "none.json").string()), std::runtime_error);
  std::ofstream(folder.path() / "bad.json") << "{\"runs\": [{\"engine\": 3}]}";
  EXPECT_THROW(read_json((folder.path() / "bad.json").string()), std::runtime_error);
}

TEST(EvalPerturbations, EachChangesThePictureAndKeepsItsLabelsInStep) {
  Sample sample;
  sample.labels = cv::Mat1b(240, 320, std::uint8_t{label_obstacle});
  sample.labels.rowRange(100, 240) = label_terrain;
  sample.picture = cv::Mat3b(240, 320, cv::Vec3b(220, 180, 160));
  sample.picture.rowRange(100, 240) = cv::Vec3b(60, 70, 80);
  for (int y = 0; y < 240; ++y)
    for (int x = y % 7; x < 320; x += 7)
      sample.picture(y, x) += cv::Vec3b(9, 9, 9);
  for (const std::string& name : perturbation_names()) {
    if (name == "h264")
      continue; // needs an encoder
    std::vector<Sample> samples{{sample.picture.clone(), sample.labels.clone()}};
    perturb(name, samples);
    const Sample& s = samples[0];
    ASSERT_EQ(s.picture.size(), s.labels.size()) << name;
    const bool changed =
        s.picture.size() != sample.picture.size() || cv::norm(s.picture, sample.picture, cv::NORM_L1) > 0;
    EXPECT_TRUE(changed) << name;
    // Where the label says ground the picture is darker than half a step between both, near enough.
    int agree = 0, known = 0;
    const double middle = name == "dark" ? 60 : name == "bright" ? 170 : 120;
    for (int y = 0; y < s.labels.rows; ++y)
      for (int x = 0; x < s.labels.cols; ++x) {
        if (s.labels(y, x) == label_none)
          continue;
        ++known;
        agree += (s.labels(y, x) == label_terrain) == (s.picture(y, x)[1] < middle);
      }
    EXPECT_GT(agree, known * 0.98) << name;
  }
  std::vector<Sample> samples{sample};
  EXPECT_THROW(perturb("sepia", samples), std::runtime_error);
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
    const Sequence sequence = open_sequence(folder_.path().string(), 0);
    std::vector<cv::Mat1b> labels;
    for (std::size_t i = 0; i < sequence.size(); ++i)
      labels.push_back(sequence.read(i).labels);
    const auto e = make_engine(engine, sequence, labels);
    Scorer scorer(sequence.name, engine, "as it is");
    for (std::size_t i = 0; i < sequence.size(); ++i)
      scorer.add(e->look(sequence.read(i).picture, i), labels[i]);
    return scorer.finish();
  }
  Folder folder_;
};

TEST_F(EvalSequence, IsReadAsDescribed) {
  const Sequence s = open_sequence(folder_.path().string(), 3);
  EXPECT_EQ(s.size(), 3u);
  EXPECT_EQ(s.fps, 1.5);
  EXPECT_EQ(s.window_bottom, 6);
  EXPECT_THROW(open_sequence((folder_.path() / "frames").string(), 0), std::runtime_error);
  fs::remove_all(folder_.path() / "labels");
  EXPECT_THROW(open_sequence(folder_.path().string(), 0), std::runtime_error);
}

TEST_F(EvalSequence, EnginesDoWhatTheySay) {
  EXPECT_LT(run("default").ground.error(), 4);
  EXPECT_LT(run("paper").ground.error(), 20);
  EXPECT_LT(run("reference").ground.error(), 20);
  EXPECT_LT(run("rows").ground.error(), 2); // rows 50 to 53 of 120: 0.43 fits best
  EXPECT_NEAR(run("rows:0.5").ground.error(), 100.0 * (60 - 51.5) / 120, 0.1);
  EXPECT_LT(run("mean-mask").ground.error(), 2.5);
  EXPECT_LE(run("ramp").ground.error(), run("rows").ground.error());
  EXPECT_EQ(run("default,learning=false").ground.recall(), 0); // the setting arrives: nothing is known
  EXPECT_EQ(run("masks:" + (folder_.path() / "labels").string()).ground.recall(), 0); // 1 is below 192
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
  EXPECT_FALSE(f.horizon.median); // nobody said
  const auto write = [&](int lines, const char* last) {
    std::ofstream file(own / "estimates.ndjson");
    for (int i = 0; i < lines; ++i)
      file << R"({"frame": 0, "height": 240, "horizon": {"row": )" << 2 * (50 + i) + 12
           << R"(, "confidence": 9}, "confidence": 200})" << '\n';
    file << last;
  };
  write(3, R"({"height": 240, "horizon": {"row": null, "confidence": 0}, "confidence": 0})");
  f = run(engine);
  EXPECT_NEAR(f.horizon.median.value_or(0), 5, 0.01); // 6 rows of 120
  EXPECT_EQ(f.horizon_null, 25);
  write(3, "");
  EXPECT_THROW(run(engine), std::runtime_error); // a line is missing
  write(4, "{\"height\": 1}");
  EXPECT_THROW(run(engine), std::runtime_error);
}

TEST(Rendered, SequencesNeedNoFolder) {
  const Sequence s = open_sequence("scene:trail:dusk:7", 25);
  EXPECT_EQ(s.name, "trail dusk");
  ASSERT_EQ(s.size(), 25u);
  EXPECT_NEAR(s.fps, 10 / 3.0, 1e-9);
  const Sample first = s.read(0), other_place = s.read(20);
  ASSERT_EQ(first.picture.size(), first.labels.size());
  EXPECT_GT(cv::countNonZero(first.labels == label_terrain), 1000);
  EXPECT_GT(cv::norm(first.picture, other_place.picture, cv::NORM_L1), 0);
  EXPECT_EQ(cv::norm(first.picture, s.read(0).picture, cv::NORM_L1), 0);
  EXPECT_EQ(open_sequence("scene:road:day", 0).size(), 120u);
  for (const char* wrong : {"scene:", "scene:road", "scene:road:noon", "scene:wood:day", "scene:road:day:x",
                            "scene:road:day:1:2"})
    EXPECT_THROW(open_sequence(wrong, 0), std::runtime_error) << wrong;
}

TEST_F(EvalSequence, WrongNamesAreNamed) {
  for (const char* engine : {"nonsense", "default,texture=maybe", "default,colour=1", "default,caution=99",
                             "rows:x", "reference,texture=false", "default,caution=2x", "masks:/nowhere"})
    EXPECT_THROW(run(engine), std::runtime_error) << engine;
}

} // namespace
} // namespace terrainseg::eval
