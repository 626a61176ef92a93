// SPDX-License-Identifier: LGPL-2.1-or-later
// A learned terrain from anywhere, and then frames: what is loaded must be fit to be worked with, in both
// presets. The input is a few decisions and the content of a model file; header and checksum are put around
// it.
#include <algorithm>
#include <vector>

#include "exchange/bytes.hpp"
#include "exchange/model_file.hpp"
#include "input.hpp"
#include "terrainseg/segmenter.hpp"

namespace {

using namespace terrainseg;
using namespace terrainseg::fuzz;

std::vector<std::uint8_t> file_around(std::span<const std::uint8_t> content) {
  std::vector<std::uint8_t> file = {'T', 'E', 'R', 'R', 'A', 'I', 'N', '\n', 1, 0, 0, 0};
  const auto put = [&](std::uint32_t value) {
    for (int i = 0; i < 4; ++i)
      file.push_back(static_cast<std::uint8_t>(value >> (8 * i)));
  };
  put(static_cast<std::uint32_t>(content.size()));
  file.insert(file.end(), content.begin(), content.end());
  put(crc32(file));
  return file;
}

/// Sky, ground and some noise, brighter or darker.
void fill(std::vector<std::uint8_t>& pixels, int width, int height, unsigned seed, int light) {
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width * 3; ++x) {
      seed = seed * 1664525u + 1013904223u;
      const int value = (y * 2 < height ? 170 + 10 * (x % 3) : 80 + (x / 3 > width / 3 ? 30 : 0)) + light;
      pixels[static_cast<std::size_t>(y * width * 3 + x)] =
          static_cast<std::uint8_t>(std::clamp(value + static_cast<int>(seed >> 28), 0, 255));
    }
}

void drive(const Terrain& terrain, Preset preset, std::uint8_t variant) {
  Settings settings = Settings::of(preset);
  settings.learning = variant & 1;
  settings.horizon = variant & 2 ? settings.horizon : HorizonMode::off;
  settings.learned_models = variant & 4 ? max_models : settings.learned_models;
  settings.forget_shift = variant & 8 ? 0 : settings.forget_shift;
  settings.mass_cap = variant & 16 ? 0 : settings.mass_cap;
  settings.exposure = settings.exposure && !(variant & 32);
  require(!validate(settings));
  Segmenter segmenter(settings);
  constexpr int width = 64, height = 48;
  std::vector<std::uint8_t> pixels(static_cast<std::size_t>(width) * height * 3);
  const bool before = variant & 64; // without a frame no colour space is known that could differ
  if (before && !segmenter.adopt(terrain).ok())
    return;
  for (int i = 0; i < 3; ++i) {
    fill(pixels, width, height, static_cast<unsigned>(i), variant & 128 ? 40 * i : 0);
    Frame frame;
    frame.format = PixelFormat::RGB;
    frame.width = width;
    frame.height = height;
    frame.colorimetry = {ColorRange::full, ColorMatrix::bt601};
    frame.planes[0] = {pixels.data(), width * 3};
    require(segmenter.process(frame).ok());
    require(flaw_of(segmenter.estimate()) == nullptr);
    if (i == 0 && !before && !segmenter.adopt(terrain).ok())
      return;
  }
  // What was learned on from it can be saved and loaded again.
  const TerrainResult again = parse_terrain(serialize_terrain(segmenter.terrain()));
  require(again.terrain.has_value() && *again.terrain == segmenter.terrain());
}

} // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  Input in(data, size);
  const std::uint8_t variant = in.byte();
  const TerrainResult result = parse_terrain(file_around(in.take(size)));
  if (!result.terrain)
    return 0;
  drive(*result.terrain, Preset::standard, variant);
  drive(*result.terrain, Preset::paper, variant);
  return 0;
}
