// SPDX-License-Identifier: LGPL-2.1-or-later
#include "elements/terrainseg/learned_terrain.hpp"

#include <algorithm>

namespace terrainseg {
namespace {

/// Other streams whose terrains are kept, about 9 kB each.
constexpr std::size_t most_others = 16;

bool holds_anything(const Terrain& terrain) {
  return std::ranges::any_of(terrain.models, [](const TerrainModel& model) { return model.mass > 0; });
}

} // namespace

std::string name_of(const ColorSpace& space) {
  const char* range = space.colorimetry.range == ColorRange::full ? " full range" : " limited range";
  if (space.rgb)
    return std::string("RGB") + range;
  const char* matrix = space.colorimetry.matrix == ColorMatrix::bt709    ? "BT.709"
                       : space.colorimetry.matrix == ColorMatrix::bt2020 ? "BT.2020"
                                                                         : "BT.601";
  return std::string("YUV ") + matrix + range;
}

bool LearnedTerrain::start(const Settings& settings) {
  const Lock lock(mutex_);
  if (segmenter_) {
    segmenter_->configure(settings);
    return false;
  }
  segmenter_ = std::make_unique<Segmenter>(settings);
  if (loaded_)
    (void)segmenter_->adopt(loaded_->terrain); // before a frame there is no colour space that it could miss
  return true;
}

void LearnedTerrain::stop(ResetOn reset_on, const std::string& stream) {
  const Lock lock(mutex_);
  if (reset_on == ResetOn::per_stream)
    keep(stream);
  if (reset_on == ResetOn::never)
    return;
  segmenter_.reset();
  if (loaded_ && !loaded_->by_signal)
    loaded_.reset(); // read again at the next start
}

std::optional<Terrain> LearnedTerrain::learned() {
  const Lock lock(mutex_);
  if (!segmenter_)
    return std::nullopt;
  std::optional<Terrain> terrain = segmenter_->terrain();
  return holds_anything(*terrain) ? std::move(terrain) : std::nullopt;
}

Rectangle LearnedTerrain::window() {
  const Lock lock(mutex_);
  return segmenter_ ? segmenter_->estimate().window : Rectangle{};
}

Status LearnedTerrain::load(Terrain terrain, std::string name) {
  const Lock lock(mutex_);
  Status adopted = segmenter_ ? segmenter_->adopt(terrain) : Status();
  if (adopted.ok()) {
    loaded_ = {std::move(terrain), std::move(name), true};
    others_.clear(); // every stream begins from this one
    recalled_.reset();
  }
  return adopted;
}

void LearnedTerrain::offer(Terrain terrain, std::string name) {
  const Lock lock(mutex_);
  if (!loaded_ || !loaded_->by_signal)
    loaded_ = {std::move(terrain), std::move(name), false};
}

bool LearnedTerrain::was_loaded() {
  const Lock lock(mutex_);
  return loaded_ && loaded_->by_signal;
}

void LearnedTerrain::discard_loaded() {
  const Lock lock(mutex_);
  loaded_.reset();
}

std::optional<std::string> LearnedTerrain::foreign(const ColorSpace& space) {
  const Lock lock(mutex_);
  if (!loaded_ || loaded_->terrain.space == space)
    return std::nullopt;
  return "The learned terrain \"" + loaded_->name + "\" was learned in " + name_of(loaded_->terrain.space) +
         " and the video is " + name_of(space) + ".";
}

void LearnedTerrain::reset() {
  const Lock lock(mutex_);
  loaded_.reset();
  others_.clear();
  recalled_.reset();
  if (segmenter_)
    segmenter_->reset();
}

void LearnedTerrain::forget() {
  const Lock lock(mutex_);
  if (!segmenter_)
    return;
  segmenter_->reset();
  if (loaded_)
    (void)segmenter_->adopt(loaded_->terrain);
}

void LearnedTerrain::reset_temporal() {
  const Lock lock(mutex_);
  if (segmenter_)
    segmenter_->reset_temporal();
}

void LearnedTerrain::keep(const std::string& stream) {
  if (stream.empty() || !segmenter_)
    return;
  Terrain terrain = recalled_ ? std::move(*recalled_) : segmenter_->terrain();
  recalled_.reset();
  if (!holds_anything(terrain))
    return;
  std::erase_if(others_, [&](const auto& other) { return other.first == stream; });
  if (others_.size() == most_others)
    others_.erase(others_.begin());
  others_.emplace_back(stream, std::move(terrain));
}

void LearnedTerrain::change_stream(const std::string& from, const std::string& to) {
  const Lock lock(mutex_);
  std::optional<Terrain> known; // taken before the one that is left pushes it out
  const auto found = std::ranges::find(others_, to, &decltype(others_)::value_type::first);
  if (found != others_.end()) {
    known = std::move(found->second);
    others_.erase(found);
  }
  keep(from);
  recalled_ = std::move(known);
}

bool LearnedTerrain::recall(const std::optional<ColorSpace>& space) {
  const Lock lock(mutex_);
  const auto terrain = std::exchange(recalled_, std::nullopt);
  return segmenter_ && terrain && terrain->space == space && segmenter_->adopt(*terrain).ok();
}

} // namespace terrainseg
