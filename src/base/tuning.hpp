// SPDX-License-Identifier: LGPL-2.1-or-later
// Constants that were chosen by measuring. In the product each is constexpr and costs nothing. In the core
// that the evaluation links (TERRAINSEG_TUNABLE) each is a number that tuning::set() changes while it runs.
//
//   TERRAINSEG_TUNED(int, geodesic, free_distance, 12);   // geodesic.free_distance
//
// What sizes an array or is asserted at compile time stays constexpr. Numbers are set while no frame is
// processed.
#pragma once

#ifdef TERRAINSEG_TUNABLE

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace terrainseg::tuning {

/// A constant, and what the source has for it.
struct Knob {
  std::string name; ///< room.constant
  std::int64_t standard = 0;
  void* number = nullptr;
  void (*assign)(void* number, std::int64_t value) = nullptr;
};
const std::vector<Knob>& knobs();
/// False where there is none of that name.
bool set(std::string_view name, std::int64_t value);
/// All as the source has them.
void reset();
void add(const Knob& knob);

/// A table that is made of such numbers, and made anew when one of them is set.
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

/// The number of a new knob, which lives as long as the program.
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
