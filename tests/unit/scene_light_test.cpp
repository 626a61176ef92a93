// SPDX-License-Identifier: LGPL-2.1-or-later
// A low sun and water on the ground: shadows where plane geometry says, mirrors where optics says, and a
// truth that minds neither.
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>

#include "scene/draw.hpp"
#include "scene/scene.hpp"

namespace {

using namespace terrainseg;
using namespace terrainseg::scene;

constexpr int width = 320, height = 180;
constexpr Kind kinds[] = {Kind::road, Kind::trail, Kind::corridor, Kind::plain};

struct Shot {
  Picture picture{PixelFormat::RGB, width, height, {ColorRange::full, {}}};
  explicit Shot(const Settings& settings, std::uint64_t number = 0) {
    Renderer(settings, width, height).render(number, picture);
  }
  const std::uint8_t* rgb(int x, int y) const { return picture.frame().planes[0].row(y) + 3 * x; }
  int label(int x, int y) const { return picture.labels().plane.row(y)[x]; }
};

Settings settings_of(Kind kind, Light light, std::uint32_t seed, int obstacles = 40, bool wet = false) {
  return {kind, light, Motion::straight, seed, obstacles, wet};
}

// ---- shadows against rays
// ----------------------------------------------------------------------------------

/// Does the straight way from a point of the ground to the sun pass through the box? In its own axes, a slab
/// after the other.
bool in_the_way(const Thing& box, double x, double z, const Vec3& sun) {
  const double dx = x - box.base.x, dz = z - box.base.z, c = box.heading.cos, s = box.heading.sin;
  const double origin[3] = {c * dx - s * dz, 0, s * dx + c * dz};
  const double way[3] = {c * sun.x - s * sun.z, sun.y, s * sun.x + c * sun.z};
  const double low[3] = {-box.half_x, box.low, -box.half_z}, high[3] = {box.half_x, box.height, box.half_z};
  double first = 0, last = 1e9;
  for (int i = 0; i < 3; ++i) {
    if (std::abs(way[i]) < 1e-12) {
      if (origin[i] < low[i] || origin[i] > high[i])
        return false;
      continue;
    }
    const double a = (low[i] - origin[i]) / way[i], b = (high[i] - origin[i]) / way[i];
    first = std::max(first, std::min(a, b));
    last = std::min(last, std::max(a, b));
  }
  return first < last;
}

struct Shadows {
  Settings settings;
  Path path{settings};
  Noise noise{1};
  Place place = place_of(settings);
  Lighting light = lighting_of(settings, 0);
  Moment moment = moment_of(settings, path, 0, width, height);
  Canvas canvas{width, height};
  std::vector<Thing> things, rover = parts_of_the_rover(settings, moment);

  explicit Shadows(const Settings& s) : settings(s) {}

  Stage stage() const { return {settings, place, path, noise, light, moment}; }

  void cast() {
    canvas.clear();
    cast_hard_shadows(stage(), things, canvas);
  }

  /// 1 in shadow, 0 in the sun, -1 above the horizon.
  int expected(int x, int y) const {
    const Camera& c = moment.camera;
    const Vec3 ray = c.ray(static_cast<float>(x), static_cast<float>(y));
    if (ray.y > -0.03F)
      return -1;
    const double t = c.position.y / -ray.y, gx = c.position.x + t * ray.x, gz = c.position.z + t * ray.z;
    for (const auto* boxes : {&things, &rover})
      for (const Thing& box : *boxes)
        if (in_the_way(box, gx, gz, light.sun))
          return 1;
    return 0;
  }
};

TEST(SceneLight, BoxesAndTheRoverShadeWhatTheyHideFromTheSun) {
  int in_shadow = 0, own_in_window = 0, seeds_without_own = 0;
  for (const Kind kind : {Kind::road, Kind::trail, Kind::plain})
    for (std::uint32_t seed = 1; seed <= 16; ++seed) {
      Shadows s(settings_of(kind, Light::sun, seed));
      const Vec3 eye = s.moment.camera.position;
      Thing crate, pole;
      crate.kind = Thing::Kind::crate;
      crate.base = {eye.x - 2, 0, eye.z + 7};
      crate.half_x = 0.6F;
      crate.half_z = 0.3F;
      crate.height = 1.2F;
      crate.heading = {0.8F, 0.6F};
      pole.kind = Thing::Kind::pole;
      pole.base = {eye.x + 3, 0, eye.z - 6}; // behind the rover: only its shadow can be in sight
      pole.half_x = pole.half_z = 0.3F;
      pole.height = 6;
      s.things = {crate, pole};
      s.cast();
      Shadows alone(settings_of(kind, Light::sun, seed));
      alone.cast();
      std::vector<int> truth(s.canvas.labels.size());
      for (int y = 0; y < height; ++y)
        for (int x = 0; x < width; ++x)
          truth[s.canvas.at(x, y)] = s.expected(x, y);
      int wrong = 0, own = 0;
      for (int y = 1; y < height - 1; ++y)
        for (int x = 1; x < width - 1; ++x) {
          const int wanted = truth[s.canvas.at(x, y)];
          bool inside = wanted >= 0; // and not on an edge
          for (int k = 0; k < 9; ++k)
            inside = inside && truth[s.canvas.at(x + k % 3 - 1, y + k / 3 - 1)] == wanted;
          if (!inside)
            continue;
          const float left = s.canvas.shade[s.canvas.at(x, y)].g;
          in_shadow += wanted;
          wrong += wanted != (left < 0.6F); // a strip between two pixels' middles darkens both a little
          own += y >= height - height * 15 / 100 && std::abs(x - width / 2) < width * 15 / 100 &&
                 alone.canvas.shade[alone.canvas.at(x, y)].g < 0.5F;
        }
      EXPECT_EQ(wrong, 0) << "kind " << static_cast<int>(kind) << " seed " << seed;
      own_in_window += own;
      seeds_without_own += own == 0;
    }
  EXPECT_GT(in_shadow, 20000);
  // The rover's own shadow falls into the training window in some places, and not in others.
  EXPECT_GT(own_in_window, 600);
  EXPECT_GT(seeds_without_own, 20);
}

TEST(SceneLight, InShadowTheSkyIsLeftOnceHoweverManyStandInTheWay) {
  for (std::uint32_t seed = 1; seed <= 12; ++seed) {
    Shadows s(settings_of(Kind::plain, Light::sun, seed));
    Thing crate;
    crate.kind = Thing::Kind::crate;
    crate.base = s.moment.camera.position + Vec3{0, 0, 6};
    crate.base.y = 0;
    s.things = {crate, crate, crate};
    s.cast();
    const Lighting& l = s.light;
    // A level surface has the sun's light by the sine of its height, and the whole of the sky's.
    const Color kept = {l.ambient.r / (l.ambient.r + l.sun_light.r * l.sun.y),
                        l.ambient.g / (l.ambient.g + l.sun_light.g * l.sun.y),
                        l.ambient.b / (l.ambient.b + l.sun_light.b * l.sun.y)};
    EXPECT_LT(kept.r, kept.g);
    EXPECT_LT(kept.g, kept.b);
    EXPECT_GT(kept.r, 0.1F);
    EXPECT_LT(kept.b, 0.5F);
    Color darkest = {1, 1, 1};
    for (const Color& left : s.canvas.shade)
      if (left.g < darkest.g)
        darkest = left;
    EXPECT_NEAR(darkest.r, kept.r, 1e-5);
    EXPECT_NEAR(darkest.g, kept.g, 1e-5);
    EXPECT_NEAR(darkest.b, kept.b, 1e-5);
  }
}

TEST(SceneLight, EdgesAreHardAndOnlyDarken) {
  for (const Kind kind : {Kind::road, Kind::trail})
    for (std::uint32_t seed = 1; seed <= 6; ++seed) {
      Shadows s(settings_of(kind, Light::sun, seed));
      things_in_sight(s.stage(), s.things);
      s.cast();
      int lit = 0, between = 0, dark = 0;
      for (const Color& left : s.canvas.shade) {
        ASSERT_LE(left.g, 1);
        (left.g > 0.99F ? lit : left.g < 0.4F ? dark : between)++;
      }
      EXPECT_GT(dark, 20) << static_cast<int>(kind) << " " << seed;
      EXPECT_LT(between, 0.5 * dark + 50) << static_cast<int>(kind) << " " << seed;
    }
}

TEST(SceneLight, ShadedGroundIsDarkerAndBluerInThePicture) {
  double ratio[3] = {};
  int pixels = 0, brighter = 0, ground = 0;
  for (std::uint32_t seed = 1; seed <= 6; ++seed) {
    const Shot open(settings_of(Kind::plain, Light::sun, seed, 0)),
        stony(settings_of(Kind::plain, Light::sun, seed, 100));
    for (int y = height / 2; y < height; ++y)
      for (int x = 0; x < width; ++x) {
        if (open.label(x, y) != driven_terrain || stony.label(x, y) != driven_terrain)
          continue;
        const std::uint8_t *a = open.rgb(x, y), *b = stony.rgb(x, y);
        // The same ground and the same noise: where no shadow falls the same bytes.
        brighter += b[1] > a[1]; // the soft rim of a stone
        ++ground;
        if (b[1] > 0.75 * a[1] || a[0] < 30)
          continue;
        for (int c = 0; c < 3; ++c)
          ratio[c] += static_cast<double>(b[c]) / a[c];
        ++pixels;
      }
  }
  ASSERT_GT(pixels, 500);
  EXPECT_LT(brighter, ground / 200);
  EXPECT_GT(ratio[1] / pixels, 0.2);
  EXPECT_LT(ratio[1] / pixels, 0.65);
  EXPECT_GT(ratio[2], 1.08 * ratio[0]);
}

// ---- water
// -------------------------------------------------------------------------------------------------

TEST(SceneLight, TheMirroredCameraSeesWhatIsAboveWhereItsReflectionIs) {
  const Shadows s(settings_of(Kind::road, Light::day, 3));
  const Camera& camera = s.moment.camera;
  const Camera below = camera.mirrored();
  for (const Vec3& offset : {Vec3{0, 0, 8}, Vec3{-3, 2, 12}, Vec3{4, 7, 30}}) {
    const Vec3 above = {camera.position.x + offset.x, offset.y, camera.position.z + offset.z};
    const Vec3 image = {above.x, -above.y, above.z};
    const auto pixel = [](const Camera& c, const Vec3& point) {
      const Vec3 from = point - c.position;
      return std::array{dot(from, c.right) / c.depth(point), dot(from, c.down) / c.depth(point)};
    };
    EXPECT_NEAR(pixel(below, above)[0], pixel(camera, image)[0], 1e-5);
    EXPECT_NEAR(pixel(below, above)[1], pixel(camera, image)[1], 1e-5);
  }
}

TEST(SceneLight, WaterLiesOnWhatIsDrivenOnAlone) {
  for (const Kind kind : kinds) {
    int changed = 0, driven = 0;
    for (std::uint32_t seed = 1; seed <= 5; ++seed) {
      const Shot dry(settings_of(kind, Light::day, seed)), wet(settings_of(kind, Light::day, seed, 40, true));
      for (int y = 0; y < height; ++y)
        for (int x = 0; x < width; ++x) {
          ASSERT_EQ(dry.label(x, y), wet.label(x, y));
          const bool differs = std::memcmp(dry.rgb(x, y), wet.rgb(x, y), 3) != 0;
          driven += dry.label(x, y) == driven_terrain;
          changed += differs && dry.label(x, y) == driven_terrain;
          // Beside it, and where a thing's soft rim lets some of it through, at most a trace.
          if (differs && (dry.label(x, y) == sky || y < height / 4))
            ADD_FAILURE() << x << "," << y;
        }
    }
    EXPECT_GT(changed, driven / 50) << static_cast<int>(kind);
    EXPECT_LT(changed, driven * 4 / 5) << static_cast<int>(kind);
  }
}

TEST(SceneLight, FarPuddlesMirrorTheSky) {
  // Seen at a flat angle water has the sky's light, whatever it stands on; near the rover mostly its
  // bottom's.
  double far_light = 0, near_light = 0;
  int far = 0, near = 0;
  for (std::uint32_t seed = 1; seed <= 8; ++seed) {
    const Shot dry(settings_of(Kind::plain, Light::day, seed, 0)),
        wet(settings_of(Kind::plain, Light::day, seed, 0, true));
    const int horizon = dry.picture.horizon_row();
    for (int y = horizon + 3; y < height; ++y)
      for (int x = 0; x < width; ++x) {
        const int change = wet.rgb(x, y)[2] - dry.rgb(x, y)[2];
        if (std::abs(change) < 12 || dry.label(x, y) != driven_terrain)
          continue;
        if (y < horizon + 15) {
          far_light += change;
          ++far;
        } else if (y > height - 30) {
          near_light += change;
          ++near;
        }
      }
  }
  ASSERT_GT(far, 500);
  ASSERT_GT(near, 500);
  EXPECT_GT(far_light / far, 10);
  EXPECT_LT(near_light / near, far_light / far - 20);
}

TEST(SceneLight, TheTruthMindsNoLight) {
  for (const Kind kind : kinds)
    for (const Motion motion : {Motion::straight, Motion::turn, Motion::bumpy})
      for (std::uint32_t seed = 1; seed <= 3; ++seed) {
        Settings day = settings_of(kind, Light::day, seed),
                 sun = settings_of(kind, Light::sun, seed, 40, true);
        day.motion = sun.motion = motion;
        const Shot a(day, 61), b(sun, 61), again(sun, 61);
        EXPECT_EQ(a.picture.horizon_row(), b.picture.horizon_row());
        for (int y = 0; y < height; ++y) {
          ASSERT_EQ(std::memcmp(a.picture.labels().plane.row(y), b.picture.labels().plane.row(y), width), 0);
          ASSERT_EQ(std::memcmp(again.rgb(0, y), b.rgb(0, y), std::size_t{3} * width), 0);
        }
      }
}

TEST(SceneLight, TheSunComesThroughTheWindowsOfACorridor) {
  int sunlit = 0;
  for (std::uint32_t seed = 1; seed <= 6; ++seed) {
    const Shot lamps(settings_of(Kind::corridor, Light::day, seed)),
        sun(settings_of(Kind::corridor, Light::sun, seed));
    for (int y = height / 2; y < height; ++y)
      for (int x = 0; x < width; ++x)
        sunlit += lamps.label(x, y) == driven_terrain && sun.rgb(x, y)[1] > lamps.rgb(x, y)[1] + 40;
  }
  EXPECT_GT(sunlit, 1000);
}

} // namespace
