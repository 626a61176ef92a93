// SPDX-License-Identifier: LGPL-2.1-or-later
// The segmenter with the terrain it has learned, and the terrains it can go on from.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "elements/terrainseg/settings_book.hpp"
#include "support/mutex.hpp"
#include "terrainseg/segmenter.hpp"

namespace terrainseg {

/// Any thread may call, and waits until the frame that is being processed is done.
class LearnedTerrain {
 public:
  /// Calls `use` with the segmenter, which is there between start() and stop().
  template <class Use> auto use(Use use) {
    const Lock lock(mutex_);
    return use(*segmenter_);
  }
  /// Makes a segmenter, or configures the one that reset-on=never kept; true when it is a new one.
  bool start(const Settings& settings);
  /// Drops the segmenter and what was loaded from model-location, unless `reset_on` is never.
  void stop(ResetOn reset_on, const std::string& stream);

  /// What is learned now; nothing before the start, and while no model has mass.
  std::optional<Terrain> learned();
  Rectangle window(); ///< of the last frame; empty before the first

  /// A new stream starts from `terrain`, and so does the running one if it can adopt it.
  Status load(Terrain terrain, std::string name);
  /// As load(), at the start; load() has precedence.
  void offer(Terrain terrain, std::string name);
  bool was_loaded();
  void discard_loaded();
  /// What is wrong when the loaded terrain was learned in another colour space than `space`.
  std::optional<std::string> foreign(const ColorSpace& space);

  void reset();          ///< forgets everything, also what was loaded and other streams
  void forget();         ///< forgets what was learned; starts from what was loaded
  void reset_temporal(); ///< forgets what spans neighbouring frames

  /// Keeps the terrain of the stream that ends for when it comes back, and finds the one of `to`.
  void change_stream(const std::string& from, const std::string& to);
  /// Goes on from what this stream learned when it was here before: with its first frame, because its colour
  /// space is known only then. True when there was something.
  bool recall(const std::optional<ColorSpace>& space);

 private:
  void keep(const std::string& stream) TERRAINSEG_REQUIRES(mutex_);

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

std::string name_of(const ColorSpace& space);

} // namespace terrainseg
