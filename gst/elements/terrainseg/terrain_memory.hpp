// SPDX-License-Identifier: LGPL-2.1-or-later
// What was learned in streams that are away at the moment.
#pragma once

#include <algorithm>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "terrainseg/terrain.hpp"

namespace terrainseg {

/// A terrain for each stream id, at most `most` of them (about 9 kB each): the one that was left longest ago
/// goes first. Not locked: the owner does.
class TerrainMemory {
 public:
  static constexpr std::size_t most = 16;

  void keep(const std::string& stream, Terrain terrain) {
    take(stream);
    if (kept_.size() == most)
      kept_.erase(kept_.begin());
    kept_.emplace_back(stream, std::move(terrain));
  }
  /// What was kept for the stream, which is not kept any more.
  std::optional<Terrain> take(const std::string& stream) {
    const auto found =
        std::find_if(kept_.begin(), kept_.end(), [&](const auto& entry) { return entry.first == stream; });
    if (found == kept_.end())
      return std::nullopt;
    std::optional<Terrain> terrain = std::move(found->second);
    kept_.erase(found);
    return terrain;
  }
  void clear() { kept_.clear(); }

 private:
  std::vector<std::pair<std::string, Terrain>> kept_; ///< the one left last is at the end
};

} // namespace terrainseg
