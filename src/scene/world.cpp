// SPDX-License-Identifier: LGPL-2.1-or-later
#include "scene/world.hpp"

namespace terrainseg::scene {
namespace {

constexpr Color grey(float v) {
  return {v, v, v};
}

Vec3 toward_sun(float elevation_turns, float azimuth_turns) {
  const auto up = static_cast<float>(sine(elevation_turns)),
             along = static_cast<float>(cosine(elevation_turns));
  return {along * static_cast<float>(sine(azimuth_turns)), up,
          along * static_cast<float>(cosine(azimuth_turns))};
}

// Obstacles have either their own colour or one close to the ground's.
Color obstacle_color(Dice& dice, const Color& own, const Color& ground, float likeness) {
  if (!dice.chance(likeness))
    return own;
  const float brightness = dice.roll(0.75F, 1.3F);
  return ground * brightness;
}

Color car_color(Dice& dice) {
  constexpr Color paints[] = {{0.45F, 0.02F, 0.02F},   {0.03F, 0.07F, 0.3F},   {0.6F, 0.6F, 0.6F},
                              {0.025F, 0.025F, 0.03F}, {0.13F, 0.13F, 0.135F}, {0.3F, 0.31F, 0.33F},
                              {0.05F, 0.16F, 0.09F},   {0.5F, 0.42F, 0.25F}};
  return paints[dice.next() % 8];
}

Heading heading_at(const Path& path, float z) {
  const float slope = (path.at(z + 1) - path.at(z - 1)) * 0.5F;
  const float c = 1 / std::sqrt(1 + slope * slope);
  return {c, slope * c};
}

/// A car whose front points along `way`.
Thing car_at(float x, float z, const Heading& way, Dice& dice, const Color& color) {
  return {.kind = Thing::Kind::car,
          .base = {x, 0, z},
          .half_x = 0.88F,
          .half_z = dice.roll(1.9F, 2.3F),
          .height = dice.roll(1.4F, 1.75F),
          .heading = way,
          .color = color,
          .key = dice.next()};
}

Thing tree_at(float x, float z, Dice& dice, float low, float high) {
  const float height = dice.roll(low, high), radius = height * dice.roll(0.2F, 0.34F);
  return {.kind = Thing::Kind::tree,
          .base = {x, 0, z},
          .half_x = radius,
          .half_z = radius,
          .height = height,
          .color = mix(Color{0.05F, 0.1F, 0.02F}, Color{0.12F, 0.12F, 0.03F}, dice.roll()),
          .key = dice.next()};
}

/// A bush or a rock.
Thing lump_at(Thing::Kind kind, float x, float z, float size, Dice& dice, const Color& color) {
  const bool bush = kind == Thing::Kind::bush;
  return {.kind = kind,
          .base = {x, 0, z},
          .half_x = size,
          .half_z = size,
          .height = size * (bush ? dice.roll(1.0F, 1.7F) : dice.roll(0.8F, 1.5F)),
          .color = color,
          .key = dice.next()};
}

/// Places the objects along the rover's way.
class Way {
 public:
  Way(const Stage& stage, std::vector<Thing>& things)
      : s_(stage.settings), place_(stage.place), path_(stage.path), moment_(stage.moment), things_(things) {}

  void road() {
    roadside();
    poles();
    parked();
    if (s_.obstacles == 0)
      return;
    oncoming();
    lead();
  }

  void trail() {
    each_side(z0_ - 4 - reach_, z0_ + 60, 4, 11, [&](float z, float side, Dice& dice) {
      for (int i = 0; i < 2; ++i)
        if (dice.chance(0.6F)) {
          const float tz = z + dice.roll(0, 4), away = dice.roll();
          things_.push_back(tree_at(path_.at(tz) + side * (2.6F + 11 * away * away + 1), tz, dice, 5, 11));
        }
      for (int i = 0; i < 3; ++i) {
        const float bz = z + dice.roll(0, 4), x = place_.half_width + dice.roll(0.5F, 5);
        const Color leaves = mix(
            place_.beside, mix(Color{0.05F, 0.1F, 0.02F}, Color{0.17F, 0.12F, 0.04F}, dice.roll()), 0.75F);
        const float size = dice.roll(0.25F, 0.75F);
        if (dice.chance(0.3F + filled_ * 0.7F))
          things_.push_back(lump_at(Thing::Kind::bush, path_.at(bz) + side * x, bz, size, dice, leaves));
      }
    });
    each_side(z0_ + 0.5F, z0_ + 40, 2, 12, [&](float z, float side, Dice& dice) {
      const bool there = dice.chance(filled_ * 0.6F);
      const float rz = z + dice.roll(0, 2), x = side * (place_.half_width * dice.roll(0.85F, 1.15F));
      Dice own(dice.next());
      if (!there)
        return;
      const float size = own.roll(0.1F, 0.28F);
      const Color color = obstacle_color(own, grey(0.2F), place_.surface, 0.5F);
      things_.push_back(lump_at(Thing::Kind::rock, path_.at(rz) + x, rz, size, own, color));
    });
  }

  void corridor() {
    each_side(z0_ - 2, z0_ + 40, 2, 21, [&](float z, float side, Dice& dice) {
      const bool there = dice.chance(filled_ * 0.55F);
      Dice own(dice.next());
      if (!there)
        return;
      Thing thing;
      const float what = own.roll();
      constexpr Color colors[] = {
          {0.5F, 0.35F, 0.2F}, {0.12F, 0.2F, 0.35F}, {0.6F, 0.6F, 0.58F}, {0.4F, 0.08F, 0.06F}};
      const Color own_color = colors[own.next() % 4];
      if (what < 0.4F) {
        thing.kind = Thing::Kind::cabinet;
        thing.half_x = own.roll(0.18F, 0.3F);
        thing.half_z = own.roll(0.35F, 0.6F);
        thing.height = own.roll(0.7F, 1.9F);
      } else if (what < 0.75F) {
        thing.kind = Thing::Kind::crate;
        thing.half_x = thing.half_z = own.roll(0.14F, 0.28F);
        thing.height = own.roll(0.2F, 0.5F);
      } else {
        thing.kind = Thing::Kind::bin;
        thing.half_x = thing.half_z = 0.15F;
        thing.height = own.roll(0.3F, 0.6F);
      }
      thing.color = obstacle_color(own, own_color, place_.surface, 0.35F);
      const float reach = place_.half_width - thing.half_x - 0.05F;
      thing.base = {side * (thing.kind == Thing::Kind::crate ? reach - own.roll(0, 0.2F) : reach), 0,
                    z + own.roll(0.5F, 1.5F)};
      thing.key = own.next();
      if (thing.kind == Thing::Kind::crate) {
        const float turn = own.roll(-0.08F, 0.08F);
        thing.heading = {static_cast<float>(cosine(turn)), static_cast<float>(sine(turn))};
      }
      things_.push_back(thing);
    });
  }

  void plain() {
    const Vec3& eye = moment_.camera.position;
    const auto scatter = [&](float cell, int reach, float low, float high, float share, std::uint32_t key) {
      const int cells = static_cast<int>(world_length / cell);
      const int cx = floor_of(eye.x / cell), cz = floor_of(eye.z / cell);
      for (int j = cz - reach; j <= cz + reach; ++j)
        for (int i = cx - reach; i <= cx + reach; ++i) {
          Dice dice(hash(key, static_cast<std::uint32_t>(i),
                         static_cast<std::uint32_t>((j % cells + cells) % cells)));
          if (!dice.chance(share))
            continue;
          const float x = (static_cast<float>(i) + dice.roll()) * cell,
                      z = (static_cast<float>(j) + dice.roll()) * cell;
          const float r = dice.roll(), size = low + (high - low) * r * r * r;
          if (std::abs(x - path_.at(z)) < 0.75F + size)
            continue; // keeps the rover's path free
          const Color color =
              obstacle_color(dice, mix(grey(0.13F), place_.surface, 0.25F), place_.surface, 0.5F);
          things_.push_back(lump_at(Thing::Kind::rock, x, z, size, dice, color));
        }
    };
    scatter(2, 8, 0.07F, 0.3F, filled_, hash(s_.seed, 31));
    scatter(8, 11, 0.25F, 1.3F, filled_, hash(s_.seed, 32));
  }

 private:
  /// Visits the cells of `length` metres between two z. Their dice repeat with the world's period.
  template <class Visit>
  void each_cell(float from, float to, float length, std::uint32_t which, Visit&& visit) const {
    const int cells = static_cast<int>(world_length / length);
    for (int i = floor_of(from / length); i <= floor_of(to / length); ++i)
      visit(static_cast<float>(i) * length,
            Dice(hash(hash(s_.seed, which), static_cast<std::uint32_t>((i % cells + cells) % cells))));
  }

  /// Visits the left and the right side of the cells.
  template <class Visit>
  void each_side(float from, float to, float length, std::uint32_t which, Visit&& visit) const {
    each_cell(from, to, length, which, [&](float z, Dice dice) {
      for (const float side : {-1.0F, 1.0F})
        visit(z, side, dice);
    });
  }

  void roadside() {
    each_side(z0_ - 14 - reach_, z0_ + 130, 16, 1, [&](float z, float side, Dice& dice) {
      if (place_.urban && dice.chance(0.85F))
        house(z, side, dice);
      const int trees = place_.urban ? dice.chance(0.35F) : static_cast<int>(dice.next() % 3);
      for (int i = 0; i < trees; ++i) {
        const float tz = z + dice.roll(0, 16);
        const float x = place_.urban ? place_.pavement - 0.6F : place_.half_width + dice.roll(2.5F, 14);
        things_.push_back(tree_at(path_.at(tz) + side * x, tz, dice, 5, 10));
      }
      if (!place_.urban)
        for (int i = 0; i < 2; ++i)
          if (dice.chance(filled_)) {
            const float bz = z + dice.roll(0, 16);
            const float away = place_.half_width + dice.roll(1.0F, 6), size = dice.roll(0.4F, 1);
            const Color leaves = mix(place_.beside, Color{0.05F, 0.09F, 0.02F}, dice.roll());
            things_.push_back(lump_at(Thing::Kind::bush, path_.at(bz) + side * away, bz, size, dice, leaves));
          }
    });
  }

  void poles() {
    each_cell(z0_ - 6 - reach_, z0_ + 110, 32, 2, [&](float z, Dice dice) {
      const float side = dice.chance(0.5F) ? 1.0F : -1.0F;
      things_.push_back({.kind = Thing::Kind::pole,
                         .base = {path_.at(z) + side * (place_.half_width + 0.7F), 0, z},
                         .half_x = 0.07F,
                         .half_z = 0.07F,
                         .height = 6,
                         .color = grey(0.25F)});
    });
  }

  /// Parked cars, and concrete blocks, half of which have the asphalt's colour.
  void parked() {
    each_side(z0_ - 4 - reach_, z0_ + 90, 8, 3, [&](float z, float side, Dice& dice) {
      const bool there = dice.chance(filled_), is_car = dice.chance(place_.urban ? 0.8F : 0.25F);
      const float middle = z + 4 + dice.roll(-0.6F, 0.6F);
      Dice own(dice.next());
      if (there && is_car) {
        const float kerb = place_.half_width - (place_.urban ? 1.1F : -1.6F);
        const Color paint = obstacle_color(own, car_color(own), place_.surface, 0.25F);
        things_.push_back(
            car_at(path_.at(middle) + side * kerb, middle, heading_at(path_, middle), own, paint));
      } else if (there) {
        things_.push_back({.kind = Thing::Kind::crate,
                           .base = {path_.at(middle) + side * (place_.half_width - 0.5F), 0, middle},
                           .half_x = own.roll(0.2F, 0.45F),
                           .half_z = own.roll(0.3F, 1),
                           .height = own.roll(0.4F, 0.9F),
                           .heading = heading_at(path_, middle),
                           .color = obstacle_color(own, {0.5F, 0.16F, 0.02F}, place_.surface, 0.5F),
                           .key = own.next()});
      }
    });
  }

  /// Oncoming traffic: placed on a line that moves towards the rover.
  void oncoming() {
    const double driven = moment_.seconds * 9;
    const auto shift =
        static_cast<float>(driven - 2048.0 * static_cast<double>(static_cast<std::int64_t>(driven / 2048.0)));
    each_cell(z0_ + shift - 8, z0_ + shift + 120, 32, 4, [&](float w, Dice dice) {
      if (!dice.chance(filled_))
        return;
      const float z = w + dice.roll(4, 28) - shift;
      const Heading h = heading_at(path_, z);
      const Color paint = car_color(dice);
      things_.push_back(car_at(path_.at(z) - 1.75F, z, {-h.cos, -h.sin}, dice, paint));
    });
  }

  /// A car ahead in the rover's lane.
  void lead() {
    Dice dice(hash(s_.seed, 5));
    if (!dice.chance(0.3F + 0.7F * filled_))
      return;
    const auto gap = static_cast<float>(18 + 8 * sine(moment_.seconds * 0.05 + dice.roll()));
    const float z = z0_ + gap;
    const Color paint = obstacle_color(dice, car_color(dice), place_.surface, 0.3F);
    things_.push_back(car_at(path_.at(z) + 1.75F, z, heading_at(path_, z), dice, paint));
  }

  void house(float z, float side, Dice& dice) {
    constexpr Color walls[] = {{0.42F, 0.2F, 0.13F},
                               {0.55F, 0.5F, 0.4F},
                               {0.3F, 0.28F, 0.26F},
                               {0.6F, 0.57F, 0.52F},
                               {0.35F, 0.15F, 0.1F}};
    const float half_x = dice.roll(3.5F, 5), half_z = dice.roll(6, 7.8F), height = dice.roll(6, 11);
    const float middle = z + 8, x = side * (place_.pavement + dice.roll(1, 4) + half_x);
    const Color& wall = walls[dice.next() % 5];
    things_.push_back({.kind = Thing::Kind::house,
                       .base = {path_.at(middle) + x, 0, middle},
                       .half_x = half_x,
                       .half_z = half_z,
                       .height = height,
                       .heading = heading_at(path_, middle),
                       .color = wall * dice.roll(0.7F, 1.1F),
                       .key = dice.next()});
  }

  const Settings& s_;
  const Place& place_;
  const Path& path_;
  const Moment& moment_;
  const float z0_ = moment_.camera.position.z, filled_ = static_cast<float>(s_.obstacles) / 100;
  const float reach_ = s_.light == Light::sun ? 48 : 0; ///< of visible shadows from behind the rover, metres
  std::vector<Thing>& things_;
};

} // namespace

Lighting lighting_of(const Settings& settings, double seconds) {
  Lighting light;
  Dice dice(hash(settings.seed, 41));
  const float azimuth = dice.roll();
  const bool dusk = settings.light == Light::dusk;
  light.clouds = dice.roll(0.15F, 0.75F);
  const bool sun = settings.light == Light::sun;
  if (settings.kind == Kind::corridor) {
    if (sun) { // from the side, so that it shines into the corridor
      const float across = dice.roll(0.17F, 0.33F);
      light.window_sun = toward_sun(dice.roll(0.09F, 0.13F), azimuth < 0.5F ? across : -across);
      light.window_light = {2.4F, 2.2F, 1.9F};
    }
    light.sun = {0, 1, 0};
    light.sun_light = dusk ? Color{0.1F, 0.085F, 0.06F} : Color{0.38F, 0.37F, 0.34F};
    light.ambient = dusk ? Color{0.1F, 0.095F, 0.085F} : Color{0.46F, 0.46F, 0.45F};
    light.haze = light.ambient * 0.55F;
    light.haze_distance = 45;
    light.exposure = grey(dusk ? 1.6F : 1.3F);
  } else if (dusk) {
    light.sun = toward_sun(dice.roll(0.02F, 0.035F), azimuth);
    light.sun_light = {0.5F, 0.24F, 0.1F};
    light.ambient = {0.17F, 0.18F, 0.24F};
    light.haze = {0.32F, 0.22F, 0.19F};
    light.zenith = {0.08F, 0.11F, 0.22F};
    light.haze_distance = 700;
    light.exposure = grey(1.4F);
  } else if (sun) {
    light.clear = true;
    light.clouds = 0.1F;
    light.cloud_shade = 0;
    light.sun = toward_sun(dice.roll(0.04F, 0.075F), azimuth);
    light.sun_light = {2.4F, 2.2F, 1.9F};
    light.ambient = {0.2F, 0.225F, 0.27F};
    light.haze = {0.6F, 0.67F, 0.78F};
    light.zenith = {0.14F, 0.28F, 0.62F};
    light.haze_distance = 1800;
    light.exposure = grey(1.6F / light.on({0, 1, 0}).g);
  } else {
    light.sun = toward_sun(dice.roll(0.09F, 0.17F), azimuth);
    const float veil = smooth(0.55F, 0.75F, light.clouds); // clouds: weak shadows
    light.sun_light = Color{1.25F, 1.15F, 0.98F} * (1 - 0.75F * veil);
    light.ambient = mix(Color{0.38F, 0.44F, 0.54F}, Color{0.62F, 0.65F, 0.7F}, veil);
    light.haze = mix(Color{0.66F, 0.74F, 0.86F}, Color{0.78F, 0.79F, 0.8F}, veil);
    light.zenith = mix(Color{0.16F, 0.32F, 0.7F}, Color{0.5F, 0.54F, 0.6F}, veil);
    light.haze_distance = mix(1400.0F, 700.0F, veil);
    light.exposure = grey(1.32F);
  }
  if (settings.kind == Kind::plain && !dusk) {
    light.haze = mix(light.haze, Color{0.75F, 0.62F, 0.48F}, 0.6F);
    light.zenith = mix(light.zenith, Color{0.45F, 0.42F, 0.42F}, 0.5F);
  }
  light.sensor_noise = (dusk ? 3.2F : 1.4F) * (settings.kind == Kind::corridor ? 0.7F : 1.0F);
  if (settings.light == Light::drift) {
    const double phase = unit(hash(settings.seed, 42));
    const auto brightness =
        static_cast<float>(1 + 0.42 * sine(seconds / 9 + phase) + 0.12 * sine(seconds / 3.1));
    const auto warmth = static_cast<float>(0.16 * sine(seconds / 13 + 2 * phase));
    light.exposure = light.exposure * brightness * Color{1 + warmth, 1, 1 - warmth};
  }
  return light;
}

Place place_of(const Settings& settings) {
  Place place;
  Dice dice(hash(settings.seed, 51));
  const float tone = dice.roll(0.8F, 1.2F);
  place.clumps = dice.roll(0.6F, 1.3F);
  switch (settings.kind) {
  case Kind::road:
    place.urban = dice.chance(0.5F);
    place.half_width = place.urban ? 5.7F : 3.75F;
    place.pavement = place.urban ? 8 : 0;
    place.surface = Color{0.105F, 0.105F, 0.11F} * tone;
    place.beside = mix(Color{0.105F, 0.15F, 0.05F}, Color{0.22F, 0.19F, 0.1F}, dice.roll() * 0.8F);
    place.skyline = place.urban ? 0.07F : 0.09F;
    place.clearing = 130;
    place.skyline_color = {0.05F, 0.075F, 0.03F};
    break;
  case Kind::trail:
    place.half_width = dice.roll(1.05F, 1.35F);
    place.surface = mix(Color{0.235F, 0.19F, 0.125F}, Color{0.26F, 0.24F, 0.2F}, dice.roll()) * tone;
    place.beside = mix(Color{0.115F, 0.15F, 0.06F}, Color{0.2F, 0.18F, 0.1F}, dice.roll());
    place.skyline = 0.2F;
    place.clearing = 55;
    place.skyline_color = {0.045F, 0.07F, 0.025F};
    break;
  case Kind::corridor: {
    place.half_width = dice.roll(1.1F, 1.5F);
    place.flooring = static_cast<int>(dice.next() % 4);
    constexpr Color floors[] = {
        {0.17F, 0.18F, 0.16F}, {0.25F, 0.235F, 0.2F}, {0.25F, 0.13F, 0.06F}, {0.085F, 0.09F, 0.13F}};
    constexpr float glosses[] = {0.3F, 0.35F, 0.25F, 0};
    place.surface = floors[place.flooring] * tone;
    place.gloss = glosses[place.flooring];
    constexpr Color walls[] = {{0.62F, 0.6F, 0.54F}, {0.5F, 0.56F, 0.56F}, {0.55F, 0.47F, 0.35F}};
    place.wall = walls[dice.next() % 3];
    constexpr Color doors[] = {{0.3F, 0.16F, 0.07F}, {0.12F, 0.2F, 0.3F}, {0.5F, 0.48F, 0.42F}};
    place.door = doors[dice.next() % 3];
    constexpr Color dados[] = {
        {0.14F, 0.26F, 0.34F}, {0.46F, 0.36F, 0.13F}, {0.34F, 0.17F, 0.12F}, {0.2F, 0.3F, 0.16F}};
    const std::uint32_t dado = dice.next();
    place.dado = dice.chance(0.75F) ? dados[dado % 4] : place.wall * 0.9F;
    break;
  }
  case Kind::plain:
    place.half_width = 1e6F;
    place.surface =
        dice.chance(0.6F) ? Color{0.38F, 0.22F, 0.12F} * tone : Color{0.2F, 0.195F, 0.185F} * tone;
    place.beside = place.surface;
    place.skyline = 0.05F;
    place.clearing = 400;
    place.skyline_color = place.surface * 0.6F;
    break;
  }
  return place;
}

std::vector<Thing> parts_of_the_rover(const Settings& settings, const Moment& moment) {
  const Camera& camera = moment.camera;
  const Vec3 heading = {camera.forward.x, 0, camera.forward.z};
  const float length = std::sqrt(dot(heading, heading));
  Thing part;
  part.kind = Thing::Kind::crate;
  part.heading = {heading.z / length, heading.x / length};
  const Vec3 ahead = {part.heading.sin, 0, part.heading.cos}, eye = {camera.position.x, 0, camera.position.z};
  const float height = camera.position.y;
  std::vector<Thing> parts;
  const auto add = [&](float behind, float half_x, float half_z, float low, float high) {
    part.base = eye - ahead * behind;
    part.half_x = half_x;
    part.half_z = half_z;
    part.low = low;
    part.height = high;
    parts.push_back(part);
  };
  if (settings.kind == Kind::road) { // a car with the camera behind the windscreen
    add(0.9F, 0.88F, 2.1F, 0.2F, 0.65F * height);
    add(0.9F, 0.75F, 1.0F, 0.6F * height, height + 0.15F);
    return parts;
  }
  add(0.4F, 0.38F, 0.5F, 0.1F, 0.6F * height);
  add(0.05F, 0.035F, 0.035F, 0, height);
  add(0.05F, 0.14F, 0.06F, height - 0.05F, height + 0.08F);
  return parts;
}

void things_in_sight(const Stage& stage, std::vector<Thing>& things) {
  things.clear();
  Way way(stage, things);
  switch (stage.settings.kind) {
  case Kind::road:
    return way.road();
  case Kind::trail:
    return way.trail();
  case Kind::corridor:
    return way.corridor();
  case Kind::plain:
    return way.plain();
  }
}

} // namespace terrainseg::scene
