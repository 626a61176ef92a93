// SPDX-License-Identifier: LGPL-2.1-or-later
// The segmenter with the terrain it has learned, and the terrains it can go on from.
#pragma once

#include <algorithm>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "elements/terrainseg/settings_book.hpp"
#include "support/mutex.hpp"
#include "terrainseg/segmenter.hpp"

namespace terrainseg {

inline std::string name_of(const ColorSpace& space) {
  const char* range = space.colorimetry.range == ColorRange::full ? " full range" : " limited range";
  if (space.rgb)
    return std::string("RGB") + range;
  const char* matrix = space.colorimetry.matrix == ColorMatrix::bt709    ? "BT.709"
                       : space.colorimetry.matrix == ColorMatrix::bt2020 ? "BT.2020"
                                                                         : "BT.601";
  return std::string("YUV ") + matrix + range;
}

/// Any thread may call, and waits until the frame that is being processed is done.
class LearnedTerrain {
 public:
  /// Calls `use` with the segmenter, which is there between start() and stop().
  template <class Use> auto use(Use use) {
    const Lock lock(mutex_);
    return use(*segmenter_);
  }
  /// Makes a segmenter, or configures the one that reset-on=never kept; true when it is a new one.
  bool start(const Settings& settings) {
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
  /// Drops the segmenter and what was loaded from model-location, unless `reset_on` is never.
  void stop(ResetOn reset_on, const std::string& stream) {
    const Lock lock(mutex_);
    if (reset_on == ResetOn::per_stream)
      keep(stream);
    if (reset_on == ResetOn::never)
      return;
    segmenter_.reset();
    if (loaded_ && !loaded_->by_signal)
      loaded_.reset(); // read again at the next start
  }

  /// What is learned now; nothing before the start, and while no model has mass.
  std::optional<Terrain> learned() {
    const Lock lock(mutex_);
    if (!segmenter_)
      return std::nullopt;
    std::optional<Terrain> terrain = segmenter_->terrain();
    return holds_anything(*terrain) ? std::move(terrain) : std::nullopt;
  }
  /// Of the last frame; empty before the first.
  Rectangle window() {
    const Lock lock(mutex_);
    return segmenter_ ? segmenter_->estimate().window : Rectangle{};
  }

  /// A new stream starts from `terrain`, and so does the running one if it can adopt it.
  Status load(Terrain terrain, std::string name) {
    const Lock lock(mutex_);
    Status adopted = segmenter_ ? segmenter_->adopt(terrain) : Status();
    if (adopted.ok()) {
      loaded_ = {std::move(terrain), std::move(name), true};
      others_.clear(); // every stream begins from this one
      recalled_.reset();
    }
    return adopted;
  }
  /// As load(), at the start; load() has precedence.
  void offer(Terrain terrain, std::string name) {
    const Lock lock(mutex_);
    if (!loaded_ || !loaded_->by_signal)
      loaded_ = {std::move(terrain), std::move(name), false};
  }
  bool was_loaded() {
    const Lock lock(mutex_);
    return loaded_ && loaded_->by_signal;
  }
  void discard_loaded() {
    const Lock lock(mutex_);
    loaded_.reset();
  }
  /// What is wrong when the loaded terrain was learned in another colour space than `space`.
  std::optional<std::string> foreign(const ColorSpace& space) {
    const Lock lock(mutex_);
    if (!loaded_ || loaded_->terrain.space == space)
      return std::nullopt;
    return "The learned terrain \"" + loaded_->name + "\" was learned in " + name_of(loaded_->terrain.space) +
           " and the video is " + name_of(space) + ".";
  }

  /// Forgets everything, also what was loaded and other streams.
  void reset() {
    const Lock lock(mutex_);
    loaded_.reset();
    others_.clear();
    recalled_.reset();
    if (segmenter_)
      segmenter_->reset();
  }
  /// Forgets what was learned; starts from what was loaded.
  void forget() {
    const Lock lock(mutex_);
    if (!segmenter_)
      return;
    segmenter_->reset();
    if (loaded_)
      (void)segmenter_->adopt(loaded_->terrain);
  }
  /// Forgets what spans neighbouring frames.
  void reset_temporal() {
    const Lock lock(mutex_);
    if (segmenter_)
      segmenter_->reset_temporal();
  }

  /// Keeps the terrain of the stream that ends for when it comes back, and finds the one of `to`.
  void change_stream(const std::string& from, const std::string& to) {
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
  /// Goes on from what this stream learned when it was here before: with its first frame, because its colour
  /// space is known only then. True when there was something.
  bool recall(const std::optional<ColorSpace>& space) {
    const Lock lock(mutex_);
    const auto terrain = std::exchange(recalled_, std::nullopt);
    return segmenter_ && terrain && terrain->space == space && segmenter_->adopt(*terrain).ok();
  }

 private:
  /// Other streams whose terrains are kept, about 9 kB each.
  static constexpr std::size_t most_others = 16;

  static bool holds_anything(const Terrain& terrain) {
    return std::ranges::any_of(terrain.models, [](const TerrainModel& model) { return model.mass > 0; });
  }
  void keep(const std::string& stream) TERRAINSEG_REQUIRES(mutex_) {
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

  /// A terrain that new streams start from.
  struct Loaded {
    Terrain terrain;
    std::string name;
    bool by_signal; ///< of load(), not of offer()
  };
  Mutex mutex_;
  std::unique_ptr<Segmenter> segmenter_ TERRAINSEG_GUARDED_BY(mutex_);
  std::optional<Loaded> loaded_ TERRAINSEG_GUARDED_BY(mutex_);
  /// Of streams that are away, by their ids; the one that was left last is at the end.
  std::vector<std::pair<std::string, Terrain>> others_ TERRAINSEG_GUARDED_BY(mutex_);
  std::optional<Terrain> recalled_ TERRAINSEG_GUARDED_BY(mutex_); ///< of this stream, until its first frame
};

} // namespace terrainseg
