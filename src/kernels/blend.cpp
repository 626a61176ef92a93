// SPDX-License-Identifier: LGPL-2.1-or-later
#include "kernels/blend.hpp"

#include <cstring>

#include "kernels/targets.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "kernels/blend.cpp"
#include <hwy/foreach_target.h>
// Must follow foreach_target.h.
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace terrainseg::kernels {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

HWY_INLINE std::uint8_t mixed(unsigned sample, unsigned coverage, unsigned ink) {
  return static_cast<std::uint8_t>((sample * (256 - coverage) + ink * coverage + 128) >> 8);
}

// At most 255 * 256 + 128, which fits 16 bits.
static_assert(255 * 256 + 128 <= 65535);

bool any(const Coverage* coverage, int count) {
  Coverage all = 0;
  for (int i = 0; i < count; ++i)
    all = static_cast<Coverage>(all | coverage[i]);
  return all != 0;
}

#if HWY_TARGET != HWY_SCALAR

// Distance of the prefetch. The processor's own prefetch stops at page borders, which is every second row.
constexpr int bytes_ahead = 1024;

HWY_INLINE void ask_ahead(const std::uint8_t* samples) {
  __builtin_prefetch(samples + bytes_ahead, 1);
}

// Blends 16-bit lanes with one multiplication: (s (256 - a) + i a + 128) >> 8 = s + (((i - s) a + 128) >> 8).
// The second term is the rounded Q15 product of (i - s) << 7 and a, which both fit 16 signed bits.
static_assert(255 << 7 <= 32767);
template <class D16, class V = hn::Vec<D16>> HWY_INLINE V mix(D16 d16, V sample, V coverage, V ink) {
  const hn::RebindToSigned<D16> di16;
  const auto difference = hn::ShiftLeft<7>(hn::BitCast(di16, hn::Sub(ink, sample)));
  return hn::Add(sample, hn::BitCast(d16, hn::MulFixedPoint15(difference, hn::BitCast(di16, coverage))));
}

// Blends both bytes of 16-bit lanes, each with its own coverage and ink.
template <class D16, class V = hn::Vec<D16>>
HWY_INLINE V mix_both(D16 d16, V samples, V low_coverage, V high_coverage, V low_ink, V high_ink) {
  const V low = mix(d16, hn::And(samples, hn::Set(d16, 255)), low_coverage, low_ink);
  const V high = mix(d16, hn::ShiftRight<8>(samples), high_coverage, high_ink);
  return hn::Or(low, hn::ShiftLeft<8>(high));
}

#endif

// Auto-vectorised: in signed 16 bits, of which a vector holds the most.
void cover(const std::uint8_t* __restrict mask, int count, Coverage full, Coverage half,
           Coverage* __restrict out) {
  for (int i = 0; i < count; ++i) {
    const std::int16_t value = mask[i], weak = value > 63 ? half : Coverage{0};
    out[i] = static_cast<Coverage>(value > 191 ? full : weak);
  }
}

void pool(const Coverage* __restrict top, const Coverage* __restrict bottom, int pixels,
          Coverage* __restrict out) {
  const int pairs = pixels / 2;
  if (bottom)
    for (int i = 0; i < pairs; ++i) {
      const auto left = static_cast<Coverage>(top[2 * i] + bottom[2 * i]),
                 right = static_cast<Coverage>(top[2 * i + 1] + bottom[2 * i + 1]);
      out[i] = static_cast<Coverage>(static_cast<Coverage>(left + right + 2) >> 2);
    }
  else
    for (int i = 0; i < pairs; ++i)
      out[i] = static_cast<Coverage>((top[2 * i] + top[2 * i + 1] + 1) >> 1);
  if (pixels % 2) {
    const int last = pixels - 1;
    out[pairs] = bottom ? static_cast<Coverage>((top[last] + bottom[last] + 1) >> 1) : top[last];
  }
}

// The last vector overlaps the one before it; it is computed first, from samples that are still unchanged,
// and stored last.
void plane(std::uint8_t* samples, const Coverage* coverage, int count, std::uint8_t ink) {
#if HWY_TARGET != HWY_SCALAR
  const hn::CappedTag<std::uint16_t, 32> d16;
  const hn::Rebind<std::uint8_t, decltype(d16)> d8;
  const hn::Rebind<std::int16_t, decltype(d16)> di16;
  const auto colour = hn::Set(d16, ink);
  const int lanes = static_cast<int>(hn::Lanes(d8)), tail = count - lanes;
  const auto blended = [&](int i) HWY_ATTR __attribute__((always_inline)) {
    ask_ahead(samples + i);
    const auto sum =
        mix(d16, hn::PromoteTo(d16, hn::LoadU(d8, samples + i)), hn::LoadU(d16, coverage + i), colour);
    return hn::DemoteTo(d8, hn::BitCast(di16, sum));
  };
  if (tail >= 0) {
    const auto last = blended(tail);
    for (int i = 0; i < tail; i += lanes)
      hn::StoreU(blended(i), d8, samples + i);
    return hn::StoreU(last, d8, samples + tail);
  }
#endif
  for (int i = 0; i < count; ++i)
    samples[i] = mixed(samples[i], coverage[i], ink);
}

// The bytes as a number, in the order of the machine.
template <class Word> HWY_INLINE Word word_of(const std::uint8_t* bytes) {
  Word word;
  std::memcpy(&word, bytes, sizeof word);
  return word;
}

// Blends a sample of two bytes, little-endian, with `shift` unused lower bits. One multiplication:
// (s (256 - a) + i a + 128) >> 8 = s + (((i - s) a + 128) >> 8).
HWY_INLINE void mix_word(std::uint8_t* at, int coverage, int shift, int ink) {
  const int sample = little_endian(word_of<std::uint16_t>(at)) >> shift;
  const int value = (sample + (((ink - sample) * coverage + 128) >> 8)) << shift;
  const std::uint16_t word = little_endian(static_cast<std::uint16_t>(value));
  std::memcpy(at, &word, sizeof word);
}

// Auto-vectorised, as the next loops.
void words(std::uint8_t* __restrict samples, const Coverage* __restrict coverage, int count, int shift,
           std::uint16_t ink) {
  for (int i = 0; i < count; ++i)
    mix_word(samples + 2 * i, coverage[i], shift, ink);
}

void word_pairs(std::uint8_t* __restrict samples, const Coverage* __restrict coverage, int count, int shift,
                const std::array<std::uint16_t, 2>& ink) {
  const auto [first, second] = ink;
  for (int i = 0; i < count; ++i) {
    mix_word(samples + 4 * i, coverage[i], shift, first);
    mix_word(samples + 4 * i + 2, coverage[i], shift, second);
  }
}

void triples(std::uint8_t* __restrict samples, const Coverage* __restrict coverage, int count,
             const std::array<std::uint8_t, 3>& ink) {
  const auto [first, second, third] = ink;
  for (int i = 0; i < count; ++i) {
    std::uint8_t* const s = samples + 3 * i;
    s[0] = mixed(s[0], coverage[i], first);
    s[1] = mixed(s[1], coverage[i], second);
    s[2] = mixed(s[2], coverage[i], third);
  }
}

// Blends pixels of two or four bytes: every second byte at once. The bits of `kept` are not changed.
template <class Word>
HWY_INLINE void whole_pixels(std::uint8_t* __restrict samples, const Coverage* __restrict coverage, int count,
                             Word ink, Word kept) {
  constexpr auto bytes = static_cast<Word>(0x00ff00ff), rounding = static_cast<Word>(0x00800080);
  const auto low_ink = static_cast<Word>(ink & bytes), high_ink = static_cast<Word>(ink >> 8 & bytes);
  for (int i = 0; i < count; ++i) {
    std::uint8_t* const at = samples + std::ptrdiff_t{sizeof(Word)} * i;
    const Word pixel = word_of<Word>(at), weight = coverage[i], rest = static_cast<Word>(256 - weight);
    const auto low = static_cast<Word>((pixel & bytes) * rest + low_ink * weight + rounding),
               high = static_cast<Word>((pixel >> 8 & bytes) * rest + high_ink * weight + rounding);
    const auto blended = static_cast<Word>((low >> 8 & bytes) | (high & ~bytes));
    const auto out = static_cast<Word>((pixel & kept) | (blended & ~kept));
    std::memcpy(at, &out, sizeof out);
  }
}

void pairs(std::uint8_t* samples, const Coverage* coverage, int count,
           const std::array<std::uint8_t, 2>& ink) {
  whole_pixels<std::uint16_t>(samples, coverage, count, word_of<std::uint16_t>(ink.data()), 0);
}

void quads(std::uint8_t* samples, const Coverage* coverage, int count, const std::array<std::uint8_t, 4>& ink,
           int untouched) {
  std::array<std::uint8_t, 4> kept{};
  kept[static_cast<std::size_t>(untouched)] = 255;
  whole_pixels(samples, coverage, count, word_of<std::uint32_t>(ink.data()),
               word_of<std::uint32_t>(kept.data()));
}

void packed_422(std::uint8_t* samples, const Coverage* coverage, int count,
                const std::array<std::uint8_t, 3>& ink, bool luma_first) {
  const int luma = luma_first ? 0 : 1;
  int i = 0;
#if HWY_TARGET != HWY_SCALAR
  const hn::CappedTag<std::uint16_t, 32> d16;
  const hn::Repartition<std::uint32_t, decltype(d16)> d32;
  const hn::Repartition<std::uint8_t, decltype(d16)> d8;
  const auto luma_ink = hn::Set(d16, ink[0]);
  const auto chroma_ink = hn::BitCast(
      d16, hn::Set(d32, static_cast<std::uint32_t>(ink[1]) | static_cast<std::uint32_t>(ink[2]) << 16));
  const int lanes = static_cast<int>(hn::Lanes(d16));
  for (; i + lanes <= count; i += lanes) {
    ask_ahead(samples + 2 * i);
    const auto both = hn::BitCast(d16, hn::LoadU(d8, samples + 2 * i));
    const auto a = hn::LoadU(d16, coverage + i);
    const auto a32 = hn::BitCast(d32, a);
    const auto neighbour = hn::BitCast(d16, hn::Or(hn::ShiftLeft<16>(a32), hn::ShiftRight<16>(a32)));
    const auto mean = hn::AverageRound(a, neighbour);
    const auto mixed_both = luma_first ? mix_both(d16, both, a, mean, luma_ink, chroma_ink)
                                       : mix_both(d16, both, mean, a, chroma_ink, luma_ink);
    hn::StoreU(hn::BitCast(d8, mixed_both), d8, samples + 2 * i);
  }
#endif
  for (; i < count; i += 2) {
    const bool whole = i + 1 < count;
    const unsigned mean = whole ? (coverage[i] + coverage[i + 1] + 1U) >> 1 : coverage[i];
    std::uint8_t* s = samples + 2 * i;
    s[luma] = mixed(s[luma], coverage[i], ink[0]);
    if (whole)
      s[luma + 2] = mixed(s[luma + 2], coverage[i + 1], ink[0]);
    s[1 - luma] = mixed(s[1 - luma], mean, ink[1]);
    s[3 - luma] = mixed(s[3 - luma], mean, ink[2]);
  }
}

} // namespace HWY_NAMESPACE
} // namespace terrainseg::kernels
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace terrainseg::kernels {

TERRAINSEG_DISPATCH(cover_mask, cover);
TERRAINSEG_DISPATCH(covers, any);
TERRAINSEG_DISPATCH(pool_coverage, pool);
TERRAINSEG_DISPATCH(blend_plane, plane);
TERRAINSEG_DISPATCH(blend_pairs, pairs);
TERRAINSEG_DISPATCH(blend_words, words);
TERRAINSEG_DISPATCH(blend_word_pairs, word_pairs);
TERRAINSEG_DISPATCH(blend_triples, triples);
TERRAINSEG_DISPATCH(blend_quads, quads);
TERRAINSEG_DISPATCH(blend_422, packed_422);

} // namespace terrainseg::kernels
#endif
