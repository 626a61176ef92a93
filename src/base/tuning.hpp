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
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace terrainseg::tuning {

/// A tunable constant and its default value in the source.
struct Knob {
  std::string name; ///< group.constant
  std::int64_t standard = 0;
  void* number = nullptr;
  void (*assign)(void* number, std::int64_t value) = nullptr;
};
/// All constants. Created on first use, because source files register theirs before main() in any order.
inline std::vector<Knob>& knobs() {
  static std::vector<Knob> all;
  return all;
}

/// A table computed from tunable constants. Recomputed when one of them is set.
class Table {
 public:
  virtual void fill() = 0;

 protected:
  Table() = default;
  ~Table() = default;
};
/// All tables.
inline std::vector<Table*>& tables() {
  static std::vector<Table*> all;
  return all;
}
inline void fill_tables() {
  for (Table* table : tables())
    table->fill();
}
template <typename Make> class TableOf final : public Table {
 public:
  explicit TableOf(Make make) : make_(make), values_(make()) { tables().push_back(this); }
  TableOf(const TableOf&) = delete;
  TableOf& operator=(const TableOf&) = delete;
  void fill() override { values_ = make_(); }
  const auto& operator[](std::size_t i) const { return values_[i]; }

 private:
  Make make_;
  decltype(std::declval<Make>()()) values_;
};

/// Returns false for an unknown name.
inline bool set(std::string_view name, std::int64_t value) {
  const auto knob =
      std::find_if(knobs().begin(), knobs().end(), [&](const Knob& k) { return k.name == name; });
  if (knob == knobs().end())
    return false;
  knob->assign(knob->number, value);
  fill_tables();
  return true;
}

/// Restores all default values.
inline void reset() {
  for (const Knob& knob : knobs())
    knob.assign(knob.number, knob.standard);
  fill_tables();
}

/// Registers a tunable constant and returns its value, which lives as long as the program.
template <typename Number> const Number& number_of(const char* name, Number standard) {
  auto* const number = new Number(standard);
  knobs().push_back({name, static_cast<std::int64_t>(standard), number, [](void* at, std::int64_t value) {
                       *static_cast<Number*>(at) = static_cast<Number>(value);
                     }});
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
