// SPDX-License-Identifier: LGPL-2.1-or-later
#include "exchange/model_file.hpp"

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <gtest/gtest.h>
#include <random>
#include <sys/stat.h>

#include "exchange/bytes.hpp"

namespace terrainseg {
namespace {

using Bytes = std::vector<std::uint8_t>;

Terrain full_terrain(unsigned seed) {
  std::mt19937_64 random(seed);
  Terrain t;
  t.space = {true, {ColorRange::full, ColorMatrix::bt2020}};
  t.models.resize(max_models);
  for (TerrainModel& m : t.models) {
    for (auto& v : m.mean)
      v = static_cast<std::uint16_t>(random() % (most_mean + 1));
    for (auto& v : m.variance)
      v = static_cast<std::uint32_t>(1 + random() % most_variance);
    m.mass = 1 + random() % most_mass;
  }
  auto fill = [&](std::vector<std::uint32_t>& h, int bins) {
    h.resize(static_cast<std::size_t>(bins));
    for (auto& v : h)
      v = static_cast<std::uint32_t>(random() % (most_histogram / static_cast<unsigned>(bins)));
  };
  fill(t.negative_colors, color_bins);
  fill(t.terrain_texture, texture_bins);
  fill(t.negative_texture, texture_bins);
  t.exposure_mean = 0xfe04;
  t.horizon = most_horizon;
  t.generation = 77;
  t.line = {1280, 720, 719 << 8};
  return t;
}

void put_u32(Bytes& bytes, std::size_t at, std::uint32_t v) {
  for (int i = 0; i < 4; ++i)
    bytes.at(at + static_cast<std::size_t>(i)) = static_cast<std::uint8_t>(v >> (8 * i));
}

/// Bit-by-bit CRC-32, apart from the table-driven one.
std::uint32_t slow_crc(std::span<const std::uint8_t> bytes) {
  std::uint32_t c = 0xffffffffu;
  for (const std::uint8_t b : bytes)
    for (int i = 0; i < 8; ++i) {
      const bool one = ((c ^ (b >> i)) & 1) != 0;
      c >>= 1;
      if (one)
        c ^= 0xedb88320u;
    }
  return ~c;
}

void fix_crc(Bytes& bytes) {
  put_u32(bytes, bytes.size() - 4, slow_crc(std::span(bytes).first(bytes.size() - 4)));
}

std::string error_of(const Bytes& bytes) {
  const TerrainResult r = parse_terrain(bytes);
  EXPECT_FALSE(r.terrain.has_value());
  EXPECT_FALSE(r.error.empty());
  return r.error;
}

#define EXPECT_SAYS(text, part) EXPECT_NE((text).find(part), std::string::npos) << (text)

class Folder {
 public:
  Folder() {
    std::string name = (std::filesystem::temp_directory_path() / "terrainseg-XXXXXX").string();
    path = ::mkdtemp(name.data());
  }
  ~Folder() { std::filesystem::remove_all(path); }
  std::filesystem::path path;
};

TEST(Crc32, KnownValuesAndEveryLength) {
  const std::string check = "123456789"; // the catalogue's check value of CRC-32/ISO-HDLC
  EXPECT_EQ(crc32({reinterpret_cast<const std::uint8_t*>(check.data()), check.size()}), 0xcbf43926u);
  EXPECT_EQ(crc32({}), 0u);
  std::mt19937 random(3);
  Bytes bytes;
  for (int n = 0; n < 70; ++n) {
    EXPECT_EQ(crc32(bytes), slow_crc(bytes)) << n;
    bytes.push_back(static_cast<std::uint8_t>(random()));
  }
}

TEST(ModelFile, ComesBackAsItWas) {
  const Terrain full = full_terrain(1);
  EXPECT_EQ(parse_terrain(serialize_terrain(full)).terrain, full);
  const Terrain empty;
  EXPECT_EQ(parse_terrain(serialize_terrain(empty)).terrain, empty);
  Terrain some = full;
  some.models.resize(3);
  some.negative_colors.clear();
  some.space = {false, {ColorRange::limited, ColorMatrix::bt709}};
  EXPECT_EQ(parse_terrain(serialize_terrain(some)).terrain, some);
}

// The bytes themselves are the promise: written out by hand from the layout in the header.
TEST(ModelFile, BytesAreTheDocumentedOnes) {
  Terrain t;
  t.space = {true, {ColorRange::full, ColorMatrix::bt709}};
  t.models.push_back({{0x0102, 0x0304, 0x0506}, {7, 8, 0x090a0b0c}, 0x1112131415161718});
  t.exposure_mean = 0x21222324;
  t.horizon = 0x31;
  t.generation = 2;
  t.line = {0x0140, 0xf0, 0x5678};
  Bytes expected = {'T', 'E', 'R', 'R', 'A', 'I', 'N', '\n', 2, 0, 0, 0, 62, 0, 0, 0,
                    // space and one model
                    1, 1, 1, 1, 2, 1, 4, 3, 6, 5, 7, 0, 0, 0, 8, 0, 0, 0, 0xc, 0xb, 0xa, 9, 0x18, 0x17, 0x16,
                    0x15, 0x14, 0x13, 0x12, 0x11,
                    // three empty histograms
                    0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0,
                    // exposure, horizon, generation, line, checksum
                    0x24, 0x23, 0x22, 0x21, 0x31, 0, 0, 0, 2, 0, 0, 0, 0x40, 1, 0xf0, 0, 0x78, 0x56, 0, 0, 0,
                    0, 0, 0};
  fix_crc(expected);
  EXPECT_EQ(serialize_terrain(t), expected);
}

TEST(ModelFile, VersionOneHasNoLine) {
  Terrain t = full_terrain(3);
  Bytes older = serialize_terrain(t);
  older.erase(older.end() - 12, older.end() - 4);
  put_u32(older, 8, 1);
  put_u32(older, 12, static_cast<std::uint32_t>(older.size() - 20));
  fix_crc(older);
  t.line = {};
  EXPECT_EQ(parse_terrain(older).terrain, t);
  put_u32(older, 8, 2); // this one has to have a line
  fix_crc(older);
  EXPECT_SAYS(error_of(older), "does not have the size");
}

TEST(ModelFile, RefusalsNameTheCause) {
  const Bytes good = serialize_terrain(full_terrain(2));
  EXPECT_SAYS(error_of({}), "empty");
  EXPECT_SAYS(error_of({'P', 'N', 'G'}), "not a learned terrain");
  EXPECT_SAYS(error_of(Bytes(500, 'x')), "not a learned terrain");

  Bytes text_copy = good;
  text_copy.insert(text_copy.begin() + 7, '\r');
  EXPECT_SAYS(error_of(text_copy), "not a learned terrain");

  Bytes newer = good;
  put_u32(newer, 8, 9);
  EXPECT_SAYS(error_of(newer), "version 9");
  EXPECT_SAYS(error_of(newer), "newer terrainseg");
  put_u32(newer, 8, 0);
  EXPECT_SAYS(error_of(newer), "version 0");

  Bytes longer = good;
  longer.push_back(0);
  EXPECT_SAYS(error_of(longer), "1 bytes follow");

  Bytes huge = good;
  put_u32(huge, 12, 0xffffffffu);
  EXPECT_SAYS(error_of(huge), "4294967295");

  Bytes flipped = good;
  flipped[100] ^= 1;
  EXPECT_SAYS(error_of(flipped), "checksum");
}

TEST(ModelFile, EveryPrefixIsRefused) {
  const Bytes good = serialize_terrain(full_terrain(4));
  for (std::size_t n = 0; n < good.size(); ++n) {
    const std::string e = error_of(Bytes(good.begin(), good.begin() + static_cast<std::ptrdiff_t>(n)));
    if (n >= 8) {
      EXPECT_SAYS(e, "cut short");
    }
  }
}

TEST(ModelFile, EveryFlippedBitIsRefused) {
  Terrain small;
  small.models.resize(2);
  const Bytes good = serialize_terrain(small);
  for (std::size_t bit = 0; bit < good.size() * 8; ++bit) {
    Bytes bad = good;
    bad[bit / 8] ^= static_cast<std::uint8_t>(1 << (bit % 8));
    error_of(bad);
  }
}

// A checksum does not make content meaningful: files with a right checksum and wrong counts.
TEST(ModelFile, WrongContentWithRightChecksumIsRefused) {
  const Bytes good = serialize_terrain(full_terrain(5));
  constexpr std::size_t content = 16;
  Bytes bad = good;
  bad[content + 2] = 3;
  fix_crc(bad);
  EXPECT_SAYS(error_of(bad), "matrix 3");

  bad = good;
  bad[content + 3] = 200;
  fix_crc(bad);
  EXPECT_SAYS(error_of(bad), "200 models");

  bad = good;
  bad[content + 3] = 7; // one fewer than there are: everything behind it shifts
  fix_crc(bad);
  error_of(bad);

  Terrain plain;
  bad = serialize_terrain(plain);
  put_u32(bad, content + 4, color_bins); // announces bins that are not there
  fix_crc(bad);
  EXPECT_SAYS(error_of(bad), "size");
  put_u32(bad, content + 4, 5);
  fix_crc(bad);
  EXPECT_SAYS(error_of(bad), "5 bins");
}

// Every field has the range that learning keeps to: beyond it a checksum-valid file stopped the process (an
// exposure mean of 10^8 and a mass of 2^64 - n divided by zero, indices of -1 left their tables).
TEST(ModelFile, EveryFieldHasARange) {
  const auto verdict = [](auto change) {
    Terrain t = full_terrain(9);
    change(t);
    const TerrainResult result = parse_terrain(serialize_terrain(t));
    EXPECT_EQ(result.terrain.has_value(), flaw_of(t).empty());
    return result.error;
  };
  EXPECT_EQ(verdict([](Terrain&) {}), "");
  EXPECT_EQ(verdict([](Terrain& t) { t.exposure_mean = most_exposure_mean; }), "");
  EXPECT_SAYS(verdict([](Terrain& t) { t.exposure_mean = 100000000; }), "exposure mean is 100000000");
  EXPECT_SAYS(verdict([](Terrain& t) { t.exposure_mean = most_exposure_mean + 1; }), "0..65280");
  EXPECT_SAYS(verdict([](Terrain& t) { t.horizon = 256; }), "horizon is 256");
  EXPECT_SAYS(verdict([](Terrain& t) { t.line = {0, 0, 1}; }), "the line is 1");
  EXPECT_SAYS(verdict([](Terrain& t) { t.line = {8, 0, 0}; }), "the width of the line's frames is 8");
  EXPECT_SAYS(verdict([](Terrain& t) {
                t.line = {8, 40000, 0};
              }),
              "the height of the line's frames is 40000");
  EXPECT_SAYS(verdict([](Terrain& t) { t.line = {8, 6, (6 << 8) + 1}; }), "the line is 1537");
  EXPECT_SAYS(verdict([](Terrain& t) { t.horizon = 0xffffffff; }), "horizon");
  EXPECT_EQ(verdict([](Terrain& t) { t.models[3].mass = most_mass; }), "");
  EXPECT_SAYS(verdict([](Terrain& t) { t.models[3].mass = ~0ull; }), "mass of model 3");
  EXPECT_SAYS(verdict([](Terrain& t) { t.models[7].mean[2] = 65281; }), "mean of model 7");
  EXPECT_SAYS(verdict([](Terrain& t) { t.models[0].variance[1] = 0; }), "variance of model 0");
  EXPECT_SAYS(verdict([](Terrain& t) { t.models[0].variance[1] = ~0u; }), "variance of model 0");
  EXPECT_EQ(verdict([](Terrain& t) { t.models[0] = {}; }), "") << "a null model";
  EXPECT_SAYS(verdict([](Terrain& t) { t.models[0] = {{0, 0, 0}, {~0u, 0, 0}, 0}; }), "variance of model 0");
  EXPECT_SAYS(verdict([](Terrain& t) { t.negative_colors[5] = ~0u; }), "negative colours");
  EXPECT_SAYS(verdict([](Terrain& t) { t.terrain_texture[0] = ~0u; }), "terrain texture");
  EXPECT_SAYS(verdict([](Terrain& t) { t.negative_texture[23] = ~0u; }), "negative texture");
  Terrain many;
  many.models.resize(max_models + 1);
  EXPECT_SAYS(flaw_of(many), "9 models");
  Terrain odd;
  odd.terrain_texture.resize(texture_bins - 1);
  EXPECT_SAYS(flaw_of(odd), "23 bins");
}

TEST(ModelFile, RandomAndMutatedBytesNeverPassOrCrash) {
  std::mt19937 random(6);
  const Bytes good = serialize_terrain(full_terrain(6));
  const Terrain truth = full_terrain(6);
  for (int i = 0; i < 20000; ++i) {
    Bytes bytes = good;
    if (i % 4 == 0) {
      bytes.resize(random() % 400);
      for (auto& b : bytes)
        b = static_cast<std::uint8_t>(random());
      if (bytes.size() > 12 && i % 8 == 0)
        std::copy(good.begin(), good.begin() + 12, bytes.begin());
    } else {
      for (unsigned k = 0; k < 1 + random() % 6; ++k)
        bytes[random() % 64] = static_cast<std::uint8_t>(random());
      if (i % 4 == 2)
        bytes.resize(random() % bytes.size());
      if (i % 4 == 3)
        fix_crc(bytes);
    }
    const TerrainResult r = parse_terrain(bytes);
    EXPECT_NE(r.terrain.has_value(), !r.error.empty());
    if (r.terrain) {
      EXPECT_EQ(serialize_terrain(*r.terrain), bytes);
    }
  }
}

TEST(ModelFile, SavesAndLoads) {
  Folder folder;
  const std::string path = folder.path / "ground.terrain";
  const Terrain t = full_terrain(7);
  EXPECT_EQ(save_terrain(path, t), "");
  EXPECT_EQ(load_terrain(path).terrain, t);
  EXPECT_EQ(save_terrain(path, {}), "");
  EXPECT_EQ(load_terrain(path).terrain, Terrain{});
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(folder.path), {}), 1)
      << "a temporary file stays";
}

TEST(ModelFile, KeepsTheModeOfTheFileAndFollowsTheUmask) {
  Folder folder;
  const std::string path = folder.path / "ground.terrain";
  const mode_t old = ::umask(027);
  EXPECT_EQ(save_terrain(path, {}), "");
  ::umask(old);
  struct stat s {};
  ASSERT_EQ(::stat(path.c_str(), &s), 0);
  EXPECT_EQ(s.st_mode & 0777, 0640u);
  ::chmod(path.c_str(), 0604);
  EXPECT_EQ(save_terrain(path, {}), "");
  ASSERT_EQ(::stat(path.c_str(), &s), 0);
  EXPECT_EQ(s.st_mode & 0777, 0604u);
}

TEST(ModelFile, FileErrorsNameThePath) {
  Folder folder;
  const std::string missing = folder.path / "no" / "such.terrain";
  EXPECT_SAYS(load_terrain(missing).error, missing);
  EXPECT_SAYS(load_terrain(missing).error, "No such file");
  EXPECT_SAYS(save_terrain(missing, {}), missing);
  EXPECT_SAYS(load_terrain(folder.path.string()).error, "directory");
  EXPECT_SAYS(save_terrain("", {}), "empty");

  const std::string huge = folder.path / "huge";
  std::ofstream(huge) << std::string(1 << 20, 'x');
  EXPECT_SAYS(load_terrain(huge).error, huge);
  EXPECT_SAYS(load_terrain(huge).error, "not a learned terrain");
}

TEST(ModelFile, LinksAreFollowedAndStay) {
  Folder folder;
  std::filesystem::create_directory(folder.path / "kept");
  const auto link = folder.path / "link", other = folder.path / "other";
  std::filesystem::create_symlink("kept/ground.terrain", link); // to what does not exist yet
  std::filesystem::create_symlink(link, other);
  for (const unsigned seed : {1u, 2u}) {
    EXPECT_EQ(save_terrain(other, full_terrain(seed)), "");
    EXPECT_TRUE(std::filesystem::is_symlink(link));
    EXPECT_TRUE(std::filesystem::is_symlink(other));
    EXPECT_TRUE(std::filesystem::is_regular_file(folder.path / "kept" / "ground.terrain"));
    EXPECT_EQ(load_terrain(other).terrain, full_terrain(seed));
  }
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(folder.path / "kept"), {}), 1);
  std::filesystem::create_symlink("circle", folder.path / "circle");
  EXPECT_SAYS(save_terrain(folder.path / "circle", {}), "circle");
}

TEST(ModelFile, OnlyRegularFilesAreReplacedAndRead) {
  Folder folder;
  const std::string pipe = folder.path / "pipe";
  ASSERT_EQ(::mkfifo(pipe.c_str(), 0600), 0);
  EXPECT_SAYS(save_terrain(pipe, {}), "a pipe");
  EXPECT_TRUE(std::filesystem::is_fifo(pipe));
  EXPECT_SAYS(load_terrain(pipe).error, "a pipe"); // and does not wait for a writer
  std::filesystem::create_symlink("/dev/null", folder.path / "device");
  EXPECT_SAYS(save_terrain(folder.path / "device", {}), "a character device");
  EXPECT_SAYS(load_terrain("/dev/zero").error, "a character device");
  EXPECT_SAYS(save_terrain(folder.path, {}), "a directory");
  EXPECT_TRUE(std::filesystem::is_character_file("/dev/null"));
}

TEST(ModelFile, FailedWriteLeavesTheOldFile) {
  Folder folder;
  const std::string path = folder.path / "ground.terrain";
  ASSERT_EQ(save_terrain(path, full_terrain(8)), "");
  // A folder of the target's name makes the rename fail after the temporary file was written.
  const std::string blocked = folder.path / "blocked";
  std::filesystem::create_directories(std::filesystem::path(blocked) / "inside");
  EXPECT_SAYS(save_terrain(blocked, {}), blocked);
  EXPECT_EQ(load_terrain(path).terrain, full_terrain(8));
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(folder.path), {}), 2)
      << "a temporary file stays";
}

} // namespace
} // namespace terrainseg
