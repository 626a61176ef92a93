// SPDX-License-Identifier: LGPL-2.1-or-later
// Selects Highway's targets for the kernels. Include it before Highway.
#pragma once

#include <bit>
#include <cstdint>
#include <iterator>
#include <type_traits>

// With GCC 12 the target for SVE vectors of exactly 32 bytes gives wrong three-byte pixels (found by
// tests/ci/aarch64.sh). The target for SVE of any length is right and runs on the same machines.
// For builds that test other things: the baseline target and AVX2 compile in half the time.
#ifdef TERRAINSEG_FEW_TARGETS
#define HWY_DISABLED_TARGETS (HWY_SVE_256 | HWY_SSSE3 | HWY_SSE4 | HWY_AVX3)
#else
#define HWY_DISABLED_TARGETS HWY_SVE_256
#endif

// HWY_WANT_AVX3_DL is not set: on a processor that has it no kernel becomes faster (ratios to memcpy 3.46
// instead of 3.52 for the reduction, 10.58 instead of 10.60 for scoring).

/// Whether gathers (look-ups in memory by a vector of indices) are fast on the target that is being compiled.
/// For #if, after including Highway.
#define TERRAINSEG_GATHERS (HWY_TARGET == HWY_AVX2 || HWY_TARGET == HWY_AVX3 || HWY_TARGET == HWY_AVX3_DL)

#include <hwy/targets.h>

namespace terrainseg::kernels {

/// What Highway chose. A reference, because its library would be called for every kernel otherwise.
inline const hwy::ChosenTarget& chosen_target = hwy::GetChosenTarget();

/// Calls `use` with the one of `constants` that equals `value`, as a std::integral_constant: a loop is
/// compiled for each of them. Calls nothing when there is none. `use` has the attribute HWY_ATTR; this
/// function is always inlined, because it would be compiled for the baseline target.
template <auto... constants, class Value, class Use>
[[gnu::always_inline]] inline void with_constant(Value value, const Use& use) {
  ((value == constants ? use(std::integral_constant<Value, constants>()) : void()), ...);
}

/// The value of two bytes as they lie in memory, the lower first, and the other way round.
[[gnu::always_inline]] constexpr std::uint16_t little_endian(std::uint16_t word) {
  return std::endian::native == std::endian::little ? word
                                                    : static_cast<std::uint16_t>(word << 8 | word >> 8);
}

} // namespace terrainseg::kernels

/// Defines the function `name` that a caller sees, which the header declares as a constant pointer: calls the
/// variant for this processor of HWY_NAMESPACE::variant, as HWY_DYNAMIC_DISPATCH does.
// NOLINTBEGIN(bugprone-macro-parentheses): a name that is declared cannot stand in parentheses
#define TERRAINSEG_DISPATCH(name, variant)                                                                   \
  HWY_EXPORT(variant);                                                                                       \
  decltype(name) name = [](auto... values) {                                                                 \
    const auto& table = HWY_DISPATCH_TABLE(variant);                                                         \
    return table[std::size(table) > 1 ? ::terrainseg::kernels::chosen_target.GetIndex() : 0](values...);     \
  }
// NOLINTEND(bugprone-macro-parentheses)
