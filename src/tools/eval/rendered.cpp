// SPDX-License-Identifier: LGPL-2.1-or-later
#include "tools/eval/rendered.hpp"

#include <array>
#include <charconv>
#include <memory>
#include <optional>
#include <sstream>
#include <stdexcept>
#include <vector>

#include "scene/scene.hpp"

namespace terrainseg::eval {
namespace {

constexpr const char* prefix = "scene:";
constexpr int places = 12, frames_a_place = 10, step = 9;
constexpr int width = 480, height = 270;
constexpr unsigned default_seed = 101; // places that no test and no tuning has looked at

constexpr std::array kinds{"road", "trail", "corridor", "plain"};
constexpr std::array lights{"day", "dusk", "drift"};

static_assert(int{label_terrain} == int{scene::driven_terrain} &&
              int{label_ground} == int{scene::other_traversable} && int{label_sky} == int{scene::sky} &&
              int{label_none} == int{scene::not_labelled});

template <std::size_t size>
std::optional<int> place_in(const std::array<const char*, size>& names, const std::string& name) {
  for (std::size_t i = 0; i < size; ++i)
    if (name == names[i])
      return static_cast<int>(i);
  return std::nullopt;
}

std::optional<unsigned> seed_of(const std::string& text) {
  unsigned seed = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), seed);
  return error == std::errc() && end == text.data() + text.size() ? std::optional(seed) : std::nullopt;
}

Sample render(scene::Settings settings, std::size_t index) {
  const std::size_t place = index / frames_a_place;
  settings.seed += static_cast<std::uint32_t>(place);
  settings.motion = std::array{scene::Motion::straight, scene::Motion::turn, scene::Motion::bumpy}[place % 3];
  Sample sample{cv::Mat3b(height, width), cv::Mat1b(height, width)};
  MutableFrame frame;
  frame.format = PixelFormat::BGR;
  frame.width = width;
  frame.height = height;
  frame.colorimetry.range = ColorRange::full;
  frame.planes[0] = {sample.picture.data, static_cast<std::ptrdiff_t>(sample.picture.step)};
  scene::Renderer(settings, width, height)
      .render(index % frames_a_place * step, frame,
              {sample.labels.data, static_cast<std::ptrdiff_t>(sample.labels.step)});
  return sample;
}

} // namespace

bool is_rendered(const std::string& text) {
  return text.starts_with(prefix);
}

Sequence rendered_sequence(const std::string& text, int limit) {
  std::vector<std::string> parts;
  std::istringstream in(text.substr(std::string(prefix).size()));
  for (std::string part; std::getline(in, part, ':');)
    parts.push_back(part);
  std::optional<int> kind, light;
  std::optional<unsigned> seed = default_seed;
  if (parts.size() == 2 || parts.size() == 3) {
    kind = place_in(kinds, parts[0]);
    light = place_in(lights, parts[1]);
    if (parts.size() == 3)
      seed = seed_of(parts[2]);
  }
  if (!kind || !light || !seed)
    throw std::runtime_error(text + ": not a rendered sequence; there are scene:KIND:LIGHT[:SEED] with road, "
                                    "trail, corridor or plain, day, dusk or drift, and a whole number");
  const scene::Settings settings{static_cast<scene::Kind>(*kind), static_cast<scene::Light>(*light),
                                 scene::Motion::straight, *seed};
  Sequence s;
  s.name = parts[0] + " " + parts[1];
  s.folder = text;
  s.fps = static_cast<double>(scene::frames_per_second) / step;
  const int count = places * frames_a_place;
  for (int i = 0; i < (limit > 0 ? std::min(limit, count) : count); ++i) {
    const std::string number = std::to_string(10000 + i).substr(1) + ".png";
    s.frames.push_back(number);
    s.labels.push_back(number);
  }
  s.source = [settings](std::size_t index) { return render(settings, index); };
  return s;
}

} // namespace terrainseg::eval
