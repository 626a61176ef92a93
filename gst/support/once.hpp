// SPDX-License-Identifier: LGPL-2.1-or-later
// Reports something once instead of with every frame.
#pragma once

#include <optional>
#include <utility>
#include <variant>

namespace terrainseg {

/// Returns true the first time, and when `key` differs from the last one. Not thread-safe.
template <class Key = std::monostate> class Once {
 public:
  bool first(const Key& key = {}) { return std::exchange(last_, key) != key; }
  /// The next call returns true again.
  void again() { last_.reset(); }

 private:
  std::optional<Key> last_;
};

} // namespace terrainseg
