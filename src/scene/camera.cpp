// SPDX-License-Identifier: LGPL-2.1-or-later
#include "scene/camera.hpp"

namespace terrainseg::scene {
namespace {

struct Rover {
  double height;  // of the camera above the ground, metres
  double speed;   // metres a second
  double horizon; // row as a fraction of the picture's height
  double offset;  // metres to the right of the path's line
  double swing;   // amplitude of turning in place, turns
  double winding; // amplitude of a winding path, metres
  int windings;   // periods of it per length of the world
};

constexpr Rover rovers[] = {
    // in the order of Kind
    {1.35, 8.0, 0.43, 1.75, 0.075, 9, 16},
    {0.9, 1.6, 0.39, 0, 0.055, 2.5, 64},
    {0.65, 1.0, 0.42, 0, 0.06, 0, 0},
    {1.0, 0.7, 0.36, 0, 0.16, 3, 64},
};

const Rover& rover_of(const Settings& settings) {
  return rovers[static_cast<int>(settings.kind)];
}

constexpr double drive_seconds = 7, swing_seconds = 5;

double phase_of(const Settings& settings, std::uint32_t which) {
  return unit(hash(settings.seed, 77, which));
}

} // namespace

Path::Path(const Settings& settings) {
  const Rover& rover = rover_of(settings);
  table_.resize(static_cast<std::size_t>((world_length + 8 * margin) * samples_per_metre));
  if (settings.motion != Motion::turn)
    return;
  const double phase = phase_of(settings, 1);
  for (std::size_t i = 0; i < table_.size(); ++i) {
    const double turns = (static_cast<double>(i) / samples_per_metre - margin) / world_length;
    table_[i] = static_cast<float>(
        rover.winding * (sine(turns * rover.windings + phase) + 0.4 * sine(turns * rover.windings * 2.5)));
  }
}

int Camera::horizon_row(int height) const {
  // forward.y + down.y * (row - center) / focal = 0
  if (down.y > -0.01F)
    return -1;
  const float row = center_y - forward.y / down.y * focal + 0.5F;
  return row >= 0 && row < static_cast<float>(height) ? static_cast<int>(row) : -1;
}

Camera Camera::mirrored() const {
  Camera below = *this;
  for (Vec3* v : {&below.position, &below.right, &below.down, &below.forward, &below.step_x, &below.step_y})
    v->y = -v->y;
  return below;
}

Moment moment_of(const Settings& settings, const Path& path, std::uint64_t number, int width, int height) {
  const Rover& rover = rover_of(settings);
  Moment moment;
  const double t = static_cast<double>(number) / frames_per_second;
  moment.seconds = t;

  double driven = settings.motion == Motion::still ? 0 : t, swing = 0;
  if (settings.motion == Motion::turn) {
    constexpr double cycle = drive_seconds + swing_seconds;
    const auto cycles = static_cast<double>(static_cast<std::int64_t>(t / cycle));
    const double in_cycle = t - cycles * cycle;
    driven = cycles * drive_seconds + std::min(in_cycle, drive_seconds);
    if (in_cycle > drive_seconds) {
      const double u = (in_cycle - drive_seconds) / swing_seconds;
      swing = rover.swing * sine(u) * (1 - cosine(2 * u)) * 0.65; // starts and ends gently
    }
  }
  const double start = world_length * phase_of(settings, 2);
  double z = start + driven * rover.speed;
  z -= world_length * static_cast<double>(static_cast<std::int64_t>(z / world_length));

  // The suspension moves a little in all motions but `still`.
  const double sway = settings.motion == Motion::still ? 0 : 1;
  const double rough = settings.motion == Motion::bumpy ? 1 : 0.07 * sway;
  const auto wave = [&](double hertz, std::uint32_t which) {
    return sine(t * hertz + phase_of(settings, which));
  };
  const double pitch = rough * (0.0055 * wave(1.1, 10) + 0.0025 * wave(2.7, 11) + 0.001 * wave(5.3, 12));
  const double roll = rough * (0.0085 * wave(0.8, 13) + 0.0035 * wave(1.9, 14));
  const double bounce = rough * (0.03 * wave(1.3, 15) + 0.01 * wave(3.1, 16));

  const auto zf = static_cast<float>(z);
  const float slope = (path.at(zf + 2) - path.at(zf - 2)) / 4;
  const double heading_cos = 1 / std::sqrt(1.0 + static_cast<double>(slope) * slope);
  const double heading_sin = slope * heading_cos;
  const double weave = 0.004 * sway * wave(0.21, 17);
  const double ys = sine(swing + weave), yc = cosine(swing + weave);
  const double sin_yaw = heading_sin * yc + heading_cos * ys, cos_yaw = heading_cos * yc - heading_sin * ys;

  Camera& c = moment.camera;
  const double focal = 0.82 * std::max(width, height);
  const double tilt = (0.5 - rover.horizon) * height / focal; // tangent of the fixed pitch
  const double tilt_cos = 1 / std::sqrt(1 + tilt * tilt), tilt_sin = tilt * tilt_cos;
  const double ps = sine(pitch), pc = cosine(pitch);
  const double sin_pitch = tilt_sin * pc + tilt_cos * ps, cos_pitch = tilt_cos * pc - tilt_sin * ps;
  const auto vec = [](double x, double y, double zz) {
    return Vec3{static_cast<float>(x), static_cast<float>(y), static_cast<float>(zz)};
  };
  c.forward = vec(sin_yaw * cos_pitch, -sin_pitch, cos_yaw * cos_pitch);
  const Vec3 level = vec(cos_yaw, 0, -sin_yaw);
  const Vec3 below = vec(-sin_yaw * sin_pitch, -cos_pitch, -cos_yaw * sin_pitch);
  const auto rs = static_cast<float>(sine(roll)), rc = static_cast<float>(cosine(roll));
  c.right = level * rc + below * rs;
  c.down = below * rc - level * rs;
  c.focal = static_cast<float>(focal);
  c.step_x = c.right * (1 / c.focal);
  c.step_y = c.down * (1 / c.focal);
  c.center_x = static_cast<float>(width - 1) * 0.5F;
  c.center_y = static_cast<float>(height - 1) * 0.5F;
  const auto lateral = static_cast<float>(rover.offset + 0.12 * sway * wave(0.13, 18));
  c.position = {path.at(zf) + lateral * static_cast<float>(heading_cos),
                static_cast<float>(rover.height + bounce), zf};
  return moment;
}

} // namespace terrainseg::scene
