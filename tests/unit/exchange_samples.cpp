// SPDX-License-Identifier: LGPL-2.1-or-later
// usage: exchange_samples FOLDER: writes what the ways out make of a set of estimates, for checks in another
// language and as seeds of the fuzzers: NNN.klv, NNN-uas.klv (the same set in a UAS Datalink Local Set),
// NNN.json (the same estimate as a line with its mask), NNN.terrain.
#include <cstdio>
#include <fstream>
#include <limits>

#include "exchange/json_lines.hpp"
#include "exchange/model_file.hpp"
#include "exchange/vmti_klv.hpp"
#include "exchange_estimates.hpp"

namespace terrainseg {
namespace {

void write(const std::string& path, const void* data, std::size_t size) {
  std::ofstream out(path, std::ios::binary);
  out.write(static_cast<const char*>(data), static_cast<std::streamsize>(size));
}

Terrain terrain_of(std::mt19937& random, int i) {
  Terrain t;
  t.space = {i % 2 == 1, {static_cast<ColorRange>(i % 2), static_cast<ColorMatrix>(i % 3)}};
  t.models.resize(static_cast<std::size_t>(i) % (max_models + 1));
  for (TerrainModel& m : t.models) {
    m.mean = {static_cast<std::uint16_t>(random() % (most_mean + 1)), 2, 3};
    m.variance = {1 + static_cast<std::uint32_t>(random()) % most_variance, 5, 6};
    m.mass = random();
  }
  if (i % 4 == 3)
    t.negative_colors.assign(color_bins, 7);
  if (i % 4 > 1)
    t.terrain_texture.assign(texture_bins, static_cast<std::uint32_t>(random() % 1000000));
  t.generation = static_cast<std::uint32_t>(random());
  return t;
}

/// What exchange_check.py expects of sample `i`.
UasPlatform platform_of(int i) {
  UasPlatform platform;
  if (i % 2)
    platform.position = {4.5 * i - 90, 9.0 * i - 180, 100.0 * i};
  if (i % 4 == 1)
    platform.heading = 9.0 * i;
  if (i % 3 == 0)
    platform.attitude = {i - 20.0, 5.0 * i - 90};
  return platform;
}

int run(const std::string& folder) {
  std::mt19937 random(1);
  KlvEncoder encoder;
  for (int i = 0; i < 40; ++i) {
    test::OwnedEstimate o = test::blank(1, 1, 1, 1);
    if (i == 1)
      o = test::blank(1920, 1080, 1920, 1080);
    else if (i % 4 == 2)
      o = test::ground(320, 180, i % 3, random);
    else if (i == 3)
      o = test::noisy(320, 240, 320, 240, 1, random); // halved
    else if (i > 0)
      o = test::noisy(64 + i, 48, 20 + i, 16, 10 + static_cast<unsigned>(i), random);
    if (i % 5 == 2) {
      o.estimate.vanishing_row = i % 2 ? -1 : (o.estimate.frame_height << 16) - 7 * i;
      o.estimate.speed_over_height = (i - 20) * 9999;
    }
    char name[16];
    std::snprintf(name, sizeof name, "/%03d", i);
    const std::uint64_t pts = static_cast<std::uint64_t>(i) * 33333333;
    const auto unit = encoder.encode(o.estimate, pts / 1000);
    write(folder + name + ".klv", unit.data(), unit.size());
    const UasPlatform platform = platform_of(i);
    const auto nested = encoder.encode(o.estimate, pts / 1000, &platform);
    write(folder + name + "-uas.klv", nested.data(), nested.size());
    std::string line;
    // Every third with metres: known, free and unknown columns.
    const std::size_t columns = o.estimate.boundary.size();
    std::vector<float> ranges(columns), bearings(columns);
    for (std::size_t c = 0; c < columns; ++c) {
      ranges[c] = c % 3 == 0   ? std::numeric_limits<float>::infinity()
                  : c % 3 == 1 ? std::numeric_limits<float>::quiet_NaN()
                               : static_cast<float>(c) / 64;
      bearings[c] = c % 3 == 1 ? std::numeric_limits<float>::quiet_NaN()
                               : 0.5F - static_cast<float>(c) / static_cast<float>(columns);
    }
    const MetricEstimate metric{ranges, bearings, ranges, ranges, 0.5, 0.1, -0.1, 0, 0.75, 40, 0};
    LineExtras extras;
    if (i % 3 == 0 && columns > 0) {
      extras.metric = &metric;
      extras.utc = pts + 1795377600000000000u;
    }
    append_json_line(line, o.estimate, i == 0 ? -1 : static_cast<std::int64_t>(pts), true, extras);
    write(folder + name + ".json", line.data(), line.size());
    const std::vector<std::uint8_t> file = serialize_terrain(terrain_of(random, i));
    write(folder + name + ".terrain", file.data(), file.size());
  }
  return 0;
}

} // namespace
} // namespace terrainseg

int main(int argc, char** argv) {
  if (argc != 2) {
    std::fputs("usage: exchange_samples FOLDER\n", stderr);
    return 2;
  }
  return terrainseg::run(argv[1]);
}
