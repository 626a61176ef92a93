// SPDX-License-Identifier: LGPL-2.1-or-later
// The rooms of terrainseg-process that need no pipeline.
#include <gtest/gtest.h>
#include <locale.h>
#include <signal.h>
#include <stdlib.h>
#include <wchar.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <set>
#include <string>
#include <vector>

#include "tools/command_line.hpp"
#include "tools/process/container.hpp"
#include "tools/process/display.hpp"
#include "tools/process/faults.hpp"
#include "tools/process/inputs.hpp"
#include "tools/process/manifest.hpp"
#include "tools/process/options.hpp"
#include "tools/process/outputs.hpp"
#include "tools/process/source.hpp"
#include "tools/process/worker.hpp"

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

std::string full_box(const std::string& type, const std::string& payload) {
  return box(type, std::string(4, '\0') + payload);
}

std::string words(std::initializer_list<std::uint32_t> values) {
  std::string text;
  for (const std::uint32_t value : values)
    text += number(value, 4, true);
  return text;
}

/// A movie of one video track of ten frames, 100 ticks of a thousandth each, with these edits.
std::string movie(const std::string& edits) {
  const std::string table = box("stbl", full_box("stts", words({1, 10, 100})));
  const std::string media = box("mdia", full_box("mdhd", words({0, 0, 1000, 1000, 0})) +
                                            full_box("hdlr", words({0}) + "vide") + box("minf", table));
  const std::string list = edits.empty() ? "" : box("edts", full_box("elst", edits));
  return box("ftyp", "isom0000") +
         box("moov", full_box("mvhd", words({0, 0, 1000, 1000})) +
                         box("trak", full_box("tkhd", words({0, 0, 7, 0, 1000})) + list + media));
}

TEST_F(Container, TheTablesOfAMovieSayWhatItShows) {
  constexpr std::uint32_t once = 1 << 16, nothing = UINT32_MAX;
  const auto track = [this](const std::string& edits) {
    const auto tracks = iso_video_tracks(write("movie.mp4", movie(edits)));
    return tracks.empty() ? IsoTrack{} : tracks.front();
  };
  EXPECT_EQ(track("").shown_frames(), 10u);
  EXPECT_EQ(track("").id, 7u);
  EXPECT_FALSE(track(words({1, 1000, 0, once})).followed_here()) << "all is shown";
  const IsoTrack trimmed = track(words({2, 500, nothing, once, 400, 250, once}));
  EXPECT_EQ(trimmed.shown_frames(), 4u) << "300 to 600";
  EXPECT_TRUE(trimmed.followed_here());
  EXPECT_FALSE(trimmed.shown_at(200'000'000));
  EXPECT_EQ(trimmed.shown_at(300'000'000), 550'000'000u);
  EXPECT_FALSE(track(words({2, 200, 600, once, 200, 0, once})).followed_here()) << "back in time";
  EXPECT_EQ(track(words({2, 200, 600, once, 200, 0, once})).shown_frames(), 4u);
  EXPECT_FALSE(track(words({1, 400, 250, 2 * once})).followed_here()) << "at double speed";
  EXPECT_EQ(track(words({1, 0, 250, once})).shown_frames(), 7u) << "as long as there is something";
  const std::string whole = movie(words({1, 400, 250, once}));
  for (std::size_t length = 0; length < whole.size(); ++length)
    iso_video_tracks(write("cut.mp4", whole.substr(0, length)));
}

TEST_F(Container, AGifEndsWithItsMark) {
  const std::string head = "GIF89a" + std::string(20, '\1');
  EXPECT_FALSE(lacks_end_mark(write("whole.gif", head + ";")));
  EXPECT_TRUE(lacks_end_mark(write("cut.gif", head)));
  EXPECT_FALSE(lacks_end_mark(write("none.mp4", std::string(40, 'x'))));
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
  unknown.frames = 1;
  EXPECT_EQ(plain_line(unknown), "[3/12] recordings/clip.mp4:   ? %  1 frame  50.0 fps");
}

/// Columns of a terminal by the C library: an oracle apart from GLib's tables.
int columns(const std::string& text) {
  const locale_t utf8 = newlocale(LC_CTYPE_MASK, "C.UTF-8", nullptr);
  const locale_t before = uselocale(utf8);
  int count = 0;
  mbstate_t state{};
  for (std::size_t at = 0; at < text.size();) {
    wchar_t code = 0;
    const std::size_t bytes = mbrtowc(&code, text.data() + at, text.size() - at, &state);
    EXPECT_LE(bytes, text.size()) << "a character was split";
    if (bytes == 0 || bytes > text.size())
      break;
    count += std::max(wcwidth(code), 0);
    at += bytes;
  }
  uselocale(before);
  freelocale(utf8);
  return count;
}

TEST(Display, TheBarFitsEveryTerminal) {
  Moment wide = moment();
  for (const char* name : {"ein/sehr/langer/Weg/über/Grün/und/durch/Täler/Wiese.mp4",
                           "録画/月曜日の朝/山の道を下る長い走行の記録.mp4", "한국/산길/주행기록/아침.mp4"}) {
    wide.name = name;
    for (int width = 0; width < 200; ++width)
      EXPECT_LE(columns(bar_line(wide, width)), width) << name << " " << width;
    EXPECT_NE(bar_line(wide, 72).find("~"), std::string::npos) << "a cut name is marked";
  }
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
  const auto inputs = find_inputs({(folder / "f%04d.png").string()}).inputs;
  ASSERT_EQ(inputs.size(), 1u);
  ASSERT_EQ(inputs[0].fault.text, "");
  std::vector<std::string> names;
  for (const auto& image : inputs[0].images)
    names.push_back(image.filename());
  EXPECT_EQ(names, (std::vector<std::string>{"f0001.png", "f0002.png", "f0010.png", "f12345.png"}));
}

TEST_F(Inputs, AnExistingFileIsNoPattern) {
  write("100%d.mp4");
  const auto inputs = find_inputs({(folder / "100%d.mp4").string()}).inputs;
  ASSERT_EQ(inputs.size(), 1u);
  EXPECT_EQ(inputs[0].kind, Input::Kind::file);
  EXPECT_EQ(inputs[0].stem, "100%d");
}

std::vector<std::string> stems(const Found& found) {
  std::vector<std::string> names;
  for (const Input& input : found.inputs)
    names.push_back(input.stem);
  return names;
}

TEST_F(Inputs, FoldersAreReadToTheirDepthsInNaturalOrder) {
  for (const char* name :
       {"v10.mp4", "v2.MP4", "v2.annotated.mp4", "v2.masks.mkv", ".hidden.mp4", "notes.txt",
        "monday/am/v1.mkv", "monday/frames/2.png", "monday/frames/10.png", ".git/v.mp4"})
    write(name);
  fs::create_directory_symlink(folder, folder / "monday" / "loop");
  const auto found = find_inputs({folder.string() + "/"});
  EXPECT_EQ(stems(found), (std::vector<std::string>{"monday/am/v1", "v2", "v10", "monday/frames"}));
  EXPECT_EQ(found.inputs.back().images.size(), 2u);
  EXPECT_EQ(found.inputs.back().images.front().filename(), "2.png");
  ASSERT_EQ(found.notes.size(), 1u);
  EXPECT_NE(found.notes[0].find("left out 6 members"), std::string::npos) << found.notes[0];
}

TEST_F(Inputs, ANameDependsOnTheInputAlone) {
  for (const char* name : {"a/x.mp4", "b/x.mp4", "a/x.avi", "c/f0.png", "c/f1.png"})
    write(name);
  const auto at = [this](const char* name) { return (folder / name).string(); };
  const std::vector<std::string> all = {at("a/x.mp4"), at("b/x.mp4"), at("a/x.avi"), at("c/f%d.png")};
  for (const Names names : {Names::base, Names::path, Names::hash}) {
    const auto together = stems(find_inputs(all, names));
    ASSERT_EQ(together.size(), all.size());
    for (std::size_t i = 0; i < all.size(); ++i)
      EXPECT_EQ(stems(find_inputs({all[i]}, names))[0], together[i]);
  }
  EXPECT_EQ(stems(find_inputs(all)), (std::vector<std::string>{"x", "x", "x", "c"}));
  const std::string inside = folder.relative_path().string();
  EXPECT_EQ(stems(find_inputs(all, Names::path)),
            (std::vector<std::string>{inside + "/a/x", inside + "/b/x", inside + "/a/x", inside + "/c"}));
  const auto hashed = stems(find_inputs(all, Names::hash));
  EXPECT_EQ(std::set<std::string>(hashed.begin(), hashed.end()).size(), 4u);
  EXPECT_EQ(find_inputs({at("a/x.mp4"), at("b/../a/x.mp4")}).inputs.size(), 1u) << "one file twice";
}

TEST_F(Inputs, APathNeverLeadsOutOfTheOutputFolder) {
  write("x.mp4");
  write("a/b/y.mp4");
  const fs::path before = fs::current_path();
  fs::current_path(folder / "a" / "b");
  for (const char* argument : {"../../x.mp4", "../../a/../x.mp4", "./y.mp4", "../b/./y.mp4"}) {
    const auto found = find_inputs({argument}, Names::path);
    ASSERT_EQ(found.inputs.size(), 1u);
    EXPECT_EQ(found.inputs[0].fault.text, "") << argument;
    EXPECT_FALSE(fs::path(found.inputs[0].stem).is_absolute()) << argument;
    for (const auto& part : fs::path(found.inputs[0].stem))
      EXPECT_NE(part, "..") << argument;
    EXPECT_NE(found.inputs[0].stem, "") << argument;
  }
  fs::current_path(before);
}

TEST_F(Inputs, AFileUriIsTheFile) {
  const auto path = write("a b.mp4");
  const auto found = find_inputs({"file://" + folder.string() + "/a%20b.mp4", path.string()});
  ASSERT_EQ(found.inputs.size(), 1u);
  EXPECT_EQ(found.inputs[0].kind, Input::Kind::file);
  EXPECT_EQ(found.inputs[0].path, path);
}

TEST_F(Inputs, WhatIsNoUriIsAFileThatIsNotThere) {
  for (const char* argument : {"://x", "1x://y", "a b://c", "clip:1.mp4", "a:b"})
    EXPECT_NE(find_inputs({argument}).inputs[0].fault.text, "") << argument;
  for (const char* argument : {"rtsp://x", "x+y.z-1://q"})
    EXPECT_EQ(find_inputs({argument}).inputs[0].kind, Input::Kind::uri) << argument;
}

TEST_F(Inputs, UrisGiveSafeNames) {
  EXPECT_EQ(find_inputs({"rtsp://rover:8554/front cam?x=/.."}).inputs[0].stem, "front_cam");
  EXPECT_EQ(find_inputs({"rtsp://rover:8554/front"}).inputs[0].stem, "front");
  EXPECT_EQ(find_inputs({"http://host/a/b.mp4?token=1#x"}).inputs[0].stem, "b");
  for (const auto& input : find_inputs({"udp://127.0.0.1:5000", "x://y/.."}).inputs)
    EXPECT_EQ(input.stem.find('/'), std::string::npos);
}

TEST_F(Inputs, IdentityFollowsTheContent) {
  const auto path = write("clip.mp4", std::string(3'000'000, 'a'));
  const auto identity_of = [](const fs::path& file) {
    return find_inputs({file.string()}).inputs[0].identity();
  };
  const auto identity = [&] { return identity_of(path); };
  const Identity before = identity();
  EXPECT_EQ(before.bytes, 3'000'000u);
  EXPECT_EQ(before.fingerprint.size(), 64u);
  fs::last_write_time(path, fs::last_write_time(path) + std::chrono::seconds(1));
  EXPECT_EQ(identity(), before) << "touched";
  fs::create_directory(folder / "staged");
  fs::copy_file(path, folder / "staged" / "other.mp4");
  EXPECT_EQ(identity_of(folder / "staged" / "other.mp4"), before) << "staged";
  for (const int position :
       {0, 60'000, 1'500'000, 2'999'999}) { // the third within 45 kB of a hole in the middle
    std::string bytes(3'000'000, 'a');
    bytes.replace(static_cast<std::size_t>(std::max(0, position - 45'000)), 45'001, 45'001, 'b');
    write("clip.mp4", bytes);
    EXPECT_NE(identity(), before) << position;
  }
  write("clip.mp4", std::string(3'000'001, 'a'));
  EXPECT_NE(identity(), before) << "longer";
  Input gone = find_inputs({path.string()}).inputs[0];
  fs::remove(path);
  EXPECT_EQ(gone.identity().fingerprint, "") << "gone";
}

// ---- conflicts

class Conflicts : public InFolder {
 protected:
  Conflicts() { options.output_dir = folder / "out"; }
  std::vector<std::string> of(const std::vector<std::string>& names) const {
    std::vector<std::string> arguments;
    for (const std::string& name : names)
      arguments.push_back(name.find("://") == std::string::npos ? (folder / name).string() : name);
    return find_conflicts(find_inputs(arguments, options.names).inputs, options);
  }
  /// One conflict, which names both sides.
  void expect_one(const std::vector<std::string>& conflicts, const std::string& one,
                  const std::string& other) const {
    ASSERT_EQ(conflicts.size(), 1u);
    EXPECT_NE(conflicts[0].find(one), std::string::npos) << conflicts[0];
    EXPECT_NE(conflicts[0].find(other), std::string::npos) << conflicts[0];
  }
  Options options;
};

TEST_F(Conflicts, AnOutputThatIsAnInput) {
  write("drive.mp4");
  write("drive.masks.mkv", "y");
  options.output_dir = folder;
  expect_one(of({"drive.mp4", "drive.masks.mkv"}), "of " + (folder / "drive.mp4").string(),
             "drive.masks.mkv");
  options.wanted[static_cast<int>(Output::masks)] = false;
  EXPECT_TRUE(of({"drive.mp4", "drive.masks.mkv"}).empty()) << "only what is written counts";
}

TEST_F(Conflicts, LinksAreSeenThrough) {
  write("in/drive.mp4");
  write("in/other.mp4", "y");
  fs::create_directory(folder / "out");
  fs::create_hard_link(folder / "in/other.mp4", folder / "out/drive.annotated.mp4");
  expect_one(of({"in/drive.mp4", "in/other.mp4"}), "out/drive.annotated.mp4", "in/other.mp4");
  fs::remove(folder / "out/drive.annotated.mp4");
  fs::create_hard_link(folder / "in/other.mp4", folder / "out/drive.csv.part"); // would be emptied
  expect_one(of({"in/drive.mp4", "in/other.mp4"}), "out/drive.csv.part", "in/other.mp4");
  fs::remove(folder / "out/drive.csv.part");
  fs::create_symlink(folder / "in/other.mp4", folder / "out/drive.csv");
  expect_one(of({"in/drive.mp4", "in/other.mp4"}), "out/drive.csv", "in/other.mp4");
  fs::remove_all(folder / "out");
  fs::create_directory_symlink(folder / "in", folder / "out");
  write("in/drive.annotated.mp4", "z");
  expect_one(of({"in/drive.mp4", "in/drive.annotated.mp4"}), "drive.annotated.mp4", "in/drive.mp4");
}

TEST_F(Conflicts, TwoInputsWithOutputsOfOneName) {
  write("a/drive.mp4");
  write("b/drive.mp4", "y");
  expect_one(of({"a/drive.mp4", "b/drive.mp4"}), "a/drive.mp4", "b/drive.mp4");
  write("b/Drive.mp4", "z");
  expect_one(of({"a/drive.mp4", "b/Drive.mp4"}), "a/drive.mp4", "b/Drive.mp4");
  write("b/drive.partial.mp4", "p");
  expect_one(of({"a/drive.mp4", "b/drive.partial.mp4"}), "a/drive.mp4", "b/drive.partial.mp4");
  options.names = Names::hash;
  EXPECT_TRUE(of({"a/drive.mp4", "b/drive.mp4"}).empty());
}

TEST_F(Conflicts, AnAbsentInputThatAnOutputWouldBecome) {
  write("drive.mp4");
  options.output_dir = folder;
  expect_one(of({"drive.mp4", "drive.annotated.mp4"}), "drive.mp4", "drive.annotated.mp4");
}

TEST_F(Conflicts, WhatLiesInTheFolderMustBeOfThisInput) {
  write("a/drive.mp4", "first");
  write("b/drive.mp4", "second");
  write("out/drive.csv", "somebody's figures");
  expect_one(of({"a/drive.mp4"}), "out/drive.csv already exists", "a/drive.mp4");

  Record record;
  const Input first = find_inputs({(folder / "a/drive.mp4").string()}).inputs[0];
  record.input = first.label;
  record.place = first.place();
  record.identity = first.identity();
  write("out/drive.summary.json", record.to_json());
  EXPECT_TRUE(of({"a/drive.mp4"}).empty()) << "its own";
  expect_one(of({"b/drive.mp4"}), "a/drive.mp4", "b/drive.mp4");
  write("c/drive.mp4", "first");
  EXPECT_TRUE(of({"c/drive.mp4"}).empty()) << "the same recording in another place";
  write("a/drive.mp4", "first, longer");
  EXPECT_TRUE(of({"a/drive.mp4"}).empty()) << "the same place with a newer recording";
  write("out/drive.summary.json", "{\"complete\": tr");
  expect_one(of({"a/drive.mp4"}), "no record", "a/drive.mp4");
}

// ---- shards

class Environment : public testing::Test {
 protected:
  ~Environment() override {
    for (const char* name : names)
      unsetenv(name);
  }
  void set(std::initializer_list<std::pair<const char*, const char*>> values) const {
    for (const char* name : names)
      unsetenv(name);
    for (const auto& [name, value] : values)
      setenv(name, value, 1);
  }
  static std::string text(const std::string& argument) {
    try {
      const Shard shard = read_shard(argument);
      return std::to_string(shard.index) + "/" + std::to_string(shard.count);
    } catch (const tools::UsageError& error) {
      return error.what();
    }
  }
  static constexpr const char* names[] = {"SLURM_ARRAY_TASK_ID",    "SLURM_ARRAY_TASK_MIN",
                                          "SLURM_ARRAY_TASK_COUNT", "SLURM_ARRAY_TASK_STEP",
                                          "JOB_COMPLETION_INDEX",   "TERRAINSEG_SHARD_COUNT"};
};
using Shards = Environment;

TEST_F(Shards, AreReadFromTextAndEnvironment) {
  EXPECT_EQ(text("1/4"), "1/4");
  EXPECT_EQ(text("4/4"), "4/4");
  for (const char* wrong :
       {"0/4", "5/4", "1", "a/b", "/", "1/", "/4", "1/0", "-1/4", "1/4x", "", "1/9999999999"})
    EXPECT_EQ(text(wrong).find("--shard: "), 0u) << wrong;
  set({});
  EXPECT_NE(text("auto").find("neither"), std::string::npos);
  set({{"SLURM_ARRAY_TASK_ID", "5"}, {"SLURM_ARRAY_TASK_MIN", "3"}, {"SLURM_ARRAY_TASK_COUNT", "4"}});
  EXPECT_EQ(text("auto"), "3/4");
  set({{"SLURM_ARRAY_TASK_ID", "30"},
       {"SLURM_ARRAY_TASK_MIN", "10"},
       {"SLURM_ARRAY_TASK_COUNT", "3"},
       {"SLURM_ARRAY_TASK_STEP", "10"}});
  EXPECT_EQ(text("auto"), "3/3");
  set({{"SLURM_ARRAY_TASK_ID", "2"}});
  EXPECT_NE(text("auto").find("SLURM_ARRAY_TASK_MIN"), std::string::npos);
  set({{"JOB_COMPLETION_INDEX", "0"}, {"TERRAINSEG_SHARD_COUNT", "4"}});
  EXPECT_EQ(text("auto"), "1/4");
  set({{"JOB_COMPLETION_INDEX", "4"}, {"TERRAINSEG_SHARD_COUNT", "4"}});
  EXPECT_EQ(text("auto").find("--shard: 5/4"), 0u);
  set({{"JOB_COMPLETION_INDEX", "1"}});
  EXPECT_NE(text("auto").find("TERRAINSEG_SHARD_COUNT"), std::string::npos);
}

TEST(ShardsOfAList, ShareEveryInputOnceWhateverElseIsInTheList) {
  std::vector<Input> all;
  for (int i = 0; i < 1000; ++i) {
    Input input;
    input.label = "ride/" + std::to_string(i) + ".mp4";
    all.push_back(input);
  }
  std::set<std::string> seen;
  for (int index = 1; index <= 8; ++index) {
    const auto share = share_of({index, 8}, all);
    EXPECT_GT(share.size(), 80u) << "far from an eighth";
    EXPECT_LT(share.size(), 175u);
    for (const Input& input : share) {
      EXPECT_TRUE(seen.insert(input.label).second) << input.label;
      EXPECT_EQ(share_of({index, 8}, {input}).size(), 1u) << "alone as in the list";
    }
  }
  EXPECT_EQ(seen.size(), 1000u);
}

// ---- causes

TEST(Causes, EveryErrnoIsSortedAndWhatLastsIsNotTriedAgain) {
  for (int error = 1; error < 134; ++error)
    EXPECT_TRUE(cause_of_writing(error) == Cause::disk || cause_of_writing(error) == Cause::unwritable);
  for (const int lasting :
       {ENAMETOOLONG, EROFS, EFBIG, ELOOP, EINVAL, EISDIR, ENOTDIR, EACCES, EPERM, ENOTSUP})
    EXPECT_FALSE(may_pass_later(cause_of_writing(lasting))) << strerror(lasting);
  for (const int passing : {ENOSPC, EDQUOT, EIO, ESTALE, ENOMEM, EMFILE, ENFILE, ETIMEDOUT, EBUSY, EAGAIN})
    EXPECT_TRUE(may_pass_later(cause_of_writing(passing)) && may_pass_later(cause_of_reading(passing)))
        << strerror(passing);
  EXPECT_TRUE(may_pass_later(cause_of_reading(ENOENT)) && may_pass_later(cause_of_reading(EACCES)));
  EXPECT_FALSE(may_pass_later(cause_of_reading(ENAMETOOLONG)));
}

/// The message that an element of GStreamer would post; a source reads, others decode or write.
GstMessage* error_of(const char* factory, GQuark domain, int code, const char* debug = "") {
  GstElement* element = GST_ELEMENT(gst_object_ref_sink(gst_element_factory_make(factory, nullptr)));
  GError* error = g_error_new_literal(domain, code, "text");
  GstMessage* message = gst_message_new_error(GST_OBJECT(element), error, debug);
  g_error_free(error);
  gst_object_unref(element);
  return message;
}

TEST(Causes, EveryErrorOfGStreamerIsSorted) {
  gst_init(nullptr, nullptr);
  const auto in_source = [](GstMessage* message) {
    const Cause cause = cause_in_source(message);
    gst_message_unref(message);
    return cause;
  };
  const auto behind = [](GstMessage* message) {
    const Cause cause = cause_behind_source(message, true);
    gst_message_unref(message);
    return cause;
  };
  EXPECT_EQ(in_source(error_of("filesrc", GST_RESOURCE_ERROR, GST_RESOURCE_ERROR_READ)), Cause::missing);
  EXPECT_EQ(in_source(error_of("filesrc", GST_RESOURCE_ERROR, GST_RESOURCE_ERROR_NOT_AUTHORIZED)),
            Cause::unsupported)
      << "a password that is wrong stays wrong";
  EXPECT_EQ(in_source(error_of("identity", GST_STREAM_ERROR, GST_STREAM_ERROR_DECODE)), Cause::damaged);
  EXPECT_EQ(in_source(error_of("identity", GST_RESOURCE_ERROR, GST_RESOURCE_ERROR_NO_SPACE_LEFT)),
            Cause::resources);
  EXPECT_EQ(behind(error_of("fdsink", GST_RESOURCE_ERROR, GST_RESOURCE_ERROR_NO_SPACE_LEFT)), Cause::disk);
  EXPECT_EQ(behind(error_of("fdsink", GST_RESOURCE_ERROR, GST_RESOURCE_ERROR_WRITE,
                            "Error while writing to file descriptor 7: File too large")),
            Cause::unwritable);
  EXPECT_EQ(behind(error_of("fdsink", GST_RESOURCE_ERROR, GST_RESOURCE_ERROR_WRITE,
                            "Error while writing to file descriptor 7: Input/output error")),
            Cause::disk);
  EXPECT_EQ(behind(error_of("identity", GST_STREAM_ERROR, GST_STREAM_ERROR_ENCODE)), Cause::unsupported);
}

TEST(Causes, WhatMayPassLater) {
  for (const Cause cause : {Cause::none, Cause::damaged, Cause::unsupported, Cause::stalled, Cause::crashed})
    EXPECT_FALSE(may_pass_later(cause)) << name_of(cause);
  for (const Cause cause : {Cause::missing, Cause::disk, Cause::resources, Cause::interrupted})
    EXPECT_TRUE(may_pass_later(cause)) << name_of(cause);
}

// ---- workers

using Sources = InFolder;

// The decoder is quick or the machine busy: frames arrive while the queue at the end is not started yet.
TEST_F(Sources, FramesThatComeBeforeEverythingIsStartedAreNotLost) {
  gst_init(nullptr, nullptr);
  const auto run = [](GstElement* pipeline) {
    gst_element_set_state(pipeline, GST_STATE_PLAYING);
    const BusPointer bus(gst_element_get_bus(pipeline));
    const auto ends = static_cast<GstMessageType>(GST_MESSAGE_EOS | GST_MESSAGE_ERROR);
    const MessagePointer message(gst_bus_timed_pop_filtered(bus.get(), 20 * GST_SECOND, ends));
    gst_element_set_state(pipeline, GST_STATE_NULL);
    gst_object_unref(pipeline);
    return message && GST_MESSAGE_TYPE(message.get()) == GST_MESSAGE_EOS;
  };
  const fs::path image = folder / "0.png";
  ASSERT_TRUE(run(gst_parse_launch(
      ("videotestsrc num-buffers=1 ! pngenc ! filesink location=" + image.string()).c_str(), nullptr)));
  Input input;
  input.kind = Input::Kind::images;
  input.images = {image, image};
  const Options options;
  Source source(input, options);
  GstElement* const pipeline = gst_pipeline_new(nullptr);
  GstElement* const sink = gst_element_factory_make("fakesink", nullptr);
  gst_bin_add_many(GST_BIN(pipeline), source.bin(), sink, nullptr);
  ASSERT_TRUE(gst_element_link(source.bin(), sink));
  const PadPointer end(gst_ghost_pad_get_target(GST_GHOST_PAD(pad_of(source.bin(), "src").get())));
  const ElementPointer queue(gst_pad_get_parent_element(end.get()));
  gst_element_set_locked_state(queue.get(), TRUE); // the bin leaves it out, as if it came to it last
  EXPECT_TRUE(run(pipeline));
  gst_element_set_state(queue.get(), GST_STATE_NULL);
}

TEST(Workers, TakeWhatTheyAreGivenWhateverItsBytes) {
  Input input;
  input.kind = Input::Kind::images;
  input.label = "a\xff\n%04d.png";
  input.stem = "\xc3(";
  input.path = "/x/\x80";
  input.images = {"/x/1.png", "/x/\xfe.png"};
  const Input same = unpacked<Input>(packed(input));
  EXPECT_EQ(same.kind, input.kind);
  EXPECT_EQ(same.label, input.label);
  EXPECT_EQ(same.stem, input.stem);
  EXPECT_EQ(same.path, input.path);
  EXPECT_EQ(same.images, input.images);
  EXPECT_EQ(same.fault.text, "");
  EXPECT_FALSE(same.fault);
}

TEST(Workers, AnswerWithTheWholeRecord) {
  Outcome outcome;
  outcome.kind = Outcome::Kind::partial;
  Record& record = outcome.record;
  record.input = "\xff.mp4";
  record.place = "/x/\xff.mp4";
  record.identity = {~std::uint64_t{0}, "abc"};
  record.settings = "preset=default";
  record.fault = {Cause::damaged, "cut off"};
  record.frames = 7;
  record.width = 64;
  record.height = 48;
  record.seconds = 0.5;
  record.traversable_sum = 1234;
  record.blocked = 2;
  record.horizon_frames = 3;
  record.filter_milliseconds = 1.25;
  record.still_rows = 4;
  record.warnings = {"one", "two"};
  record.outputs[1] = {"\xff.masks.mkv", 99};
  const Outcome same = unpacked<Outcome>(packed(outcome));
  EXPECT_EQ(same.kind, outcome.kind);
  EXPECT_EQ(same.record.to_json(), record.to_json());
  EXPECT_EQ(same.record.input, record.input);
  EXPECT_EQ(same.record.place, record.place);
  EXPECT_EQ(same.record.fault.cause, record.fault.cause);
  EXPECT_EQ(same.record.traversable_sum, record.traversable_sum);
  EXPECT_EQ(same.record.outputs[1].file, "\xff.masks.mkv");
  EXPECT_EQ(same.record.outputs[1].bytes, 99u);
  EXPECT_EQ(same.record.outputs[0].file, "");
}

TEST(Workers, WhatCrashedIsTheInputsFaultAndWhatWasEndedIsNot) {
  EXPECT_EQ(loss_of(SIGSEGV, true).cause, Cause::crashed);
  EXPECT_EQ(loss_of(SIGABRT, true).cause, Cause::crashed);
  EXPECT_EQ(loss_of(1 << 8, true).cause, Cause::crashed) << "a library that calls exit()";
  EXPECT_NE(loss_of(1 << 8, true).text.find("exit code 1"), std::string::npos);
  EXPECT_EQ(loss_of(SIGKILL, true).cause, Cause::resources);
  EXPECT_EQ(loss_of(124 << 8, true).cause, Cause::stalled) << "a pipeline that hangs";
  EXPECT_NE(loss_of(SIGSEGV | 0x80, false).text.find("signal 11"), std::string::npos) << "with a core dump";
}

// ---- outputs

using Outputs = InFolder;

template <typename Work> std::string problem_of(const Work& work) {
  try {
    work();
    return {};
  } catch (const Fault& fault) {
    return fault.text;
  }
}

TEST_F(Outputs, AFileAppearsWholeOrNotAtAll) {
  const auto path = write("out", "old");
  {
    AtomicFile file;
    ASSERT_NO_THROW(file.open(path));
    file.write("new");
    EXPECT_EQ(file.size(), 3u);
    EXPECT_EQ(read(path), "old");
  }
  EXPECT_EQ(read(path), "old") << "given up";
  EXPECT_FALSE(fs::exists(folder / "out.part"));
  AtomicFile file;
  ASSERT_NO_THROW(file.open(path));
  file.write(std::string(200'000, 'n'));
  ASSERT_NO_THROW(file.commit(path));
  EXPECT_EQ(read(path), std::string(200'000, 'n'));
  EXPECT_FALSE(fs::exists(folder / "out.part"));
}

TEST_F(Outputs, WhatAKilledRunLeftIsReused) {
  write("out.part", "half of somethi");
  AtomicFile file;
  ASSERT_NO_THROW(file.open(folder / "out"));
  file.write("whole");
  ASSERT_NO_THROW(file.commit(folder / "out"));
  EXPECT_EQ(read(folder / "out"), "whole");
}

TEST_F(Outputs, TwoNeverWriteTheSameFile) {
  AtomicFile first, second;
  ASSERT_NO_THROW(first.open(folder / "out"));
  EXPECT_NE(problem_of([&] { second.open(folder / "out"); }).find("another run"), std::string::npos);
  ASSERT_NO_THROW(first.commit(folder / "out"));
  EXPECT_NO_THROW(second.open(folder / "out")) << "free again";
}

TEST_F(Outputs, FailuresNameTheFile) {
  AtomicFile file;
  EXPECT_NE(problem_of([&] { file.open(folder / "no" / "out"); }).find("no/out"), std::string::npos);
  EXPECT_NE(problem_of([&] { file.open(folder); }), "") << "a folder is no file";
  EXPECT_NE(problem_of([&] { prepare_folder(write("file") / "sub"); }), "");
  EXPECT_EQ(problem_of([&] { prepare_folder(folder / "a" / "b"); }), "");
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

// ---- manifests

class Manifests : public InFolder {
 protected:
  Check checked(const std::string& text) {
    Options options;
    options.check = write("manifest", text).string();
    return check_manifest(options, {});
  }
  static std::string head(const std::string& shard, const std::string& shards, const std::string& inputs) {
    return R"({"manifest":1,"output_dir":"/","shard":)" + shard + R"(,"shards":)" + shards + R"(,"inputs":)" +
           inputs + "}\n";
  }
};

TEST_F(Manifests, MissingShardsInARowAreOneLine) {
  const std::vector<std::string> expected = {"shard 1/7 has no manifest", "shards 3 to 5/7 have no manifest",
                                             "shard 7/7 has no manifest"};
  EXPECT_EQ(checked(head("2", "7", "0") + head("6", "7", "0")).again, expected);
  EXPECT_TRUE(checked(head("1", "2", "0") + head("2", "2", "0")).again.empty());
  EXPECT_EQ(checked(head("1", "1000000", "0")).again,
            std::vector<std::string>{"shards 2 to 1000000/1000000 have no manifest"});
}

TEST_F(Manifests, NumbersThatCannotBeAreALineThatCannotBeRead) {
  const std::vector<std::string> expected = {"line 1 of the manifest cannot be read"};
  for (const auto& [shard, shards, inputs] : {std::array<const char*, 3>{"1", "2000000000", "1"},
                                              {"1", "1e300", "1"},
                                              {"3", "2", "1"},
                                              {"0", "2", "1"},
                                              {"-1", "2", "1"},
                                              {"1", "-2", "1"},
                                              {"1", "1", "-1"},
                                              {"1", "1", "1e300"}})
    EXPECT_EQ(checked(head(shard, shards, inputs)).again, expected)
        << shard << "/" << shards << " " << inputs;
  EXPECT_EQ(checked(head("1", "1", "1") +
                    R"({"input":"a","status":"complete","outputs":{"csv":{"file":"a","bytes":-1}}})"
                    "\n")
                .again,
            std::vector<std::string>{"a: its line in the manifest cannot be read"});
}

TEST_F(Manifests, ALineMayBeNestedAsDeepAsItLikes) {
  const std::string deep(1 << 19, '['), back(1 << 19, ']');
  const Check check =
      checked(head("1", "1", "1") + R"({"input":"a","status":"failed","more":)" + deep + back + "}\n");
  EXPECT_EQ(check.again, std::vector<std::string>{"a: failed: no cause is given"});
}

TEST_F(Manifests, AreToldFromOtherFilesByTheirBeginning) {
  EXPECT_TRUE(is_manifest(write("manifest", head("1", "1", "1"))));
  EXPECT_FALSE(is_manifest(write("notes", "mine\n")));
  EXPECT_FALSE(is_manifest(write("empty", "")));
  const auto sparse = write("sparse");
  fs::resize_file(sparse, std::uintmax_t{1} << 32); // one line
  EXPECT_FALSE(is_manifest(sparse));
}

TEST_F(Outputs, ARecordWhoseLengthIsNoneIsNone) {
  const auto record = [](const std::string& bytes) {
    return R"({"input":{"place":"/a","bytes":)" + bytes + R"(,"fingerprint":"f"}})";
  };
  const auto origin = read_origin(write("whole", record("7")));
  ASSERT_TRUE(origin);
  EXPECT_EQ(origin->identity.bytes, 7u);
  for (const char* bytes : {"1e300", "-1", "7.5", "null"})
    EXPECT_FALSE(read_origin(write("broken", record(bytes)))) << bytes;
}

} // namespace
TEST(Exif, TellsTheOrientationAndSurvivesEveryCut) {
  std::vector<std::uint8_t> jpeg = {0xff, 0xd8, 0xff, 0xe1, 0, 34, 'E', 'x', 'i', 'f',
                                    0,    0,    'M',  'M',  0, 42, 0,   0,   0,   8};
  jpeg.insert(jpeg.end(), {0, 1, 0x01, 0x12, 0, 3, 0, 0, 0, 1, 0, 6, 0, 0, 0, 0, 0, 0, 0xff, 0xda});
  EXPECT_EQ(exif_orientation(jpeg), 6);
  EXPECT_STREQ(orientation_tag(6), "rotate-90");
  for (std::size_t size = 0; size < jpeg.size(); ++size) {
    const std::vector<std::uint8_t> cut(jpeg.begin(), jpeg.begin() + static_cast<std::ptrdiff_t>(size));
    const int orientation = exif_orientation(cut);
    EXPECT_TRUE(orientation == 1 || orientation == 6) << size;
  }
  for (std::size_t at = 2; at < jpeg.size(); ++at)
    for (const std::uint8_t value : {0x00, 0x7f, 0xff}) {
      std::vector<std::uint8_t> wrong = jpeg;
      wrong[at] = value;
      const int orientation = exif_orientation(wrong);
      EXPECT_TRUE(orientation >= 1 && orientation <= 8) << at;
    }
}

TEST(WithoutCredentials, LeavesNoUserAndNoPasswordInAText) {
  EXPECT_EQ(without_credentials("rtsp://me:pw@host:554/a@b"), "rtsp://host:554/a@b");
  EXPECT_EQ(without_credentials("cannot read http://u:p@q@h/x (see rtsp://v@w)"),
            "cannot read http://h/x (see rtsp://w)");
  EXPECT_EQ(without_credentials("file:///a@b and x://"), "file:///a@b and x://");
}

} // namespace terrainseg::process
