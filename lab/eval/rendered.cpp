// SPDX-License-Identifier: LGPL-2.1-or-later
#include "lab/eval/rendered.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <optional>
#include <regex>
#include <stdexcept>
#include <vector>

#include "scene/scene.hpp"

namespace terrainseg::eval {
namespace {

constexpr const char* prefix = "scene:";
constexpr unsigned default_seed = 101; // places that no test and no tuning has looked at

constexpr std::array kinds{"road", "trail", "corridor", "plain"};
constexpr std::array lights{"day", "dusk", "drift", "sun"};
constexpr std::array motions{"straight", "turn", "bumpy", "still"};

static_assert(int{label_terrain} == int{scene::driven_terrain} &&
              int{label_ground} == int{scene::other_traversable} && int{label_sky} == int{scene::sky} &&
              int{label_none} == int{scene::not_labelled});

/// Places that are looked at ten times each, 0.3 s apart: what no filter over time could help with.
namespace short_looks {
constexpr std::size_t count = 12, frames = 10, step = 9;
constexpr int width = 480, height = 270;
} // namespace short_looks

/// Continuous drives.
namespace drives {
constexpr std::size_t frames = 90, warm_up = 60;
constexpr int things_every = 10;
constexpr int width = 640, height = 360, most_seeds = 1000;
} // namespace drives

template <std::size_t size>
std::optional<int> place_in(const std::array<const char*, size>& names, const std::string& name) {
  for (std::size_t i = 0; i < size; ++i)
    if (name == names[i])
      return static_cast<int>(i);
  return std::nullopt;
}

template <class Number> std::optional<Number> number_in(const std::string& text) {
  Number number = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  return error == std::errc() && end == text.data() + text.size() ? std::optional(number) : std::nullopt;
}

Sample render(const scene::Settings& settings, const cv::Size& size, std::size_t frame) {
  Sample sample{Picture(size, {}), cv::Mat1b(size)};
  scene::Renderer renderer(settings, size.width, size.height);
  renderer.render(frame, sample.picture.mutable_frame(),
                  {sample.labels.data, static_cast<std::ptrdiff_t>(sample.labels.step)});
  const scene::View view = renderer.view_of(frame);
  const double row = view.center_y - view.focal * std::tan(view.pitch) / std::cos(view.roll);
  sample.picture.set_vanishing_row(static_cast<std::int32_t>(std::lround(row * 256)));
  return sample;
}

void name_frames(Sequence& s, std::size_t count) {
  for (std::size_t i = 0; i < count; ++i) {
    const std::string number = std::to_string(10000 + i).substr(1) + ".png";
    s.frames.push_back(number);
    s.labels.push_back(number);
  }
}

Sequence places_of(const scene::Settings& settings) {
  Sequence s;
  s.fps = static_cast<double>(scene::frames_per_second) / short_looks::step;
  name_frames(s, short_looks::count * short_looks::frames);
  s.source = [settings](std::size_t index) {
    const std::size_t place = index / short_looks::frames;
    scene::Settings here = settings;
    here.seed += static_cast<std::uint32_t>(place);
    here.motion = std::array{scene::Motion::straight, scene::Motion::turn, scene::Motion::bumpy}[place % 3];
    return render(here, {short_looks::width, short_looks::height},
                  index % short_looks::frames * short_looks::step);
  };
  return s;
}

Sequence drives_of(const scene::Settings& settings, const cv::Size& size, std::size_t seeds) {
  Sequence s;
  s.fps = scene::frames_per_second;
  s.run = drives::frames;
  s.warm_up = drives::warm_up;
  s.things_every = drives::things_every;
  name_frames(s, seeds * drives::frames);
  s.source = [settings, size](std::size_t index) {
    scene::Settings here = settings;
    here.seed += static_cast<std::uint32_t>(index / drives::frames);
    return render(here, size, index % drives::frames);
  };
  return s;
}

/// `count` frames of one place, `step` frames of the world apart.
Sequence place_of(const std::string& name, const scene::Settings& settings, const cv::Size& size,
                  std::size_t count) {
  constexpr std::size_t step = 6;
  Sequence s;
  s.name = s.folder = name;
  s.fps = static_cast<double>(scene::frames_per_second) / step;
  s.free = true;
  name_frames(s, count);
  s.source = [settings, size](std::size_t index) { return render(settings, size, index * step); };
  return s;
}

/// What `text` asks for, or nothing when it makes no sense.
std::optional<Sequence> parse(const std::string& text) {
  static const std::regex form("scene:([a-z]+):([a-z]+)(\\+wet)?(?::([0-9]+)|:([a-z]+)(?:@([0-9]+)x([0-9]+))?"
                               "(?:#([0-9]+)(?:-([0-9]+))?)?)?");
  std::smatch part;
  if (!std::regex_match(text, part, form))
    return std::nullopt;
  const auto number = [&](std::size_t i, unsigned otherwise) {
    return part[i].matched ? number_in<unsigned>(part[i]) : std::optional(otherwise);
  };
  const auto kind = place_in(kinds, part[1]), light = place_in(lights, part[2]);
  if (!kind || !light)
    return std::nullopt;
  scene::Settings settings{static_cast<scene::Kind>(*kind), static_cast<scene::Light>(*light)};
  settings.wet = part[3].matched;
  if (!part[5].matched) {
    const auto seed = number(4, default_seed);
    settings.seed = seed.value_or(0);
    return seed ? std::optional(places_of(settings)) : std::nullopt;
  }
  const auto motion = place_in(motions, part[5]);
  const auto width = number(6, drives::width), height = number(7, drives::height);
  const auto first = number(8, default_seed),
             last = part[8].matched && !part[9].matched ? first : number(9, default_seed + 5);
  const auto fits = [](const auto& side) { return side && *side >= 16 && *side <= 8192; };
  if (!motion || !fits(width) || !fits(height) || !first || !last || *last < *first ||
      *last - *first >= drives::most_seeds)
    return std::nullopt;
  settings.motion = static_cast<scene::Motion>(*motion);
  settings.seed = *first;
  return drives_of(settings, {static_cast<int>(*width), static_cast<int>(*height)}, *last - *first + 1);
}

} // namespace

bool is_rendered(const std::string& text) {
  return text.starts_with(prefix);
}

Sequence rendered_sequence(const std::string& text) {
  std::optional<Sequence> s = parse(text);
  if (!s)
    throw std::runtime_error(
        text +
        ": not a rendered sequence; there are scene:KIND:LIGHT[:SEED] and "
        "scene:KIND:LIGHT:MOTION[@WIDTHxHEIGHT][#FIRST[-LAST]] with road, trail, "
        "corridor or plain; day, dusk, drift or sun, with +wet if it is wet; straight, turn, bumpy or still; "
        "sides of 16 to 8192 pixels, up to 1000 seeds");
  s->folder = text;
  s->kind = "rendered";
  s->name = text.substr(std::string(prefix).size());
  std::replace(s->name.begin(), s->name.end(), ':', ' ');
  return *s;
}

std::vector<Sequence> rendered_for_paper(const Selection& selection) {
  struct Place {
    const char* name;
    scene::Settings settings;
  };
  using scene::Kind, scene::Light, scene::Motion;
  const Place places[] = {
      {"rendered road", {Kind::road, Light::day, Motion::straight, 3}},
      {"rendered road, dusk", {Kind::road, Light::dusk, Motion::straight, 4}},
      {"rendered trail", {Kind::trail, Light::drift, Motion::bumpy, 5}},
      {"rendered corridor", {Kind::corridor, Light::day, Motion::turn, 6}},
      {"rendered plain", {Kind::plain, Light::day, Motion::bumpy, 7}},
  };
  constexpr std::size_t frames = 60;
  std::vector<Sequence> all;
  for (const Place& p : places)
    all.push_back(
        place_of(p.name, p.settings, {640, 360},
                 selection.limit > 0 ? std::min(frames, static_cast<std::size_t>(selection.limit)) : frames));
  return all;
}

Sequence rendered_trail(const cv::Size& size) {
  return place_of("rendered trail", {scene::Kind::trail, scene::Light::day, scene::Motion::straight, 5}, size,
                  12);
}

} // namespace terrainseg::eval
