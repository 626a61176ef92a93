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
const std::vector<Knob>& knobs();
/// Returns false for an unknown name.
bool set(std::string_view name, std::int64_t value);
/// Restores all default values.
void reset();
void add(const Knob& knob);

/// A table computed from tunable constants. Recomputed when one of them is set.
class Table {
 public:
  virtual void fill() = 0;

 protected:
  Table() = default;
  ~Table() = default;
  void join();
};
template <typename Make> class TableOf final : public Table {
 public:
  explicit TableOf(Make make) : make_(make), values_(make()) { join(); }
  TableOf(const TableOf&) = delete;
  TableOf& operator=(const TableOf&) = delete;
  void fill() override { values_ = make_(); }
  const auto& operator[](std::size_t i) const { return values_[i]; }

 private:
  Make make_;
  decltype(std::declval<Make>()()) values_;
};

/// Registers a tunable constant and returns its value, which lives as long as the program.
template <typename Number> const Number& number_of(const char* name, Number standard) {
  auto* const number = new Number(standard);
  add({name, static_cast<std::int64_t>(standard), number,
       [](void* at, std::int64_t value) { *static_cast<Number*>(at) = static_cast<Number>(value); }});
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
