// SPDX-License-Identifier: LGPL-2.1-or-later
// Renders a rover's view with its ground truth, for tests, demonstrations and the element `terrainscenesrc`.
//
//   scene::Renderer renderer({.kind = scene::Kind::trail, .seed = 7}, 640, 360);
//   scene::Picture picture(PixelFormat::I420, 640, 360);
//   renderer.render(42, picture);                 // frame 42; frames may be rendered in any order
//   segmenter.process(picture.frame());           // pixels
//   picture.labels().plane.row(y)[x];             // truth of each pixel, Label
//   picture.horizon_row();                        // true horizon
//
// The same settings, size and frame number give the same bytes on every machine and build: single precision
// in a fixed order, no contraction, no C library function whose last bit may differ.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "terrainseg/frame.hpp"

namespace terrainseg::scene {

enum class Kind : std::uint8_t {
  road,     ///< asphalt with markings, kerbs or verges, parked and driving cars, houses, trees
  trail,    ///< a dirt path through grass, bushes, trees and stones
  corridor, ///< floor, walls, doors, lamps and furniture
  plain,    ///< sand or regolith with rocks, and hills far away
};

enum class Light : std::uint8_t {
  day,
  dusk,  ///< low sun or few lamps, dark picture, noisy sensor
  drift, ///< day with changing exposure and white balance
  sun,   ///< low sun in a clear sky with hard shadows, also of the rover; in a corridor sun through windows
};

enum class Motion : std::uint8_t {
  straight, ///< along a straight path
  turn,     ///< along a winding path, with stops to turn in place and back
  bumpy,    ///< straight over rough ground: the horizon pitches and rolls
  still,    ///< the rover stands; clouds, light, traffic and sensor noise change
};

struct Settings {
  Kind kind = Kind::road;
  Light light = Light::day;
  Motion motion = Motion::straight;
  std::uint32_t seed = 1; ///< another seed gives another place
  int obstacles = 40;     ///< 0..100: per cent of the possible obstacles that exist
  bool wet = false;       ///< reflecting puddles on the driven terrain; they do not change the ground truth

  bool operator==(const Settings&) const = default;
};

/// Labels of the ground truth; the same codes as in the labelled sequences of the evaluation.
enum Label : std::uint8_t {
  not_traversable = 0,
  driven_terrain = 1,    ///< what the rover drives on: road, path, floor, sand
  other_traversable = 2, ///< pavement, grass beside the path
  sky = 3,
  not_labelled = 255, ///< kerbs and the blurred edges of plants
};

/// Frames per second of the world: frame n shows it n / 30 s after frame 0, at any playback rate.
inline constexpr int frames_per_second = 30;

/// A frame and its ground truth in their own memory.
class Picture {
 public:
  Picture(PixelFormat format, int width, int height, Colorimetry colorimetry = {});

  Frame frame() const;
  MutableFrame mutable_frame();
  GrayView labels() const { return {{labels_.data(), frame_.width}, frame_.width, frame_.height}; }
  int horizon_row() const { return horizon_row_; }

 private:
  friend class Renderer;

  std::array<std::vector<std::uint8_t>, 3> planes_;
  MutableFrame frame_; ///< without the memory of its planes
  std::vector<std::uint8_t> labels_;
  std::uint64_t frame_number_ = 0;
  int horizon_row_ = -1;
};

/// The camera over the ground plane (height 0) at a frame: a pinhole with square pixels whose centres have
/// integer coordinates.
struct View {
  double height = 0;                 ///< metres
  double focal = 0;                  ///< pixels
  double pitch = 0, roll = 0;        ///< radians: positive = looks down, right side down (REP 103)
  double center_x = 0, center_y = 0; ///< principal point, pixels
};

class Renderer {
 public:
  /// Width and height in pixels, 1..32767. Uses about 30 bytes per pixel, 60 if wet.
  Renderer(const Settings& settings, int width, int height);
  ~Renderer();

  /// Renders one frame. `frame` has the renderer's size and any format. `labels` has one byte per pixel; a
  /// null pointer means that no labels are needed. Returns the true horizon: the row of horizontal rays at
  /// the middle of the width; -1 outside the picture.
  int render(std::uint64_t number, const MutableFrame& frame, const MutablePlane& labels = {});

  /// Renders into a picture of the renderer's size; its frame gets the presentation time.
  void render(std::uint64_t number, Picture& picture);

  View view_of(std::uint64_t number) const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

} // namespace terrainseg::scene
