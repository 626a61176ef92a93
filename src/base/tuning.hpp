// SPDX-License-Identifier: LGPL-2.1-or-later
// Constants that were chosen by measurement. In the product each one is constexpr and has no cost. In the
// core for the evaluation (TERRAINSEG_TUNABLE) each one is a variable that tuning::set() changes at run time.
//
//   TERRAINSEG_TUNED(int, geodesic, free_distance, 12);   // geodesic.free_distance
//
// A constant that sizes an array or is used in a static_assert stays constexpr. Variables must not be set
// while a frame is processed.
#pragma once

#ifdef TERRAINSEG_TUNABLE

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace terrainseg::tuning {

/// A tunable constant and its default value in the source.
struct Knob {
  std::string name; ///< group.constant
  std::int64_t standard = 0;
  std::function<void(std::int64_t value)> assign;
};
/// All constants. Created on first use, because source files register theirs before main() in any order.
inline std::vector<Knob>& knobs() {
  static std::vector<Knob> all;
  return all;
}

/// Functions that compute the tables of tunable constants again.
inline std::vector<std::function<void()>>& tables() {
  static std::vector<std::function<void()>> all;
  return all;
}
inline void fill_tables() {
  for (const auto& fill : tables())
    fill();
}
/// A table computed from tunable constants. Recomputed when one of them is set.
template <typename Make> class TableOf {
 public:
  explicit TableOf(Make make) : values_(make()) {
    tables().push_back([this, make] { values_ = make(); });
  }
  TableOf(const TableOf&) = delete;
  TableOf& operator=(const TableOf&) = delete;
  const auto& operator[](std::size_t i) const { return values_[i]; }

 private:
  decltype(std::declval<Make>()()) values_;
};

/// Returns false for an unknown name.
inline bool set(std::string_view name, std::int64_t value) {
  const auto knob = std::ranges::find(knobs(), name, &Knob::name);
  if (knob == knobs().end())
    return false;
  knob->assign(value);
  fill_tables();
  return true;
}

/// Restores all default values.
inline void reset() {
  for (const Knob& knob : knobs())
    knob.assign(knob.standard);
  fill_tables();
}

/// Registers a tunable constant and returns its value, which lives as long as the program.
template <typename Number> const Number& number_of(const char* name, Number standard) {
  auto* const number = new Number(standard);
  knobs().push_back({name, static_cast<std::int64_t>(standard),
                     [number](std::int64_t value) { *number = static_cast<Number>(value); }});
  return *number;
}

} // namespace terrainseg::tuning

#define TERRAINSEG_TUNED(type, room, name, value)                                                            \
  const type& name = ::terrainseg::tuning::number_of<type>(#room "." #name, value)
#define TERRAINSEG_TUNED_TABLE(name, ...) ::terrainseg::tuning::TableOf name([] { return __VA_ARGS__; })

#else

#define TERRAINSEG_TUNED(type, room, name, value) constexpr type name = value
#define TERRAINSEG_TUNED_TABLE(name, ...) constexpr auto name = __VA_ARGS__

#endif
