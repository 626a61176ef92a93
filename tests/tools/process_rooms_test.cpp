// SPDX-License-Identifier: LGPL-2.1-or-later
// The rooms of terrainseg-process that need no pipeline.
#include <gtest/gtest.h>
#include <stdlib.h>

#include <filesystem>
#include <fstream>
#include <string>

#include "tools/process/container.hpp"
#include "tools/process/display.hpp"
#include "tools/process/inputs.hpp"
#include "tools/process/outputs.hpp"

namespace terrainseg::process {
namespace {

namespace fs = std::filesystem;

class InFolder : public testing::Test {
 protected:
  InFolder() {
    std::string name = (fs::temp_directory_path() / "terrainseg-XXXXXX").string();
    folder = mkdtemp(name.data());
  }
  ~InFolder() override { fs::remove_all(folder); }

  fs::path write(const std::string& name, const std::string& bytes = "x") const {
    fs::create_directories((folder / name).parent_path());
    std::ofstream(folder / name, std::ios::binary) << bytes;
    return folder / name;
  }
  std::string read(const fs::path& path) const {
    std::ifstream file(path, std::ios::binary);
    return {std::istreambuf_iterator<char>(file), {}};
  }

  fs::path folder;
};

// ---- container

std::string number(std::uint64_t value, int bytes, bool big) {
  std::string text;
  for (int i = 0; i < bytes; ++i)
    text += static_cast<char>(value >> 8 * (big ? bytes - 1 - i : i) & 0xff);
  return text;
}

std::string box(const std::string& type, const std::string& payload) {
  return number(8 + payload.size(), 4, true) + type + payload;
}

using Container = InFolder;

TEST_F(Container, IsoMediaEndsWithItsLastBox) {
  const std::string head = box("ftyp", "isom0000") + box("moov", std::string(30, 'm'));
  const std::string wide = number(1, 4, true) + "mdat" + number(16 + 50, 8, true);
  const std::string whole = head + wide + std::string(50, 'd');
  EXPECT_FALSE(missing_length(write("whole.mp4", whole)));
  EXPECT_EQ(missing_length(write("cut.mp4", whole.substr(0, whole.size() - 1))), whole.size());
  EXPECT_EQ(missing_length(write("head.mp4", head + wide.substr(0, 16))), whole.size());
  EXPECT_FALSE(missing_length(write("open.mp4", head + number(0, 4, true) + "mdat" + std::string(9, 'd'))))
      << "a last box of length 0 reaches to the end";
  EXPECT_FALSE(missing_length(write("tail.mp4", whole + std::string(20, '\0'))))
      << "padding behind the last box";
  EXPECT_FALSE(missing_length(write("huge.mp4", head + number(1, 4, true) + "mdat" + std::string(8, '\xff'))))
      << "a length that overflows says nothing";
}

TEST_F(Container, RiffEndsWithItsLastChunk) {
  const std::string first = "RIFF" + number(40, 4, false) + "AVI " + std::string(36, 'a');
  const std::string second = "RIFF" + number(24, 4, false) + "AVIX" + std::string(20, 'b');
  EXPECT_FALSE(missing_length(write("one.avi", first)));
  EXPECT_FALSE(missing_length(write("two.avi", first + second)));
  EXPECT_EQ(missing_length(write("cut.avi", (first + second).substr(0, 70))), first.size() + second.size());
  EXPECT_FALSE(
      missing_length(write("unfinished.avi", "RIFF" + number(0, 4, false) + "AVI " + std::string(99, 'a'))));
}

TEST_F(Container, MatroskaEndsWithItsSegment) {
  const std::string head = "\x1a\x45\xdf\xa3\x84" + std::string("webm");
  const std::string segment =
      "\x18\x53\x80\x67" + number(0x0100000000000000 + 30, 8, true) + std::string(30, 's');
  EXPECT_FALSE(missing_length(write("whole.mkv", head + segment)));
  EXPECT_EQ(missing_length(write("cut.mkv", (head + segment).substr(0, 30))), head.size() + segment.size());
  EXPECT_FALSE(
      missing_length(write("live.mkv", head + "\x18\x53\x80\x67\x01" + std::string(7, '\xff') + "data")))
      << "a stream of unknown length";
}

TEST_F(Container, OthersSayNothing) {
  EXPECT_FALSE(missing_length(write("noise", std::string(5000, 'n'))));
  EXPECT_FALSE(missing_length(write("empty", "")));
  EXPECT_FALSE(missing_length(folder / "absent"));
  EXPECT_FALSE(missing_length(folder));
}

// ---- display

TEST(Display, DurationsReadLikeAClock) {
  EXPECT_EQ(duration_text(0), "0:00");
  EXPECT_EQ(duration_text(59.4), "0:59");
  EXPECT_EQ(duration_text(61), "1:01");
  EXPECT_EQ(duration_text(3600 + 62), "1:01:02");
  EXPECT_EQ(duration_text(-3), "0:00");
}

Moment moment() {
  Moment moment;
  moment.done = 2;
  moment.inputs = 12;
  moment.name = "recordings/clip.mp4";
  moment.frames = 312;
  moment.fps = 50;
  moment.permille = 430;
  moment.whole_permille = 250;
  moment.seconds = 20;
  return moment;
}

TEST(Display, TheRateIsThatOfTheLastSeconds) {
  Rate rate;
  EXPECT_EQ(rate.at(0, 0), 0);
  EXPECT_EQ(rate.at(1, 100), 100);
  for (int second = 2; second <= 10; ++second)
    rate.at(second, 100 + 10 * (second - 1));
  EXPECT_NEAR(rate.at(11, 200), 10, 0.5) << "the fast second is long ago";
}

TEST(Display, TheLineSaysWhatIsKnown) {
  EXPECT_EQ(plain_line(moment()), "[3/12] recordings/clip.mp4:  43 %  312 frames  50.0 fps  1:00 left");
  Moment unknown = moment();
  unknown.permille = unknown.whole_permille = -1;
  EXPECT_EQ(plain_line(unknown), "[3/12] recordings/clip.mp4:   ? %  312 frames  50.0 fps");
}

int columns(const std::string& text) {
  int count = 0;
  for (const char c : text)
    count += (c & 0xc0) != 0x80;
  return count;
}

TEST(Display, TheBarFitsEveryTerminal) {
  Moment wide = moment();
  wide.name = "ein/sehr/langer/Weg/über/Grün/und/durch/Täler/Wiese.mp4";
  for (int width = 0; width < 200; ++width)
    EXPECT_LE(columns(bar_line(wide, width)), width) << width;
  EXPECT_NE(bar_line(wide, 100).find("~"), std::string::npos) << "a cut name is marked";
  EXPECT_NE(bar_line(moment(), 120).find("[############------------------]"), std::string::npos)
      << bar_line(moment(), 120);
}

TEST(Display, NamesDoNotDriveTheTerminal) {
  Moment hostile = moment();
  hostile.name = "a\x1b[2J\nb\r.mp4";
  for (const std::string& line : {plain_line(hostile), bar_line(hostile, 120)})
    for (const char letter : line)
      EXPECT_GE(static_cast<unsigned char>(letter), 0x20) << line;
}

// ---- inputs

using Inputs = InFolder;

TEST_F(Inputs, PatternsTakeExactlyTheirNumbers) {
  for (const char* name : {"f0001.png", "f0002.png", "f0010.png", "f12345.png", "f001.png", "f00003.png",
                           "g0001.png", "f0001.jpg", "f-001.png", "f000x.png"})
    write(name);
  const auto inputs = find_inputs({(folder / "f%04d.png").string()});
  ASSERT_EQ(inputs.size(), 1u);
  ASSERT_EQ(inputs[0].problem, "");
  std::vector<std::string> names;
  for (const auto& image : inputs[0].images)
    names.push_back(image.filename());
  EXPECT_EQ(names, (std::vector<std::string>{"f0001.png", "f0002.png", "f0010.png", "f12345.png"}));
}

TEST_F(Inputs, AnExistingFileIsNoPattern) {
  write("100%d.mp4");
  const auto inputs = find_inputs({(folder / "100%d.mp4").string()});
  ASSERT_EQ(inputs.size(), 1u);
  EXPECT_EQ(inputs[0].kind, Input::Kind::file);
  EXPECT_EQ(inputs[0].stem, "100%d");
}

TEST_F(Inputs, FoldersAreReadInNaturalOrderWithoutOwnOutputs) {
  for (const char* name :
       {"v10.mp4", "v2.MP4", "v2.annotated.mp4", "v2.masks.mkv", ".hidden.mp4", "notes.txt"})
    write(name);
  const auto inputs = find_inputs({folder.string()});
  ASSERT_EQ(inputs.size(), 2u);
  EXPECT_EQ(inputs[0].stem, "v2");
  EXPECT_EQ(inputs[1].stem, "v10");
}

TEST_F(Inputs, StemsDifferAlways) {
  for (const char* name : {"a/x.mp4", "b/x.mp4", "a/x.avi", "a_x.mp4", "c/a/x.mp4", "a/x.mp4.mp4"})
    write(name);
  std::vector<std::string> arguments;
  for (const char* name : {"a/x.mp4", "b/x.mp4", "a/x.avi", "a_x.mp4", "c/a/x.mp4", "a/x.mp4.mp4", "a/x.mp4"})
    arguments.push_back((folder / name).string());
  const auto inputs = find_inputs(arguments);
  ASSERT_EQ(inputs.size(), 6u) << "the same file twice is one input";
  for (std::size_t i = 0; i < inputs.size(); ++i)
    for (std::size_t j = 0; j < i; ++j)
      EXPECT_NE(inputs[i].stem, inputs[j].stem);
}

TEST_F(Inputs, UrisGiveSafeNames) {
  EXPECT_EQ(find_inputs({"rtsp://rover:8554/front cam?x=/.."})[0].stem, "front_cam");
  EXPECT_EQ(find_inputs({"rtsp://rover:8554/front"})[0].stem, "front");
  EXPECT_EQ(find_inputs({"http://host/a/b.mp4?token=1#x"})[0].stem, "b");
  for (const auto& input : find_inputs({"udp://127.0.0.1:5000", "x://y/.."}))
    EXPECT_EQ(input.stem.find('/'), std::string::npos);
}

TEST_F(Inputs, IdentityFollowsTheContent) {
  const auto path = write("clip.mp4", "12345");
  const auto before = find_inputs({path.string()})[0].identity();
  EXPECT_EQ(before.bytes, 5u);
  EXPECT_NE(before.changed, 0);
  fs::last_write_time(path, fs::last_write_time(path) + std::chrono::seconds(1));
  EXPECT_NE(find_inputs({path.string()})[0].identity(), before);
}

// ---- outputs

using Outputs = InFolder;

TEST_F(Outputs, AFileAppearsWholeOrNotAtAll) {
  const auto path = write("out", "old");
  {
    AtomicFile file;
    ASSERT_FALSE(file.open(path));
    file.write("new");
    EXPECT_EQ(file.size(), 3u);
    EXPECT_EQ(read(path), "old");
  }
  EXPECT_EQ(read(path), "old") << "given up";
  EXPECT_FALSE(fs::exists(folder / "out.part"));
  AtomicFile file;
  ASSERT_FALSE(file.open(path));
  file.write(std::string(200'000, 'n'));
  ASSERT_FALSE(file.commit(path));
  EXPECT_EQ(read(path), std::string(200'000, 'n'));
  EXPECT_FALSE(fs::exists(folder / "out.part"));
}

TEST_F(Outputs, WhatAKilledRunLeftIsReused) {
  write("out.part", "half of somethi");
  AtomicFile file;
  ASSERT_FALSE(file.open(folder / "out"));
  file.write("whole");
  ASSERT_FALSE(file.commit(folder / "out"));
  EXPECT_EQ(read(folder / "out"), "whole");
}

TEST_F(Outputs, TwoNeverWriteTheSameFile) {
  AtomicFile first, second;
  ASSERT_FALSE(first.open(folder / "out"));
  const auto problem = second.open(folder / "out");
  ASSERT_TRUE(problem);
  EXPECT_NE(problem->find("another run"), std::string::npos);
  ASSERT_FALSE(first.commit(folder / "out"));
  EXPECT_FALSE(second.open(folder / "out")) << "free again";
}

TEST_F(Outputs, FailuresNameTheFile) {
  AtomicFile file;
  const auto missing = file.open(folder / "no" / "out");
  ASSERT_TRUE(missing);
  EXPECT_NE(missing->find("no/out"), std::string::npos);
  EXPECT_TRUE(file.open(folder)) << "a folder is no file";
  EXPECT_TRUE(prepare_folder(write("file") / "sub"));
  EXPECT_FALSE(prepare_folder(folder / "a" / "b"));
}

TEST_F(Outputs, NamesTellWholeFromPartial) {
  const Naming naming(folder, "clip");
  EXPECT_EQ(naming.output(Output::masks).filename(), "clip.masks.mkv");
  EXPECT_EQ(naming.output(Output::masks, true).filename(), "clip.partial.masks.mkv");
  EXPECT_EQ(naming.record().filename(), "clip.summary.json");
  const Naming bare(folder, "");
  EXPECT_EQ(bare.output(Output::json).filename(), "terrain.jsonl");
  EXPECT_EQ(bare.output(Output::annotated, true).filename(), "partial.annotated.mp4");
}

} // namespace
} // namespace terrainseg::process
