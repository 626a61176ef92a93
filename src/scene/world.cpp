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

/// Visits the cells of `length` metres between two z. Keys of cells repeat with the world's period.
template <class Visit> void each_cell(float from, float to, float length, std::uint32_t key, Visit&& visit) {
  const int cells = static_cast<int>(world_length / length);
  for (int i = floor_of(from / length); i <= floor_of(to / length); ++i)
    visit(static_cast<float>(i) * length,
          Dice(hash(key, static_cast<std::uint32_t>((i % cells + cells) % cells))));
}

// Obstacles have either their own colour or one close to the ground's.
Color obstacle_color(Dice& dice, const Color& own, const Color& ground, float likeness) {
  if (!dice.chance(likeness))
    return own;
  const float brightness = dice.roll(0.75F, 1.3F);
  return ground * brightness;
}

/// How far behind the rover an object may cast a visible shadow, metres.
float shadow_reach(const Settings& s) {
  return s.light == Light::sun ? 48 : 0;
}

Color car_color(Dice& dice) {
  constexpr Color paints[] = {{0.45F, 0.02F, 0.02F},   {0.03F, 0.07F, 0.3F},   {0.6F, 0.6F, 0.6F},
                              {0.025F, 0.025F, 0.03F}, {0.13F, 0.13F, 0.135F}, {0.3F, 0.31F, 0.33F},
                              {0.05F, 0.16F, 0.09F},   {0.5F, 0.42F, 0.25F}};
  return paints[dice.next() % 8];
}

Thing car_at(float x, float z, float heading_cos, float heading_sin, Dice& dice, const Color& color) {
  Thing car;
  car.kind = Thing::Kind::car;
  car.base = {x, 0, z};
  car.half_x = 0.88F;
  car.half_z = dice.roll(1.9F, 2.3F);
  car.height = dice.roll(1.4F, 1.75F);
  car.cos_yaw = heading_cos;
  car.sin_yaw = heading_sin;
  car.color = color;
  car.key = dice.next();
  return car;
}

struct Heading {
  float cos, sin;
};
Heading heading_at(const Path& path, float z) {
  const float slope = (path.at(z + 1) - path.at(z - 1)) * 0.5F;
  const float c = 1 / std::sqrt(1 + slope * slope);
  return {c, slope * c};
}

void add_tree(std::vector<Thing>& things, float x, float z, Dice& dice, float low, float high) {
  Thing tree;
  tree.kind = Thing::Kind::tree;
  tree.base = {x, 0, z};
  tree.height = dice.roll(low, high);
  tree.half_x = tree.height * dice.roll(0.2F, 0.34F);
  tree.half_z = tree.half_x;
  tree.color = mix(Color{0.05F, 0.1F, 0.02F}, Color{0.12F, 0.12F, 0.03F}, dice.roll());
  tree.key = dice.next();
  things.push_back(tree);
}

void add_bush(std::vector<Thing>& things, float x, float z, float size, Dice& dice, const Color& color) {
  Thing bush;
  bush.kind = Thing::Kind::bush;
  bush.base = {x, 0, z};
  bush.half_x = bush.half_z = size;
  bush.height = size * dice.roll(1.0F, 1.7F);
  bush.color = color;
  bush.key = dice.next();
  things.push_back(bush);
}

void add_rock(std::vector<Thing>& things, float x, float z, float size, Dice& dice, const Color& color) {
  Thing rock;
  rock.kind = Thing::Kind::rock;
  rock.base = {x, 0, z};
  rock.half_x = rock.half_z = size;
  rock.height = size * dice.roll(0.8F, 1.5F);
  rock.color = color;
  rock.key = dice.next();
  things.push_back(rock);
}

/// A road with the objects along it.
class Road {
 public:
  Road(const Settings& settings, const Place& place, const Path& path, const Moment& moment,
       std::vector<Thing>& things)
      : s_(settings), place_(place), path_(path), moment_(moment), z0_(moment.camera.position.z),
        filled_(static_cast<float>(settings.obstacles) / 100), things_(things) {}

  void roadside() {
    each_cell(z0_ - 14 - shadow_reach(s_), z0_ + 130, 16, hash(s_.seed, 1), [&](float z, Dice dice) {
      for (const float side : {-1.0F, 1.0F}) {
        if (place_.urban && dice.chance(0.85F))
          house(z, side, dice);
        const int trees = place_.urban ? dice.chance(0.35F) : static_cast<int>(dice.next() % 3);
        for (int i = 0; i < trees; ++i) {
          const float tz = z + dice.roll(0, 16);
          const float x = place_.urban ? place_.pavement - 0.6F : place_.half_width + dice.roll(2.5F, 14);
          add_tree(things_, path_.at(tz) + side * x, tz, dice, 5, 10);
        }
        if (!place_.urban)
          for (int i = 0; i < 2; ++i)
            if (dice.chance(filled_)) {
              const float bz = z + dice.roll(0, 16);
              const float away = place_.half_width + dice.roll(1.0F, 6), size = dice.roll(0.4F, 1);
              const Color leaves = mix(place_.beside, Color{0.05F, 0.09F, 0.02F}, dice.roll());
              add_bush(things_, path_.at(bz) + side * away, bz, size, dice, leaves);
            }
      }
    });
  }

  void poles() {
    each_cell(z0_ - 6 - shadow_reach(s_), z0_ + 110, 32, hash(s_.seed, 2), [&](float z, Dice dice) {
      Thing pole;
      pole.kind = Thing::Kind::pole;
      const float x = dice.chance(0.5F) ? 1.0F : -1.0F;
      pole.base = {path_.at(z) + x * (place_.half_width + 0.7F), 0, z};
      pole.half_x = pole.half_z = 0.07F;
      pole.height = 6;
      pole.color = grey(0.25F);
      things_.push_back(pole);
    });
  }

  /// Parked cars, and concrete blocks, half of which have the asphalt's colour.
  void parked() {
    each_cell(z0_ - 4 - shadow_reach(s_), z0_ + 90, 8, hash(s_.seed, 3), [&](float z, Dice dice) {
      for (const float side : {-1.0F, 1.0F}) {
        const bool there = dice.chance(filled_), is_car = dice.chance(place_.urban ? 0.8F : 0.25F);
        const float middle = z + 4 + dice.roll(-0.6F, 0.6F);
        Dice own(dice.next());
        if (!there)
          continue;
        if (is_car)
          parked_car(middle, side, own);
        else
          block(middle, side, own);
      }
    });
  }

  /// Oncoming traffic: placed on a line that moves towards the rover.
  void oncoming() {
    const double driven = moment_.seconds * 9;
    const auto shift =
        static_cast<float>(driven - 2048.0 * static_cast<double>(static_cast<std::int64_t>(driven / 2048.0)));
    each_cell(z0_ + shift - 8, z0_ + shift + 120, 32, hash(s_.seed, 4), [&](float w, Dice dice) {
      if (!dice.chance(filled_))
        return;
      const float z = w + dice.roll(4, 28) - shift;
      const Heading h = heading_at(path_, z);
      things_.push_back(car_at(path_.at(z) - 1.75F, z, -h.cos, -h.sin, dice, car_color(dice)));
    });
  }

  /// A car ahead in the rover's lane.
  void lead() {
    Dice dice(hash(s_.seed, 5));
    if (!dice.chance(0.3F + 0.7F * filled_))
      return;
    const auto gap = static_cast<float>(18 + 8 * sine(moment_.seconds * 0.05 + dice.roll()));
    const float z = z0_ + gap;
    const Heading h = heading_at(path_, z);
    const Color paint = obstacle_color(dice, car_color(dice), place_.surface, 0.3F);
    things_.push_back(car_at(path_.at(z) + 1.75F, z, h.cos, h.sin, dice, paint));
  }

 private:
  void house(float z, float side, Dice& dice) {
    Thing house;
    house.kind = Thing::Kind::house;
    house.half_x = dice.roll(3.5F, 5);
    house.half_z = dice.roll(6, 7.8F);
    house.height = dice.roll(6, 11);
    const float middle = z + 8, x = side * (place_.pavement + dice.roll(1, 4) + house.half_x);
    house.base = {path_.at(middle) + x, 0, middle};
    const Heading h = heading_at(path_, middle);
    house.cos_yaw = h.cos;
    house.sin_yaw = h.sin;
    constexpr Color walls[] = {{0.42F, 0.2F, 0.13F},
                               {0.55F, 0.5F, 0.4F},
                               {0.3F, 0.28F, 0.26F},
                               {0.6F, 0.57F, 0.52F},
                               {0.35F, 0.15F, 0.1F}};
    house.color = walls[dice.next() % 5];
    house.color = house.color * dice.roll(0.7F, 1.1F);
    house.key = dice.next();
    things_.push_back(house);
  }

  void parked_car(float middle, float side, Dice& dice) {
    const Heading h = heading_at(path_, middle);
    const float kerb = place_.half_width - (place_.urban ? 1.1F : -1.6F);
    const Color paint = obstacle_color(dice, car_color(dice), place_.surface, 0.25F);
    things_.push_back(car_at(path_.at(middle) + side * kerb, middle, h.cos, h.sin, dice, paint));
  }

  void block(float middle, float side, Dice& dice) {
    const Heading h = heading_at(path_, middle);
    Thing block;
    block.kind = Thing::Kind::crate;
    block.base = {path_.at(middle) + side * (place_.half_width - 0.5F), 0, middle};
    block.half_x = dice.roll(0.2F, 0.45F);
    block.half_z = dice.roll(0.3F, 1);
    block.height = dice.roll(0.4F, 0.9F);
    block.cos_yaw = h.cos;
    block.sin_yaw = h.sin;
    block.color = obstacle_color(dice, {0.5F, 0.16F, 0.02F}, place_.surface, 0.5F);
    block.key = dice.next();
    things_.push_back(block);
  }

  const Settings& s_;
  const Place& place_;
  const Path& path_;
  const Moment& moment_;
  const float z0_, filled_;
  std::vector<Thing>& things_;
};

void road(const Settings& s, const Place& place, const Path& path, const Moment& moment,
          std::vector<Thing>& things) {
  Road road(s, place, path, moment, things);
  road.roadside();
  road.poles();
  road.parked();
  if (s.obstacles == 0)
    return;
  road.oncoming();
  road.lead();
}

void trail(const Settings& s, const Place& place, const Path& path, const Moment& moment,
           std::vector<Thing>& things) {
  const float z0 = moment.camera.position.z, filled = static_cast<float>(s.obstacles) / 100;
  each_cell(z0 - 4 - shadow_reach(s), z0 + 60, 4, hash(s.seed, 11), [&](float z, Dice dice) {
    for (const float side : {-1.0F, 1.0F}) {
      for (int i = 0; i < 2; ++i)
        if (dice.chance(0.6F)) {
          const float tz = z + dice.roll(0, 4), away = dice.roll();
          add_tree(things, path.at(tz) + side * (2.6F + 11 * away * away + 1), tz, dice, 5, 11);
        }
      for (int i = 0; i < 3; ++i) {
        const float bz = z + dice.roll(0, 4), x = place.half_width + dice.roll(0.5F, 5);
        const Color leaves =
            mix(place.beside, mix(Color{0.05F, 0.1F, 0.02F}, Color{0.17F, 0.12F, 0.04F}, dice.roll()), 0.75F);
        const float size = dice.roll(0.25F, 0.75F);
        if (dice.chance(0.3F + filled * 0.7F))
          add_bush(things, path.at(bz) + side * x, bz, size, dice, leaves);
      }
    }
  });
  each_cell(z0 + 0.5F, z0 + 40, 2, hash(s.seed, 12), [&](float z, Dice dice) {
    for (const float side : {-1.0F, 1.0F}) {
      const bool there = dice.chance(filled * 0.6F);
      const float rz = z + dice.roll(0, 2), x = side * (place.half_width * dice.roll(0.85F, 1.15F));
      Dice own(dice.next());
      if (!there)
        continue;
      const float size = own.roll(0.1F, 0.28F);
      const Color color = obstacle_color(own, grey(0.2F), place.surface, 0.5F);
      add_rock(things, path.at(rz) + x, rz, size, own, color);
    }
  });
}

void corridor(const Settings& s, const Place& place, const Moment& moment, std::vector<Thing>& things) {
  const float z0 = moment.camera.position.z, filled = static_cast<float>(s.obstacles) / 100;
  each_cell(z0 - 2, z0 + 40, 2, hash(s.seed, 21), [&](float z, Dice dice) {
    for (const float side : {-1.0F, 1.0F}) {
      const bool there = dice.chance(filled * 0.55F);
      Dice own(dice.next());
      if (!there)
        continue;
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
      thing.color = obstacle_color(own, own_color, place.surface, 0.35F);
      const float reach = place.half_width - thing.half_x - 0.05F;
      thing.base = {side * (thing.kind == Thing::Kind::crate ? reach - own.roll(0, 0.2F) : reach), 0,
                    z + own.roll(0.5F, 1.5F)};
      thing.key = own.next();
      if (thing.kind == Thing::Kind::crate) {
        const float turn = own.roll(-0.08F, 0.08F);
        thing.cos_yaw = static_cast<float>(cosine(turn));
        thing.sin_yaw = static_cast<float>(sine(turn));
      }
      things.push_back(thing);
    }
  });
}

void plain(const Settings& s, const Place& place, const Path& path, const Moment& moment,
           std::vector<Thing>& things) {
  const Camera& camera = moment.camera;
  const float filled = static_cast<float>(s.obstacles) / 100;
  const auto scatter = [&](float cell, int reach, float low, float high, float share, std::uint32_t key) {
    const int cells = static_cast<int>(world_length / cell);
    const int cx = floor_of(camera.position.x / cell), cz = floor_of(camera.position.z / cell);
    for (int j = cz - reach; j <= cz + reach; ++j)
      for (int i = cx - reach; i <= cx + reach; ++i) {
        Dice dice(hash(key, static_cast<std::uint32_t>(i),
                       static_cast<std::uint32_t>((j % cells + cells) % cells)));
        if (!dice.chance(share))
          continue;
        const float x = (static_cast<float>(i) + dice.roll()) * cell,
                    z = (static_cast<float>(j) + dice.roll()) * cell;
        const float r = dice.roll(), size = low + (high - low) * r * r * r;
        if (std::abs(x - path.at(z)) < 0.75F + size)
          continue; // keeps the rover's path free
        add_rock(things, x, z, size, dice,
                 obstacle_color(dice, mix(grey(0.13F), place.surface, 0.25F), place.surface, 0.5F));
      }
  };
  scatter(2, 8, 0.07F, 0.3F, filled, hash(s.seed, 31));
  scatter(8, 11, 0.25F, 1.3F, filled, hash(s.seed, 32));
}

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

void parts_of_the_rover(const Settings& settings, const Moment& moment, std::vector<Thing>& parts) {
  const Camera& camera = moment.camera;
  const Vec3 heading = {camera.forward.x, 0, camera.forward.z};
  const float length = std::sqrt(dot(heading, heading));
  Thing part;
  part.kind = Thing::Kind::crate;
  part.cos_yaw = heading.z / length;
  part.sin_yaw = heading.x / length;
  const Vec3 ahead = {part.sin_yaw, 0, part.cos_yaw}, eye = {camera.position.x, 0, camera.position.z};
  const float height = camera.position.y;
  const auto add = [&](float behind, float half_x, float half_z, float low, float high) {
    part.base = eye - ahead * behind;
    part.half_x = half_x;
    part.half_z = half_z;
    part.low = low;
    part.height = high;
    parts.push_back(part);
  };
  parts.clear();
  if (settings.kind == Kind::road) { // a car with the camera behind the windscreen
    add(0.9F, 0.88F, 2.1F, 0.2F, 0.65F * height);
    add(0.9F, 0.75F, 1.0F, 0.6F * height, height + 0.15F);
    return;
  }
  add(0.4F, 0.38F, 0.5F, 0.1F, 0.6F * height);
  add(0.05F, 0.035F, 0.035F, 0, height);
  add(0.05F, 0.14F, 0.06F, height - 0.05F, height + 0.08F);
}

void things_in_sight(const Settings& settings, const Place& place, const Path& path, const Moment& moment,
                     std::vector<Thing>& things) {
  things.clear();
  switch (settings.kind) {
  case Kind::road:
    return road(settings, place, path, moment, things);
  case Kind::trail:
    return trail(settings, place, path, moment, things);
  case Kind::corridor:
    return corridor(settings, place, moment, things);
  case Kind::plain:
    return plain(settings, place, path, moment, things);
  }
}

} // namespace terrainseg::scene
