// SPDX-License-Identifier: LGPL-2.1-or-later
// What is reported once and not with every frame.
#pragma once

#include <optional>
#include <utility>
#include <variant>

namespace terrainseg {

/// True the first time, and again when `key` differs from the last one. Not locked: the owner does.
template <class Key = std::monostate> class Once {
 public:
  bool first(const Key& key = {}) { return std::exchange(last_, key) != key; }
  /// The next time is the first again.
  void again() { last_.reset(); }

 private:
  std::optional<Key> last_;
};

} // namespace terrainseg
