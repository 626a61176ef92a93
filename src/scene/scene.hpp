// SPDX-License-Identifier: LGPL-2.1-or-later
// A rendered rover's view with its truth, for tests, demonstrations and the element `terrainscenesrc`.
//
//   scene::Renderer renderer({.kind = scene::Kind::trail, .seed = 7}, 640, 360);
//   scene::Picture picture(PixelFormat::I420, 640, 360);
//   renderer.render(42, picture);                 // frame 42; any order, each frame stands for itself
//   segmenter.process(picture.frame());           // pixels
//   picture.labels().plane.row(y)[x];             // truth of each pixel, Label
//   picture.horizon_row();                        // true horizon
//
// The same settings, size and frame number give the same bytes on every machine and build: single precision
// in a fixed order, no contraction, no function of the C library whose last bit may differ.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "terrainseg/frame.hpp"

namespace terrainseg::scene {

enum class Kind : std::uint8_t {
  road,     ///< asphalt with markings, kerbs or verges, parked and driving cars, houses, trees
  trail,    ///< a dirt path through grass, bushes and trees, with stones beside it
  corridor, ///< floor, walls, doors, lamps and furniture
  plain,    ///< sand or regolith with rocks, and hills far away
};

enum class Light : std::uint8_t {
  day,
  dusk,  ///< low sun or few lamps, a dark picture and a noisy sensor
  drift, ///< day, while exposure and white balance wander
  sun,   ///< a low sun in a clear sky: hard shadows, the rover's own too; in a corridor through windows
};

enum class Motion : std::uint8_t {
  straight, ///< along a straight path
  turn,     ///< along a winding path, stopping now and then to turn in place and back
  bumpy,    ///< straight over rough ground: the horizon pitches and rolls
  still,    ///< the rover stands; clouds, light, traffic and sensor noise go on
};

struct Settings {
  Kind kind = Kind::road;
  Light light = Light::day;
  Motion motion = Motion::straight;
  std::uint32_t seed = 1; ///< another seed, another place
  int obstacles = 40;     ///< 0..100: share of the places for an obstacle that have one
  bool wet = false;       ///< puddles that mirror stand on what is driven on; the truth does not mind

  bool operator==(const Settings&) const = default;
};

/// Codes of the truth, those of the labelled sequences the project is measured on.
enum Label : std::uint8_t {
  not_traversable = 0,
  driven_terrain = 1,    ///< what the rover drives on: road, path, floor, sand
  other_traversable = 2, ///< pavement, grass beside the path
  sky = 3,
  not_labelled = 255, ///< kerbs and the soft rim of grown things
};

/// Frames per second of the world: frame n shows it n / 30 s after frame 0, whatever rate it is played at.
inline constexpr int frames_per_second = 30;

/// A frame and its truth in memory of its own.
class Picture {
 public:
  Picture(PixelFormat format, int width, int height, Colorimetry colorimetry = {});

  Frame frame() const;
  MutableFrame mutable_frame();
  GrayView labels() const { return {{labels_.data(), width_}, width_, height_}; }
  int horizon_row() const { return horizon_row_; }

 private:
  friend class Renderer;
  PixelFormat format_;
  int width_, height_;
  Colorimetry colorimetry_;
  std::array<std::vector<std::uint8_t>, 3> planes_;
  std::array<std::ptrdiff_t, 3> strides_{};
  std::vector<std::uint8_t> labels_;
  std::uint64_t frame_number_ = 0;
  int horizon_row_ = -1;
};

/// How the camera stood over the ground (the plane of height 0) at a frame: a pinhole with square pixels
/// whose centres have integer coordinates.
struct View {
  double height = 0;                 ///< metres
  double focal = 0;                  ///< pixels
  double pitch = 0, roll = 0;        ///< radians: positive = looks down, right side down (REP 103)
  double center_x = 0, center_y = 0; ///< principal point, pixels
};

class Renderer {
 public:
  /// Width and height in pixels, 1..32767. Keeps about 30 bytes a pixel, twice as much when wet.
  Renderer(const Settings& settings, int width, int height);
  ~Renderer();
  Renderer(Renderer&&) noexcept;
  Renderer& operator=(Renderer&&) noexcept;

  /// Renders one frame. `frame` has the renderer's size and any format; `labels` takes one byte per pixel, or
  /// nothing when its data is null. Returns the true horizon: the row, at the middle of the width, of rays
  /// that run level; -1 when it lies outside the picture.
  int render(std::uint64_t number, const MutableFrame& frame, const MutablePlane& labels = {});

  /// The same into a picture of the renderer's size; its frame carries the presentation time.
  void render(std::uint64_t number, Picture& picture);

  /// The camera of a frame.
  View view_of(std::uint64_t number) const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

} // namespace terrainseg::scene
