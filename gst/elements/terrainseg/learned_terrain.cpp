// SPDX-License-Identifier: LGPL-2.1-or-later
#include "elements/terrainseg/learned_terrain.hpp"

namespace terrainseg {
namespace {

bool holds_anything(const Terrain& terrain) {
  return std::any_of(terrain.models.begin(), terrain.models.end(),
                     [](const TerrainModel& model) { return model.mass > 0; });
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

LearnedTerrain::Turn::Turn(LearnedTerrain& owner) : owner_(owner) {
  const Lock lock(owner_.mutex_);
  owner_.processing_ = true;
  segmenter_ = owner_.segmenter_.get();
}

LearnedTerrain::Turn::~Turn() {
  const Lock lock(owner_.mutex_);
  owner_.processing_ = false;
  owner_.processed_.notify_all();
}

void LearnedTerrain::wait_for_frame(Lock& lock) {
  while (processing_)
    lock.wait(processed_);
}

bool LearnedTerrain::start(const Settings& settings) {
  const Lock lock(mutex_);
  if (segmenter_) {
    segmenter_->configure(settings);
    return false;
  }
  segmenter_ = std::make_unique<Segmenter>(settings);
  if (loaded_)
    (void)segmenter_->adopt(*loaded_); // before a frame there is no colour space that it could miss
  return true;
}

void LearnedTerrain::stop(ResetOn reset_on, const std::string& stream) {
  const Lock lock(mutex_);
  if (reset_on == ResetOn::per_stream)
    keep(stream);
  if (reset_on == ResetOn::never)
    return;
  segmenter_.reset();
  if (!loaded_by_signal_)
    loaded_.reset(); // read again at the next start
}

std::optional<Terrain> LearnedTerrain::learned() {
  Lock lock(mutex_);
  wait_for_frame(lock);
  if (!segmenter_)
    return std::nullopt;
  std::optional<Terrain> terrain = segmenter_->terrain();
  return holds_anything(*terrain) ? std::move(terrain) : std::nullopt;
}

Rectangle LearnedTerrain::window() {
  Lock lock(mutex_);
  wait_for_frame(lock);
  return segmenter_ ? segmenter_->estimate().window : Rectangle{};
}

Status LearnedTerrain::load(Terrain terrain, std::string name) {
  Lock lock(mutex_);
  wait_for_frame(lock);
  Status adopted = segmenter_ ? segmenter_->adopt(terrain) : Status();
  if (adopted.ok()) {
    loaded_ = std::move(terrain);
    loaded_name_ = std::move(name);
    loaded_by_signal_ = true;
    others_.clear(); // every stream begins from this one
    recalled_.reset();
  }
  return adopted;
}

void LearnedTerrain::offer(Terrain terrain, std::string name) {
  const Lock lock(mutex_);
  if (loaded_by_signal_)
    return;
  loaded_ = std::move(terrain);
  loaded_name_ = std::move(name);
}

bool LearnedTerrain::was_loaded() {
  const Lock lock(mutex_);
  return loaded_by_signal_;
}

void LearnedTerrain::discard_loaded() {
  const Lock lock(mutex_);
  loaded_.reset();
  loaded_by_signal_ = false;
}

std::optional<std::string> LearnedTerrain::foreign(const ColorSpace& space) {
  const Lock lock(mutex_);
  if (!loaded_ || loaded_->space == space)
    return std::nullopt;
  return "The learned terrain \"" + loaded_name_ + "\" was learned in " + name_of(loaded_->space) +
         " and the video is " + name_of(space) + ".";
}

void LearnedTerrain::reset() {
  Lock lock(mutex_);
  wait_for_frame(lock);
  loaded_.reset();
  loaded_by_signal_ = false;
  others_.clear();
  recalled_.reset();
  if (segmenter_)
    segmenter_->reset();
}

void LearnedTerrain::forget() {
  Lock lock(mutex_);
  wait_for_frame(lock);
  if (!segmenter_)
    return;
  segmenter_->reset();
  if (loaded_)
    (void)segmenter_->adopt(*loaded_);
}

void LearnedTerrain::reset_temporal() {
  Lock lock(mutex_);
  wait_for_frame(lock);
  if (segmenter_)
    segmenter_->reset_temporal();
}

void LearnedTerrain::keep(const std::string& stream) {
  if (stream.empty() || !segmenter_)
    return;
  Terrain terrain = recalled_ ? std::move(*recalled_) : segmenter_->terrain();
  recalled_.reset();
  if (holds_anything(terrain))
    others_.keep(stream, std::move(terrain));
}

void LearnedTerrain::change_stream(const std::string& from, const std::string& to) {
  Lock lock(mutex_);
  wait_for_frame(lock);
  auto known = others_.take(to); // before the one that is left pushes it out
  keep(from);
  recalled_ = std::move(known);
}

bool LearnedTerrain::recall(const std::optional<ColorSpace>& space) {
  Lock lock(mutex_);
  wait_for_frame(lock);
  const auto terrain = std::exchange(recalled_, std::nullopt);
  return segmenter_ && terrain && terrain->space == space && segmenter_->adopt(*terrain).ok();
}

} // namespace terrainseg
