// SPDX-License-Identifier: LGPL-2.1-or-later
// A drive over a textured plane for obstacles from motion: the camera speeds, turns, pitches and zooms as the
// input says, frames repeat, stop and jump in time, ground is anything. Nothing may run over, and twice the
// same frames are twice the same answer.
#include <algorithm>
#include <vector>

#include "input.hpp"
#include "motion/motion_obstacles.hpp"

namespace {

using namespace terrainseg;
using namespace terrainseg::fuzz;

std::uint8_t grain(int x, int y) {
  unsigned h = static_cast<unsigned>(x) * 73856093u ^ static_cast<unsigned>(y) * 19349663u;
  h = (h ^ h >> 13) * 1274126177u;
  return static_cast<std::uint8_t>(h >> 24);
}

/// Where the camera is, in 64ths of a pattern's cell and of a pixel.
struct Place {
  int x = 0, z = 0, row = 0, zoom = 64;
  int light = 0;
};

struct Picture {
  int width, height;
  std::vector<std::uint8_t> pixels;

  void draw(const Place& at, int thing, std::span<const std::uint8_t> noise) {
    const int line = height * 2 / 5 + at.row / 64;
    for (int y = 0; y < height; ++y) {
      const int below = y - line;
      const int depth = below > 0 ? height * at.zoom / below : 0; // 64ths
      for (int x = 0; x < width; ++x) {
        int value = 180;
        if (below > 0) {
          const int across = (x - width / 2) * depth / 16 + at.x, ahead = depth * 16 + at.z;
          value = 60 + grain(across >> 6, ahead >> 6) / 2;
        }
        // Something upright, as wide as high, that stays where it is in the picture.
        if (thing > 0 && std::abs(x - width / 2) < thing && std::abs(y - height * 3 / 4) < thing)
          value = grain(x / 3, y / 3);
        pixels[static_cast<std::size_t>(y * width + x)] =
            static_cast<std::uint8_t>(std::clamp(value + at.light, 0, 255));
      }
    }
    for (std::size_t i = 0; i < noise.size(); ++i)
      pixels[i * 977 % pixels.size()] = noise[i];
  }
  GrayView view() const { return {{pixels.data(), width}, width, height}; }
};

/// What of a frame's answer has to hold whatever was seen.
void check(const MotionView& view, const MotionObstacles& motion, int width, int height) {
  require(motion.kept_bytes() < (std::size_t{4} << 20));
  if (view.columns == 0) {
    require(view.standing.empty());
    return;
  }
  require(view.columns == width / 4 && view.rows == height / 4);
  require(view.standing.size() ==
          static_cast<std::size_t>(view.columns) * static_cast<std::size_t>(view.rows));
  require(std::abs(view.vanishing_row) <= height * 256);
}

} // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  Input in(data, size);
  Picture picture{160 + 4 * in.below(40), 160 + 4 * in.below(20), {}};
  picture.width += in.chance(16) ? in.below(900) : 0;
  picture.pixels.assign(static_cast<std::size_t>(picture.width) * static_cast<std::size_t>(picture.height),
                        0);
  const int cells_across = 1 + in.below(64), cells_down = 1 + in.below(64);
  std::vector<std::uint8_t> ground(
      static_cast<std::size_t>(cells_across) * static_cast<std::size_t>(cells_down), 255);
  const GrayView ground_view{{ground.data(), cells_across}, cells_across, cells_down};
  MotionObstacles motion, again;
  Place at;
  int speed = 0, turn = 0;
  std::int64_t pts = 0, step = 66'000'000;
  MotionKnowledge knowledge;
  for (int frame = 0; frame < 24 && !in.done(); ++frame) {
    switch (in.byte() % 16) {
    case 0:
      speed = static_cast<std::int8_t>(in.byte());
      break;
    case 1:
      turn = static_cast<std::int8_t>(in.byte()) / 4;
      break;
    case 2:
      at.row += static_cast<std::int8_t>(in.byte()) * 16;
      break;
    case 3:
      at.zoom = 16 + in.below(128);
      break;
    case 4:
      at.light = static_cast<std::int8_t>(in.byte());
      break;
    case 5:
      step = static_cast<std::int64_t>(in.number(5)) - (std::int64_t{1} << 38);
      break;
    case 6:
      pts = static_cast<std::int64_t>(in.number(8));
      break;
    case 7:
      motion.forget();
      again.forget();
      break;
    case 8:
      knowledge.line = static_cast<MotionKnowledge::Line>(in.number(1) % 3);
      knowledge.vanishing_row = static_cast<std::int16_t>(in.number(2)) * 16;
      break;
    case 9:
      for (std::uint8_t& cell : ground)
        cell = in.done() || in.byte() & 1 ? 255 : 0;
      break;
    case 10:
      pts = -1;
      step = 0;
      break;
    default:
      break; // on it goes
    }
    at.x = static_cast<int>(static_cast<unsigned>(at.x) + static_cast<unsigned>(turn)) & 0xFFFFFF;
    at.z = static_cast<int>(static_cast<unsigned>(at.z) + static_cast<unsigned>(speed)) & 0xFFFFFF;
    at.row = std::clamp(at.row, -64 * picture.height, 64 * picture.height);
    picture.draw(at, in.byte() % 40, in.take(in.chance(5) ? 64 : 0));
    const MotionView& view = motion.observe(picture.view(), ground_view, pts, knowledge);
    check(view, motion, picture.width, picture.height);
    const MotionView& same = again.observe(picture.view(), ground_view, pts, knowledge);
    require(same.vanishing_row == view.vanishing_row && same.speed_over_height == view.speed_over_height &&
            std::ranges::equal(same.standing, view.standing));
    if (pts >= 0 && step >= 0 && pts < (std::int64_t{1} << 60))
      pts += step;
  }
  return 0;
}
