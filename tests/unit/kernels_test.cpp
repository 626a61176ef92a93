// SPDX-License-Identifier: LGPL-2.1-or-later
// Every kernel on every target against a direct transcription: the same bits, whatever the length, alignment
// and content, and no byte touched that is not the row's own. Sizes run over all remainders of the widest
// vector.
#include <algorithm>
#include <array>
#include <cmath>

#include "kernel_harness.hpp"
#include "kernels/blend.hpp"
#include "kernels/cells.hpp"
#include "kernels/ground_warp.hpp"
#include "kernels/mask.hpp"
#include "kernels/point_fit.hpp"
#include "kernels/reduce.hpp"
#include "kernels/score_table.hpp"
#include "kernels/sides.hpp"

namespace {

using namespace terrainseg::kernels;
using namespace terrainseg::testing;

int reflected(int i, int size) {
  if (size == 1)
    return 0;
  for (;;) {
    if (i < 0)
      i = -i;
    else if (i >= size)
      i = 2 * (size - 1) - i;
    else
      return i;
  }
}

// What reduce_pair promises, written down directly: element (x, channel) of the next row.
struct Expected {
  std::vector<std::uint16_t> partial, held;
  std::vector<std::uint8_t> out;
};

template <typename Bytes>
Expected reduced(int step, const Bytes& odd, const Bytes& even, int width,
                 const std::vector<std::uint16_t>& partial, const std::vector<std::uint16_t>& held) {
  const int written = step == 3 ? 4 : step;
  Expected e{partial, held, std::vector<std::uint8_t>(partial.size(), 0)};
  for (int x = 0; x < (width + 1) / 2; ++x)
    for (int c = 0; c < step; ++c) {
      constexpr int weight[5] = {1, 4, 6, 4, 1};
      int o = 0, v = 0;
      for (int k = 0; k < 5; ++k) {
        const auto at = static_cast<std::size_t>(reflected(2 * x + k - 2, width) * step + c);
        o += weight[k] * odd[at];
        v += weight[k] * even[at];
      }
      const auto i = static_cast<std::size_t>(x * written + c);
      e.out[i] = static_cast<std::uint8_t>((partial[i] + 4 * o + v + 128) / 256);
      e.partial[i] = static_cast<std::uint16_t>(held[i] + 4 * o + 6 * v);
      e.held[i] = static_cast<std::uint16_t>(v);
    }
  return e;
}

void check_reduce(int step, int width, Fill how, bool at_end, std::mt19937& random) {
  const int written = step == 3 ? 4 : step;
  const std::size_t in = static_cast<std::size_t>(width) * step;
  const std::size_t size = static_cast<std::size_t>((width + 1) / 2) * written;
  const Guarded<std::uint8_t> odd(in, at_end), even(in, at_end), out(size, at_end);
  const Guarded<std::uint16_t> partial(size, at_end), held(size, at_end);
  std::vector<std::uint16_t> old_partial(size), old_held(size);
  fill(odd, how, random);
  fill(even, how, random);
  for (std::size_t i = 0; i < size; ++i) {
    if (written > step && i % 4 == 3)
      continue; // the fourth byte of three is no sample
    old_held[i] = how == Fill::full ? 4080 : random() % 4081;
    old_partial[i] = how == Fill::full ? 44880 : random() % 44881;
  }
  std::copy(old_partial.begin(), old_partial.end(), partial.begin());
  std::copy(old_held.begin(), old_held.end(), held.begin());
  const Expected e = reduced(step, odd, even, width, old_partial, old_held);
  reduce_pair(static_cast<Interleave>(step), odd.data(), even.data(), width, 0, {partial.data(), held.data()},
              out.data());
  for (std::size_t i = 0; i < size; ++i) {
    ASSERT_EQ(out[i], e.out[i]) << "step " << step << " width " << width << " at " << i;
    ASSERT_EQ(partial[i], e.partial[i]) << "step " << step << " width " << width << " at " << i;
    ASSERT_EQ(held[i], e.held[i]) << "step " << step << " width " << width << " at " << i;
  }
}

TEST(Kernels, ReducePair) {
  on_every_target([] {
    std::mt19937 random(1);
    for (int step = 1; step <= 4; ++step)
      for (int width = 1; width <= 300; ++width)
        for (const bool at_end : {false, true}) {
          check_reduce(step, width, all_fills[width % 5], at_end, random);
          if (::testing::Test::HasFatalFailure())
            return;
        }
    for (const Fill how : all_fills)
      for (int step = 1; step <= 4; ++step)
        check_reduce(step, 1920 + step, how, true, random);
  });
}

// What is asked for ahead, of rows that share a page and of longer ones, changes nothing that is written.
TEST(Kernels, ReducePairAhead) {
  on_every_target([] {
    std::mt19937 random(4);
    for (int step = 1; step <= 4; ++step)
      for (const int width : {1, 2, 31, 64, 65, 129, 257, 300, 960, 1365, 1920, 2731, 3840}) {
        const int written = step == 3 ? 4 : step;
        const std::size_t in = static_cast<std::size_t>(width) * step,
                          size = static_cast<std::size_t>((width + 1) / 2) * written;
        const Guarded<std::uint8_t> rows(2 * in, true);
        fill(rows, Fill::noise, random);
        const std::vector<std::uint16_t> partial(size, 123), held(size, 45);
        const auto reduced_with = [&](std::ptrdiff_t ahead) {
          Expected e{partial, held, std::vector<std::uint8_t>(size)};
          reduce_pair(static_cast<Interleave>(step), rows.data(), rows.data() + in, width, ahead,
                      {e.partial.data(), e.held.data()}, e.out.data());
          return e;
        };
        const Expected without = reduced_with(0);
        for (const std::ptrdiff_t ahead : {std::ptrdiff_t{64}, static_cast<std::ptrdiff_t>(2 * in)}) {
          const Expected with = reduced_with(ahead);
          ASSERT_EQ(with.out, without.out) << "step " << step << " width " << width;
          ASSERT_EQ(with.partial, without.partial) << "step " << step << " width " << width;
          ASSERT_EQ(with.held, without.held) << "step " << step << " width " << width;
        }
      }
  });
}

TEST(Kernels, ReduceHorizontally) {
  on_every_target([] {
    std::mt19937 random(5);
    for (int step = 1; step <= 4; ++step)
      for (int width = 1; width <= 300; ++width)
        for (const bool at_end : {false, true}) {
          const int written = step == 3 ? 4 : step, half = (width + 1) / 2;
          const Guarded<std::uint8_t> row(static_cast<std::size_t>(width * step), at_end),
              out(static_cast<std::size_t>(half * written), at_end);
          fill(row, all_fills[width % 5], random);
          reduce_horizontally(static_cast<Interleave>(step), row.data(), width, width % 2 ? 0 : 4096,
                              out.data());
          constexpr int weights[5] = {1, 4, 6, 4, 1};
          for (int x = 0; x < half; ++x)
            for (int c = 0; c < written; ++c) {
              int sum = c < step ? 8 : 0;
              for (int k = 0; k < 5 && c < step; ++k) {
                int from = width == 1 ? 0 : std::abs(2 * x + k - 2);
                if (from >= width)
                  from = std::abs(2 * width - 2 - from);
                sum += weights[k] * row[static_cast<std::size_t>(from * step + c)];
              }
              ASSERT_EQ(out[static_cast<std::size_t>(x * written + c)], sum / 16)
                  << "step " << step << " width " << width << " at " << x;
            }
        }
  });
}

TEST(Kernels, ReducePairVertically) {
  on_every_target([] {
    std::mt19937 random(2);
    for (int bytes = 1; bytes <= 300; ++bytes)
      for (const bool at_end : {false, true}) {
        const auto size = static_cast<std::size_t>(bytes);
        const Guarded<std::uint8_t> odd(size, at_end), even(size, at_end), out(size, at_end);
        const Guarded<std::uint16_t> partial(size, at_end), held(size, at_end);
        fill(odd, all_fills[bytes % 5], random);
        fill(even, all_fills[bytes % 5], random);
        std::vector<std::uint16_t> p(size), h(size);
        for (std::size_t i = 0; i < size; ++i) {
          partial[i] = p[i] = static_cast<std::uint16_t>(random() % (11 * 255 + 1));
          held[i] = h[i] = static_cast<std::uint16_t>(random() % 256);
        }
        reduce_pair_vertically(odd.data(), even.data(), bytes, {partial.data(), held.data()}, out.data());
        for (std::size_t i = 0; i < size; ++i) {
          ASSERT_EQ(out[i], (p[i] + 4 * odd[i] + even[i] + 8) / 16) << bytes << " at " << i;
          ASSERT_EQ(partial[i], h[i] + 4 * odd[i] + 6 * even[i]);
          ASSERT_EQ(held[i], even[i]);
        }
      }
  });
}

// The least of all sums, one by one; the largest numbers that the header allows, and places that do not move.
TEST(Kernels, SpreadLeast) {
  on_every_target([] {
    std::mt19937 random(6);
    constexpr std::int32_t most = (1 << 28) - 1;
    for (int count = 0; count <= 70; ++count)
      for (const bool large : {false, true}) {
        const auto size = static_cast<std::size_t>(count);
        const Guarded<std::int32_t> values(size, true), places(size, true);
        for (std::size_t i = 0; i < size; ++i) {
          values[i] =
              large ? (random() % 2 ? most : -most) : static_cast<std::int32_t>(random() % 2000) - 1000;
          const auto step = static_cast<std::int32_t>(random() % 3 ? random() % (large ? 1 << 21 : 300) : 0);
          places[i] = i == 0 ? 0 : std::min(places[i - 1] + step, most);
        }
        std::vector<std::int32_t> expected(size, INT32_MAX);
        for (std::size_t i = 0; i < size; ++i)
          for (std::size_t k = 0; k < size; ++k)
            expected[i] = std::min(expected[i], values[k] + std::abs(places[i] - places[k]));
        spread_least(values.data(), places.data(), count);
        for (std::size_t i = 0; i < size; ++i)
          ASSERT_EQ(values[i], expected[i]) << "count " << count << " at " << i;
      }
  });
}

TEST(Kernels, Split422) {
  on_every_target([] {
    std::mt19937 random(3);
    for (int width = 1; width <= 300; ++width)
      for (const bool at_end : {false, true})
        for (const bool luma_first : {false, true}) {
          const std::size_t bytes = static_cast<std::size_t>((width + 1) / 2) * 2;
          const Guarded<std::uint8_t> row(2 * bytes, at_end), luma(bytes, at_end), chroma(bytes, at_end);
          fill(row, Fill::noise, random);
          split_422(row.data(), width, luma_first, 0, luma.data(), chroma.data());
          for (std::size_t i = 0; i < bytes; ++i) {
            ASSERT_EQ(luma[i], row[2 * i + (luma_first ? 0 : 1)]) << width << " at " << i;
            ASSERT_EQ(chroma[i], row[2 * i + (luma_first ? 1 : 0)]) << width << " at " << i;
          }
        }
  });
}

TEST(Kernels, Narrow) {
  on_every_target([] {
    std::mt19937 random(4);
    for (int count = 1; count <= 300; ++count)
      for (const bool at_end : {false, true})
        for (const int shift : {0, 2, 4, 8}) {
          const auto size = static_cast<std::size_t>(count);
          const Guarded<std::uint8_t> row(2 * size, at_end), out(size, at_end);
          fill(row, all_fills[count % 5], random);
          narrow(row.data(), shift, count, 0, out.data());
          for (std::size_t i = 0; i < size; ++i)
            ASSERT_EQ(out[i], (row[2 * i] + 256 * row[2 * i + 1]) / (1 << shift) % 256)
                << count << " at " << i << " shift " << shift;
        }
  });
}

TEST(Kernels, Spread) {
  on_every_target([] {
    std::mt19937 random(8);
    for (int width = 1; width <= 160; ++width)
      for (int step = 1; step <= 4; ++step)
        for (int shift = 0; shift <= 1; ++shift) {
          const int offset = static_cast<int>(random() % static_cast<unsigned>(step));
          const int samples = (width + shift) >> shift;
          const Guarded<std::uint8_t> row(static_cast<std::size_t>((samples - 1) * step + offset + 1), true);
          const Guarded<std::uint8_t> out(static_cast<std::size_t>(width), true);
          fill(row, Fill::noise, random);
          spread(row.data(), offset, step, shift, width, out.data());
          for (int x = 0; x < width; ++x)
            ASSERT_EQ(out[x], row[(x >> shift) * step + offset]) << width << " at " << x;
        }
  });
}

void check_mask(int width, int height, int stride, int spread, std::mt19937& random) {
  std::vector<std::uint16_t> boundary(width), safe(width);
  const int base = static_cast<int>(random() % static_cast<unsigned>(height + 1));
  for (int x = 0; x < width; ++x) {
    boundary[x] = static_cast<std::uint16_t>(std::min(height, base + static_cast<int>(random() % spread)));
    safe[x] = static_cast<std::uint16_t>(std::min(65535, boundary[x] + static_cast<int>(random() % spread)));
  }
  const Guarded<std::uint8_t> mask(static_cast<std::size_t>(stride) * (height - 1) + width, true);
  const Guarded<std::uint8_t> work(2 * static_cast<std::size_t>(width), true);
  std::fill(mask.begin(), mask.end(), 77);
  const int cut = height / 3;
  for (const auto& [first, end] : {std::pair{0, cut}, {cut, height}})
    write_mask_rows(boundary.data(), safe.data(), width, first, end, mask.data(), stride, work.data());
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < stride; ++x) {
      if (y == height - 1 && x >= width)
        break;
      const int expected = x >= width ? 77 : y < boundary[x] ? 0 : y < safe[x] ? 128 : 255;
      ASSERT_EQ(mask[static_cast<std::size_t>(y) * stride + x], expected)
          << width << "x" << height << " at " << x << "," << y;
    }
}

TEST(Kernels, WriteMaskRows) {
  on_every_target([] {
    std::mt19937 random(5);
    for (int width = 1; width <= 200; ++width)
      check_mask(width, 1 + static_cast<int>(random() % 40), width + width % 3, 1 + width % 17, random);
    for (const int spread : {1, 2, 250, 600, 1500})
      check_mask(131, 1100, 131, spread, random);
  });
}

TEST(Kernels, AddMaskStretches) {
  on_every_target([] {
    std::mt19937 random(8);
    for (int width = 1; width <= 150; ++width) {
      const int height = 1 + static_cast<int>(random() % 30), stride = width + width % 3;
      const Guarded<std::uint16_t> first(static_cast<std::size_t>(width), true),
          end(static_cast<std::size_t>(width), true);
      for (int x = 0; x < width; ++x) {
        const bool tall = random() % 8 == 0; // rows of an 8K frame do not fit into a byte
        first[x] = static_cast<std::uint16_t>(random() % (tall ? 65536 : height + 2));
        end[x] = static_cast<std::uint16_t>(random() % 4 ? random() % (height + 2) : 65535);
      }
      const Guarded<std::uint8_t> mask(static_cast<std::size_t>(stride) * (height - 1) + width, true);
      for (std::size_t i = 0; i < mask.size(); ++i)
        mask[i] = static_cast<std::uint8_t>(i % 3 == 0 ? 128 : 0);
      const int from = height / 4;
      add_mask_stretches(first.data(), end.data(), width, from, height, mask.data(), stride);
      for (int y = 0; y < height; ++y)
        for (int x = 0; x < (y == height - 1 ? width : stride); ++x) {
          const std::size_t i = static_cast<std::size_t>(y) * stride + x;
          const bool inside = x < width && y >= from && y >= first[x] && y < end[x];
          ASSERT_EQ(mask[i], inside ? 255 : i % 3 == 0 ? 128 : 0) << width << " at " << x << "," << y;
        }
    }
  });
}

std::uint8_t mixed(int sample, int coverage, int ink) {
  return static_cast<std::uint8_t>((sample * (256 - coverage) + ink * coverage + 128) / 256);
}

// Samples and coverage of `count` pixels between forbidden pages, and the samples as they were.
struct Canvas {
  Guarded<std::uint8_t> samples;
  Guarded<Coverage> coverage;
  std::vector<std::uint8_t> before;

  Canvas(int step, int count, bool at_end, std::mt19937& random)
      : samples(static_cast<std::size_t>(step * count), at_end),
        coverage(static_cast<std::size_t>(count), at_end) {
    fill(samples, all_fills[count % 5], random);
    for (Coverage& c : coverage)
      c = static_cast<Coverage>(count % 4 == 0   ? 256
                                : count % 4 == 1 ? (random() & 1) * 256
                                                 : random() % 257);
    before.assign(samples.begin(), samples.end());
  }
};

template <typename Check> void on_every_count(Check&& check) {
  on_every_target([&] {
    std::mt19937 random(6);
    for (int count = 1; count <= 160; ++count)
      for (const bool at_end : {false, true}) {
        check(count, at_end, random);
        if (::testing::Test::HasFatalFailure())
          return;
      }
  });
}

TEST(Kernels, BlendInterleaved) {
  on_every_count([](int count, bool at_end, std::mt19937& random) {
    const std::array<std::uint8_t, 4> ink = {255, 0, static_cast<std::uint8_t>(random()), 130};
    for (int step = 1; step <= 4; ++step)
      for (int untouched = 0; untouched < (step == 4 ? 4 : 1); ++untouched) {
        const Canvas c(step, count, at_end, random);
        switch (step) {
        case 1:
          blend_plane(c.samples.data(), c.coverage.data(), count, ink[0]);
          break;
        case 2:
          blend_pairs(c.samples.data(), c.coverage.data(), count, {ink[0], ink[1]});
          break;
        case 3:
          blend_triples(c.samples.data(), c.coverage.data(), count, {ink[0], ink[1], ink[2]});
          break;
        default:
          blend_quads(c.samples.data(), c.coverage.data(), count, ink, untouched);
        }
        for (int i = 0; i < count * step; ++i) {
          const int channel = i % step;
          const auto at = static_cast<std::size_t>(i);
          const int expected = step == 4 && channel == untouched
                                   ? c.before[at]
                                   : mixed(c.before[at], c.coverage[at / static_cast<std::size_t>(step)],
                                           ink[static_cast<std::size_t>(channel)]);
          ASSERT_EQ(c.samples[at], expected) << "step " << step << " count " << count << " at " << i;
        }
      }
  });
}

TEST(Kernels, BlendWords) {
  on_every_count([](int count, bool at_end, std::mt19937& random) {
    for (const int step : {1, 2})
      for (const auto& [depth, shift] : {std::pair{10, 0}, {10, 6}, {16, 0}}) {
        const Canvas c(2 * step, count, at_end, random);
        const unsigned most = (1U << depth) - 1;
        const std::array<std::uint16_t, 2> ink = {static_cast<std::uint16_t>(most),
                                                  static_cast<std::uint16_t>(random() & most)};
        // Unused upper bits are 0, as the formats have it.
        for (std::size_t i = 1; i < c.samples.size(); i += 2)
          if (depth + shift < 16)
            c.samples[i] &= 3;
        const std::vector<std::uint8_t> before(c.samples.begin(), c.samples.end());
        if (step == 1)
          blend_words(c.samples.data(), c.coverage.data(), count, shift, ink[0]);
        else
          blend_word_pairs(c.samples.data(), c.coverage.data(), count, shift, ink);
        for (int i = 0; i < count * step; ++i) {
          const auto at = static_cast<std::size_t>(2 * i);
          const std::int64_t sample = (before[at] + 256 * before[at + 1]) / (1 << shift);
          const std::int64_t a = c.coverage[static_cast<std::size_t>(i / step)];
          const std::int64_t expected =
              (sample * (256 - a) + ink[static_cast<std::size_t>(i % step)] * a + 128) / 256 * (1 << shift);
          ASSERT_EQ(c.samples[at] + 256 * c.samples[at + 1], expected)
              << "step " << step << " depth " << depth << " count " << count << " at " << i;
        }
      }
  });
}

TEST(Kernels, Blend422) {
  on_every_count([](int count, bool at_end, std::mt19937& random) {
    for (const bool luma_first : {false, true}) {
      const int whole = (count + 1) / 2 * 2; // the row always holds whole pairs
      const Canvas c(2, whole, at_end, random);
      const std::array<std::uint8_t, 3> ink = {static_cast<std::uint8_t>(random()), 255, 0};
      blend_422(c.samples.data(), c.coverage.data(), count, ink, luma_first);
      for (int x = 0; x < whole; ++x) {
        const int luma = 2 * x + (luma_first ? 0 : 1), chroma = 2 * x + (luma_first ? 1 : 0);
        const auto a = [&](int i) { return int{c.coverage[static_cast<std::size_t>(i)]}; };
        const int left = x & ~1;
        const int mean = left + 1 < count ? (a(left) + a(left + 1) + 1) / 2 : a(left);
        const auto before = [&](int i) { return int{c.before[static_cast<std::size_t>(i)]}; };
        ASSERT_EQ(c.samples[static_cast<std::size_t>(luma)],
                  x < count ? mixed(before(luma), a(x), ink[0]) : before(luma))
            << count << " at " << x;
        ASSERT_EQ(c.samples[static_cast<std::size_t>(chroma)],
                  mixed(before(chroma), mean, ink[static_cast<std::size_t>(1 + x % 2)]))
            << count << " at " << x;
      }
    }
  });
}

TEST(Kernels, Coverage) {
  on_every_count([](int count, bool at_end, std::mt19937& random) {
    const auto size = static_cast<std::size_t>(count);
    const Guarded<std::uint8_t> mask(size, at_end);
    const Guarded<Coverage> top(size, at_end), bottom(size, at_end), pooled((size + 1) / 2, at_end);
    for (auto& m : mask)
      m = std::array<std::uint8_t, 6>{0, 63, 64, 128, 191, 255}[random() % (count % 3 == 0 ? 2 : 6)];
    bool some = false;
    cover_mask(mask.data(), count, 256, 51, top.data());
    for (std::size_t i = 0; i < size; ++i) {
      ASSERT_EQ(top[i], mask[i] >= 192 ? 256 : mask[i] >= 64 ? 51 : 0);
      some = some || top[i] != 0;
    }
    ASSERT_EQ(covers(top.data(), count), some);
    for (auto& c : bottom)
      c = static_cast<Coverage>(random() % 257);
    for (const bool two : {false, true}) {
      pool_coverage(top.data(), two ? bottom.data() : nullptr, count, pooled.data());
      for (std::size_t i = 0; i < pooled.size(); ++i) {
        int sum = 0, parts = 0;
        for (std::size_t x = 2 * i; x < std::min(size, 2 * i + 2); ++x) {
          sum += top[x] + (two ? bottom[x] : 0);
          parts += two ? 2 : 1;
        }
        ASSERT_EQ(pooled[i], (sum + parts / 2) / parts);
      }
    }
  });
}

// Both ways to score a row, against the definition, in every layout that frames have.
TEST(Kernels, ClassifyRow) {
  struct Layout {
    int bytes_a_pair; // of the plane that holds the first component
    int first_step, chroma_step, chroma_shift;
    int offset[3]; // of the components; chroma in a plane of its own where chroma_own is set
    bool chroma_own;
  };
  constexpr Layout layouts[] = {
      {2, 1, 1, 0, {0, 0, 0}, true},  {2, 1, 1, 1, {0, 0, 0}, true},  {2, 1, 2, 1, {0, 0, 1}, true},
      {2, 1, 2, 1, {0, 1, 0}, true},  {4, 2, 4, 1, {0, 1, 3}, false}, {4, 2, 4, 1, {1, 0, 2}, false},
      {6, 3, 3, 0, {0, 1, 2}, false}, {6, 3, 3, 0, {2, 1, 0}, false}, {8, 4, 4, 0, {0, 1, 2}, false},
      {8, 4, 4, 0, {3, 2, 1}, false}, {8, 4, 4, 0, {1, 2, 3}, false}, {8, 4, 4, 0, {2, 1, 0}, false}};
  on_every_target([&] {
    std::mt19937 random(7);
    ComponentScores scores;
    for (int width = 1; width <= 200; ++width)
      for (int bit_shift = 3; bit_shift <= 7; ++bit_shift) {
        const Layout& l = layouts[random() % std::size(layouts)];
        scores.models = static_cast<int>(random() % 9);
        scores.bit_shift = bit_shift;
        for (auto& model : scores.entries)
          for (auto& component : model)
            for (auto& e : component)
              e = static_cast<std::uint8_t>(random() % 4 == 0 ? 255 : random() % 140);
        const bool at_end = width % 2 == 0;
        const int pairs = (width + 1) / 2;
        const int chroma = l.chroma_shift ? pairs : width;
        const auto first_bytes = static_cast<std::size_t>(
            l.chroma_own ? width : (l.chroma_shift ? pairs * l.bytes_a_pair : width * l.first_step));
        const auto chroma_bytes = static_cast<std::size_t>(l.chroma_own ? chroma * l.chroma_step : 1);
        const Guarded<std::uint8_t> first(first_bytes, at_end), second(chroma_bytes, at_end),
            third(chroma_bytes, at_end), out(static_cast<std::size_t>(width), at_end);
        fill(first, Fill::noise, random);
        fill(second, Fill::noise, random);
        fill(third, Fill::noise, random);
        const bool semi_planar = l.chroma_own && l.chroma_step == 2;
        const PixelRow row{{first.data() + l.offset[0],
                            (l.chroma_own ? second.data() : first.data()) + l.offset[1],
                            (!l.chroma_own ? first.data()
                             : semi_planar ? second.data()
                                           : third.data()) +
                                l.offset[2]},
                           l.first_step,
                           l.chroma_step,
                           l.chroma_shift};
        const std::uint32_t counted = classify_row_by_parts(row, scores, out.data(), width);
        std::uint32_t expected_count = 0;
        for (int x = 0; x < width; ++x) {
          const int c = (x >> l.chroma_shift) * l.chroma_step;
          int least = 255;
          for (int n = 0; n < scores.models; ++n)
            least = std::min(least, scores.entries[n][0][row.component[0][x * l.first_step] >> bit_shift] +
                                        scores.entries[n][1][row.component[1][c] >> bit_shift] +
                                        scores.entries[n][2][row.component[2][c] >> bit_shift]);
          const int expected = least <= score_limit ? 255 : 0;
          expected_count += expected ? 1 : 0;
          ASSERT_EQ(out[static_cast<std::size_t>(x)], expected)
              << "width " << width << " bit shift " << bit_shift << " step " << l.first_step << " at " << x;
        }
        ASSERT_EQ(counted, expected_count);
      }
  });
}

// Three rows of cells between forbidden pages.
struct GuardedCells {
  GuardedCells(int count, bool at_end, Fill how, std::mt19937& random)
      : a(static_cast<std::size_t>(count), at_end), b(static_cast<std::size_t>(count), at_end),
        c(static_cast<std::size_t>(count), at_end) {
    for (auto* row : {&a, &b, &c})
      fill(*row, how, random);
  }
  ComponentRow row() const { return {a.data(), b.data(), c.data()}; }
  Guarded<std::uint8_t> a, b, c;
};

// Runs `check` on every target for all counts up to a few vectors and all fills, at both ends of a page.
template <class Check> void on_every_row(unsigned seed, Check check) {
  on_every_target([&] {
    std::mt19937 random(seed);
    for (int count = 1; count <= 140; ++count)
      for (const Fill how : all_fills) {
        check(count, count % 2 == 0, how, random);
        if (testing::Test::HasFatalFailure())
          return;
      }
  });
}

int floor_shift(std::int64_t value, int bits) {
  const std::int64_t unit = std::int64_t{1} << bits;
  return static_cast<int>((value - ((value % unit) + unit) % unit) / unit);
}

int far_apart(int y, int u, int v) {
  return std::abs(y) + 2 * std::abs(u) + 2 * std::abs(v);
}

std::int32_t between(std::int32_t least, std::int32_t most, std::mt19937& random) {
  return std::uniform_int_distribution<std::int32_t>(least, most)(random);
}

TEST(Kernels, WeighComponents) {
  on_every_row(8, [](int count, bool at_end, Fill how, std::mt19937& random) {
    const GuardedCells in(count, at_end, how, random);
    const Guarded<std::uint8_t> out(static_cast<std::size_t>(count), at_end);
    std::array<std::int32_t, 3> weights;
    for (auto& w : weights)
      w = between(-130000, 130000, random);
    const std::int32_t offset = between(-40000000, 40000000, random);
    if (random() % 2) // as between ranges: one component alone has a weight
      for (std::size_t c = 0, own = random() % 4; c < 3; ++c)
        if (c != own)
          weights[c] = 0;
    weigh_components(in.row(), weights, offset, count, out.data());
    for (std::size_t i = 0; i < out.size(); ++i) {
      const std::int64_t sum = std::int64_t{weights[0]} * in.a[i] + std::int64_t{weights[1]} * in.b[i] +
                               std::int64_t{weights[2]} * in.c[i] + offset;
      ASSERT_EQ(out[i], std::clamp(floor_shift(sum, 16), 0, 255)) << count << " at " << i;
    }
  });
}

TEST(Kernels, AddDifferencesAndBoxes) {
  on_every_row(9, [](int count, bool at_end, Fill how, std::mt19937& random) {
    const auto size = static_cast<std::size_t>(count);
    const Guarded<std::uint8_t> luma(2 * size, at_end);
    const Guarded<std::uint16_t> sums(size, at_end);
    fill(luma, how, random);
    std::vector<int> before(size);
    for (std::size_t i = 0; i < size; ++i)
      sums[i] = static_cast<std::uint16_t>(before[i] = how == Fill::full ? 65535 : between(0, 65535, random));
    add_differences(luma.data(), count, sums.data());
    for (std::size_t i = 0; i < size; ++i)
      ASSERT_EQ(sums[i], (before[i] + std::abs(luma[2 * i] - luma[2 * i + 1])) % 65536)
          << count << " at " << i;

    const int per_cell = 1 << random() % 3, shift = between(0, 4, random), cells = count / per_cell;
    if (cells == 0)
      return;
    const Guarded<std::uint16_t> boxes(static_cast<std::size_t>(cells), at_end);
    for (auto& box : boxes)
      box = 40000;
    const std::uint16_t* columns = sums.data() + (count - cells * per_cell);
    add_boxes(columns, per_cell, shift, cells, boxes.data());
    for (int i = 0; i < cells; ++i) {
      int sum = 0;
      for (int k = 0; k < per_cell; ++k)
        sum += columns[i * per_cell + k];
      ASSERT_EQ(boxes[static_cast<std::size_t>(i)], (40000 + (sum << shift)) % 65536) << count << " at " << i;
    }
  });
}

TEST(Kernels, SumRowsAndLargestSteps) {
  on_every_row(14, [](int count, bool at_end, Fill how, std::mt19937& random) {
    const auto size = static_cast<std::size_t>(count);
    const int rows = between(1, 4, random);
    const Guarded<std::uint8_t> a(size, at_end), b(size, at_end), c(size, at_end), d(size, at_end);
    std::array<const std::uint8_t*, 4> row{a.data(), b.data(), c.data(), d.data()};
    for (const Guarded<std::uint8_t>* one : {&a, &b, &c, &d})
      fill(*one, how, random);
    for (int r = rows; r < 4; ++r)
      row[static_cast<std::size_t>(r)] = nullptr;
    const Guarded<std::uint16_t> sums(size, at_end), steps(size - 1, at_end);
    sum_rows(row, rows, count, sums.data(), steps.data());
    for (std::size_t x = 0; x < size; ++x) {
      int sum = 0, step = 0;
      for (int r = 0; r < rows; ++r) {
        sum += row[static_cast<std::size_t>(r)][x];
        step += x + 1 < size
                    ? std::abs(row[static_cast<std::size_t>(r)][x + 1] - row[static_cast<std::size_t>(r)][x])
                    : 0;
      }
      ASSERT_EQ(sums[x], sum) << count << " at " << x;
      if (x + 1 < size) {
        ASSERT_EQ(steps[x], step) << count << " at " << x;
      }
    }

    const int per_cell = 1 << random() % 3, cells = (count - 1) / per_cell;
    const Guarded<std::uint16_t> most(static_cast<std::size_t>(cells), at_end);
    for (std::size_t x = 0; x < size; ++x)
      sums[x] = static_cast<std::uint16_t>(between(0, 65535, random));
    const std::uint16_t* columns = sums.data() + (count - 1 - cells * per_cell);
    largest_steps(columns, per_cell, cells, most.data());
    for (int i = 0; i < cells; ++i) {
      int largest = 0;
      for (int k = i * per_cell; k < (i + 1) * per_cell; ++k)
        largest = std::max(largest, std::abs(columns[k + 1] - columns[k]));
      ASSERT_EQ(most[static_cast<std::size_t>(i)], largest) << count << " at " << i;
    }
  });
}

TEST(Kernels, WeighUpright) {
  on_every_row(15, [](int count, bool at_end, Fill, std::mt19937& random) {
    const auto size = static_cast<std::size_t>(count);
    const Guarded<std::int16_t> coherence(size, at_end), score(size, at_end);
    const Guarded<std::uint16_t> contrast(size, at_end);
    const Guarded<std::uint8_t> ignored(size, at_end);
    std::vector<int> before(size);
    for (std::size_t i = 0; i < size; ++i) {
      coherence[i] = static_cast<std::int16_t>(between(-4000, 4000, random));
      contrast[i] = static_cast<std::uint16_t>(between(0, 32, random));
      ignored[i] = random() % 4 == 0;
      score[i] = static_cast<std::int16_t>(before[i] = between(-8000, 8000, random));
    }
    const UprightRule rule{-40, 336, -320, 160, random() % 2 ? 160 : -64};
    weigh_upright(coherence.data(), contrast.data(), ignored.data(), rule, 25, count, score.data());
    for (std::size_t i = 0; i < size; ++i) {
      const std::int64_t full = std::clamp(floor_shift((-40 - coherence[i]) * 336, 8), -320, 160);
      const std::int64_t added = std::min<std::int64_t>(full * contrast[i] / 32, rule.most);
      ASSERT_EQ(score[i], ignored[i] ? before[i] : floor_shift(before[i] * 25, 5) + added)
          << count << " at " << i;
    }
  });
}

TEST(Kernels, ColorSteps) {
  on_every_row(10, [](int count, bool at_end, Fill how, std::mt19937& random) {
    const GuardedCells a(count, at_end, how, random), b(count, at_end, all_fills[random() % 5], random);
    const Guarded<std::uint16_t> out(static_cast<std::size_t>(count), at_end);
    const int gain = count % 3 ? between(1, 4000, random) : (1 << 20) - 1,
              limit = count % 5 ? between(0, 2000, random) : 65535;
    color_steps(a.row(), b.row(), gain, limit, count, out.data());
    for (std::size_t i = 0; i < out.size(); ++i) {
      const std::int64_t far = far_apart(a.a[i] - b.a[i], a.b[i] - b.b[i], a.c[i] - b.c[i]);
      ASSERT_EQ(out[i], std::min<std::int64_t>(far * gain / 256, limit)) << count << " at " << i;
    }
  });
}

TEST(Kernels, FollowAndSmoothRow) {
  on_every_row(11, [](int count, bool at_end, Fill how, std::mt19937& random) {
    const auto size = static_cast<std::size_t>(count);
    const GuardedCells cells(count, at_end, how, random);
    const Guarded<std::uint8_t> ignored(size, at_end);
    const Guarded<std::int8_t> penalty(size, at_end);
    const Guarded<std::int32_t> ry(size, at_end), ru(size, at_end), rv(size, at_end), smooth(size, at_end);
    for (std::size_t i = 0; i < size; ++i) {
      ignored[i] = random() % 4 == 0;
      // Near the cell, or anywhere.
      const bool near = random() % 2;
      ry[i] = near ? 16 * cells.a[i] + between(-99, 99, random) : between(0, 4080, random);
      ru[i] = near ? 16 * cells.b[i] + between(-99, 99, random) : between(0, 4080, random);
      rv[i] = near ? 16 * cells.c[i] + between(-99, 99, random) : between(0, 4080, random);
    }
    const std::vector<std::int32_t> y(ry.begin(), ry.end()), u(ru.begin(), ru.end()), v(rv.begin(), rv.end());
    const FollowRule rule{count % 7 ? between(100, 4000, random) : 65535, 28, count % 2 ? 44 : 127, 48};
    follow_row(cells.row(), ignored.data(), rule, {ry.data(), ru.data(), rv.data()}, count, penalty.data());
    for (std::size_t i = 0; i < size; ++i) {
      const int dy = 16 * cells.a[i] - y[i], du = 16 * cells.b[i] - u[i], dv = 16 * cells.c[i] - v[i];
      const auto far = static_cast<int>(std::int64_t{far_apart(dy, du, dv)} * rule.gain / 4096);
      ASSERT_EQ(penalty[i], std::clamp(floor_shift(far - 28, 1), 0, rule.most)) << count << " at " << i;
      const bool follows = far < 48 && !ignored[i];
      ASSERT_EQ(ry[i], y[i] + (follows ? floor_shift(dy, 2) : 0)) << count << " at " << i;
      ASSERT_EQ(ru[i], u[i] + (follows ? floor_shift(du, 2) : 0)) << count << " at " << i;
      ASSERT_EQ(rv[i], v[i] + (follows ? floor_shift(dv, 2) : 0)) << count << " at " << i;
    }
    smooth_row(ry.data(), count, smooth.data());
    for (int i = 0; i < count; ++i) {
      const auto at = [&](int k) { return ry[static_cast<std::size_t>(std::clamp(k, 0, count - 1))]; };
      ASSERT_EQ(smooth[static_cast<std::size_t>(i)], floor_shift(at(i - 1) + 2 * at(i) + at(i + 1), 2))
          << count << " at " << i;
    }
  });
}

TEST(Kernels, CompareLooks) {
  on_every_row(13, [](int count, bool at_end, Fill, std::mt19937& random) {
    const auto size = static_cast<std::size_t>(count);
    struct Row {
      explicit Row(std::size_t count, bool at_end)
          : y(count, at_end), u(count, at_end), v(count, at_end), rough(count, at_end),
            ignored(count, at_end) {}
      LookRow row() const { return {{y.data(), u.data(), v.data(), rough.data()}, ignored.data()}; }
      Guarded<std::int16_t> y, u, v, rough;
      Guarded<std::uint8_t> ignored;
    };
    const Row a(size, at_end), b(size, at_end);
    const Guarded<std::uint8_t> alike(size, at_end);
    const LookLimits limits{
        static_cast<std::int16_t>(between(1, 32, random)), static_cast<std::int16_t>(between(0, 40, random)),
        static_cast<std::int16_t>(between(0, 700, random)), static_cast<std::uint8_t>(random() % 2)};
    const int dark = between(0, 100, random);
    for (std::size_t i = 0; i < size; ++i) {
      const bool far = random() % 4 == 0;
      const auto pair = [&](const Guarded<std::int16_t>& first, const Guarded<std::int16_t>& second,
                            int least, int most, int apart) {
        first[i] = static_cast<std::int16_t>(between(least, most, random));
        const int other = far ? between(least, most, random) : first[i] + between(-apart, apart, random);
        second[i] = static_cast<std::int16_t>(std::clamp(other, least, most));
      };
      pair(a.y, b.y, 0, 1020, 40);
      pair(a.u, b.u, 0, 1020, 12);
      pair(a.v, b.v, 0, 1020, 12);
      pair(a.rough, b.rough, -8000, 20000, 500);
      a.ignored[i] = random() % 8 == 0;
      b.ignored[i] = random() % 8 == 0;
    }
    compare_looks(a.row(), b.row(), limits, dark, count, alike.data());
    for (std::size_t i = 0; i < size; ++i) {
      const bool same = limits.luma * std::abs(a.y[i] - b.y[i]) <= a.y[i] + b.y[i] + dark &&
                        std::abs(a.u[i] - b.u[i]) + std::abs(a.v[i] - b.v[i]) <= limits.chroma &&
                        std::abs(a.rough[i] - b.rough[i]) <= limits.rough;
      ASSERT_EQ(alike[i], a.ignored[i] || b.ignored[i] ? limits.if_ignored : same) << count << " at " << i;
    }
  });
}

TEST(Kernels, PassDistancesAndRaisePenalties) {
  on_every_row(14, [](int count, bool at_end, Fill, std::mt19937& random) {
    const auto size = static_cast<std::size_t>(count);
    const Guarded<std::int32_t> from(size, at_end), to(size, at_end);
    const Guarded<std::uint16_t> steps(size, at_end);
    const Guarded<std::uint8_t> ignored_from(size, at_end), ignored_to(size, at_end);
    const Guarded<std::int8_t> penalty(size, at_end);
    for (std::size_t i = 0; i < size; ++i) {
      from[i] = random() % 3 ? between(0, 3000, random) : 1 << 20;
      to[i] = random() % 3 ? between(0, 3000, random) : 1 << 20;
      steps[i] = static_cast<std::uint16_t>(random() % 5 ? between(0, 1023, random) : (1 << 15) - 1);
      ignored_from[i] = random() % 6 == 0;
      ignored_to[i] = random() % 6 == 0;
      penalty[i] = static_cast<std::int8_t>(between(0, 127, random));
    }
    const std::vector<std::int32_t> before(to.begin(), to.end());
    const std::vector<std::int8_t> least(penalty.begin(), penalty.end());
    const int free = between(0, 30, random), most = between(0, 127, random), shift = between(1, 4, random);
    pass_distances(from.data(), steps.data(), ignored_from.data(), ignored_to.data(), free, count, to.data());
    for (std::size_t i = 0; i < size; ++i) {
      const int price = ignored_from[i] || ignored_to[i] ? 0 : std::max(steps[i] - free, 0);
      ASSERT_EQ(to[i], std::min(before[i], from[i] + price)) << count << " at " << i;
    }
    const std::vector<std::int32_t> distances(to.begin(), to.end());
    raise_penalties(to.data(), free, most, shift, count, penalty.data());
    for (std::size_t i = 0; i < size; ++i) {
      ASSERT_EQ(penalty[i], std::max<int>(least[i], std::min(distances[i] - free, most)))
          << count << " at " << i;
      ASSERT_EQ(to[i], distances[i] - floor_shift(distances[i], shift)) << count << " at " << i;
    }
  });
}

TEST(Kernels, AverageRowsAndColumns) {
  on_every_row(15, [](int width, bool at_end, Fill how, std::mt19937& random) {
    const int height = between(2, 12, random), reach = between(1, 15, random),
              stride = width + between(0, 3, random);
    // Of the cells up to `reach` from the one `at` of `number` in a line, `step` elements apart.
    const auto mean = [&](const std::uint8_t* line, int step, int at, int number) {
      const int first = std::max(at - reach, 0), end = std::min(at + reach + 1, number), count = end - first;
      std::int64_t sum = 0;
      for (int k = first; k < end; ++k)
        sum += line[k * step];
      return std::min<std::int64_t>((sum * ((65536 + count / 2) / count) + 32768) / 65536, 255);
    };
    const auto size = static_cast<std::size_t>(width * height);
    const Guarded<std::uint8_t> in(static_cast<std::size_t>(stride * (height - 1) + width), at_end),
        out(size, at_end);
    const Guarded<std::uint32_t> row_sums(static_cast<std::size_t>(width), at_end),
        column_sums(static_cast<std::size_t>(2 * (width + reach) + 1), at_end);
    fill(in, how, random);
    average_rows(in.data(), stride, width, height, reach, row_sums.data(), out.data());
    for (int i = 0; i < height; ++i)
      for (int j = 0; j < width; ++j)
        ASSERT_EQ(out[static_cast<std::size_t>(i * width + j)], mean(in.data() + j, stride, i, height))
            << width << " at " << i << ' ' << j;
    const std::vector<std::uint8_t> rows(out.begin(), out.end());
    average_columns(out.data(), width, height, reach, column_sums.data());
    for (int i = 0; i < height; ++i)
      for (int j = 0; j < width; ++j)
        ASSERT_EQ(out[static_cast<std::size_t>(i * width + j)], mean(rows.data() + i * width, 1, j, width))
            << width << " at " << i << ' ' << j;
  });
}

TEST(Kernels, StrongestEdges) {
  on_every_target([] {
    std::mt19937 random(12);
    for (int round = 0; round < 2000; ++round) {
      Strip strip;
      for (auto& row : strip)
        for (auto& component : row)
          fill(component, all_fills[round % 5], random);
      std::array<std::array<std::int32_t, 3>, 3> matrix;
      for (auto& row : matrix)
        for (auto& m : row)
          m = between(-130000, 130000, random);
      const int rows = between(0, strip_rows, random);
      const Guarded<std::uint8_t> last(strip_columns, true), best(strip_columns, round % 2);
      for (auto& l : last)
        l = static_cast<std::uint8_t>(between(0, std::max(rows - 1, 0), random));
      strongest_edges(strip, matrix, rows, last.data(), best.data());
      for (std::size_t i = 0; i < strip_columns; ++i) {
        int expected = 0;
        std::int64_t most = -1;
        for (std::size_t row = 1; row <= last[i]; ++row) {
          std::array<std::int64_t, 3> mapped{};
          for (std::size_t k = 0; k < 3; ++k) {
            std::int64_t sum = 0;
            for (std::size_t c = 0; c < 3; ++c)
              sum += std::int64_t{matrix[k][c]} * (strip[row][c][i] - strip[row - 1][c][i]);
            mapped[k] = std::abs(floor_shift(sum, 8));
          }
          const std::int64_t strength = mapped[0] + 2 * mapped[1] + 2 * mapped[2];
          if (strength > most) {
            most = strength;
            expected = static_cast<int>(row);
          }
        }
        ASSERT_EQ(best[i], expected) << "round " << round << " column " << i;
      }
    }
  });
}

// --- motion ---

std::vector<std::uint8_t> noise_picture(int width, int height, std::uint32_t seed) {
  std::mt19937 random(seed);
  std::vector<std::uint8_t> pixels(static_cast<std::size_t>(width) * height);
  for (std::uint8_t& pixel : pixels)
    pixel = static_cast<std::uint8_t>(random() % 4 == 0 ? random() % 2 * 255 : random() % 256);
  return pixels;
}

TEST(Kernels, HighPassAndMeanOfQuarters) {
  on_every_target([] {
    for (const int width : {13, 31, 64, 101})
      for (const int radius : {5, 8}) {
        const int height = 19, gain = radius == 5 ? 2 : 1, side = 2 * radius + 1;
        auto in = noise_picture(width, height, 7);
        std::fill_n(in.begin(), in.size() / 2, std::uint8_t{255}); // the largest sums
        std::vector<std::uint8_t> out(in.size());
        std::vector<std::uint16_t> work(static_cast<std::size_t>(3 * (width + 2 * radius)));
        high_pass(in.data(), width, width, height, radius, gain, out.data(), work.data());
        for (int y = 0; y < height; ++y)
          for (int x = 0; x < width; ++x) {
            int sum = 0, halves = 0;
            for (int dx = -radius; dx <= radius; ++dx) {
              int column = 0;
              for (int dy = -radius; dy <= radius; ++dy)
                column += in[static_cast<std::size_t>(std::clamp(y + dy, 0, height - 1) * width +
                                                      std::clamp(x + dx, 0, width - 1))];
              sum += column;
              halves += column / 2;
            }
            const int pixels = side * side, mean = (halves * ((4 * 65536 + pixels / 2) / pixels)) >> 17;
            const auto at = static_cast<std::size_t>(y * width + x);
            ASSERT_EQ(out[at], std::clamp(128 + (in[at] - mean) * gain, 1, 255)) << x << ' ' << y;
            const double lost = static_cast<double>(sum) / pixels - mean;
            ASSERT_GE(lost, -1e-9);
            ASSERT_LT(lost, 1.2);
          }
        std::vector<std::uint8_t> means(static_cast<std::size_t>(width / 4));
        mean_of_quarters(in.data(), width, width / 4, means.data());
        for (int x = 0; x < width / 4; ++x) {
          int sum = 8;
          for (int k = 0; k < 16; ++k)
            sum += in[static_cast<std::size_t>(k / 4 * width + 4 * x + k % 4)];
          ASSERT_EQ(means[static_cast<std::size_t>(x)], sum / 16);
        }
      }
  });
}

TEST(Kernels, Steepest) {
  on_every_target([] {
    for (const int width : {2, 3, 17, 40, 77}) {
      const auto rows = noise_picture(width, 4, 11);
      std::vector<std::uint8_t> ground(static_cast<std::size_t>(width));
      for (int x = 0; x < width; ++x)
        ground[static_cast<std::size_t>(x)] = x % 5 != 0;
      std::vector<std::uint16_t> keys(static_cast<std::size_t>(width), 700);
      steepest(rows.data(), rows.data() + width, rows.data() + 2 * width, ground.data(), width, 9,
               keys.data());
      for (int x = 0; x < width; ++x) {
        int wanted = 700;
        if (x > 0 && x < width - 1 && x % 5 != 0) {
          const auto at = [&](int u, int v) { return int{rows[static_cast<std::size_t>(v * width + u)]}; };
          const int slope = std::abs(at(x + 1, 1) - at(x - 1, 1)) + std::abs(at(x, 2) - at(x, 0));
          wanted = std::max(wanted, std::min(slope, 255) * 16 + 9);
        }
        ASSERT_EQ(keys[static_cast<std::size_t>(x)], wanted) << x << " of " << width;
      }
    }
  });
}

TEST(Kernels, WarpRows) {
  on_every_target([] {
    const int width = 61, height = 23, segments = 3, rows = 4;
    const auto in = noise_picture(width, height, 3);
    Guarded<std::uint8_t> source(in.size(), true);
    std::copy(in.begin(), in.end(), &source[0]);
    std::mt19937 random(4);
    const auto between = [&](int least, int most) {
      return least + static_cast<int>(random() % static_cast<unsigned>(most - least));
    };
    for (int trial = 0; trial < 400; ++trial) {
      // Inside, across every rim, and far outside.
      const int room = trial % 3 == 2 ? 4000 : trial % 3 == 1 ? 30 : 0;
      std::vector<std::int32_t> nodes;
      if (trial % 2 == 0)
        for (int k = 0; k < rows * (segments + 1); ++k)
          for (const int size : {width, height})
            nodes.push_back(between(-room * 256, (size + room) * 256) * 256);
      else // as in a drive: scaled and turned a little, from the first to the last row
        for (int y = 0; y < rows; ++y) {
          const int left = between(-9, 30) * 65536 + between(0, 65536), step = between(40000, 140000),
                    slope = between(-20000, 20000), row = between(-1, height + 1) * 65536 + between(0, 65536);
          for (int k = 0; k <= segments; ++k) {
            nodes.push_back(left + 16 * k * step);
            nodes.push_back(row + 16 * k * slope);
          }
        }
      std::vector<std::uint8_t> out(static_cast<std::size_t>(rows * 16 * segments));
      warp_rows({&source[0], width, height}, nodes.data(), segments, rows, out.data(), 16 * segments);
      for (int y = 0; y < rows; ++y)
        for (int x = 0; x < 16 * segments; ++x) {
          const std::int32_t* node = nodes.data() + 2 * (y * (segments + 1) + x / 16);
          const int u = node[0] + (node[2] - node[0]) / 16 * (x % 16),
                    v = node[1] + (node[3] - node[1]) / 16 * (x % 16);
          int wanted = 0;
          if (u >= 0 && v >= 0 && u >> 16 < width - 1 && v >> 16 < height - 1) {
            const auto at = [&](int du, int dv) {
              return int{in[static_cast<std::size_t>(((v >> 16) + dv) * width + (u >> 16) + du)]};
            };
            const int fu = (u >> 9) % 128, fv = (v >> 9) % 128;
            wanted = ((at(0, 0) * (128 - fu) + at(1, 0) * fu) * (128 - fv) +
                      (at(0, 1) * (128 - fu) + at(1, 1) * fu) * fv + 8192) /
                     16384;
          }
          ASSERT_EQ(out[static_cast<std::size_t>(y * 16 * segments + x)], wanted)
              << x << ' ' << y << ' ' << trial;
        }
    }
  });
}

TEST(Kernels, EvidenceOfSums) {
  on_every_target([] {
    std::mt19937 random(8);
    for (int count = 0; count < 70; ++count) {
      const auto size = static_cast<std::size_t>(count);
      Guarded<std::int16_t> sums(4 * size, true), evidence(size, true);
      for (std::size_t i = 0; i < size; ++i) {
        const std::array<int, 5> rims{0, 1, -1, 32767, -32767};
        const int noise = static_cast<int>(random() % 65535) - 32767,
                  frames = static_cast<int>(random() % 32768);
        sums[4 * i] = static_cast<std::int16_t>(i % 3 == 0 ? rims[random() % rims.size()] : noise);
        sums[4 * i + 1] = static_cast<std::int16_t>(i % 5 == 0 ? frames / 4 : frames);
        sums[4 * i + 2] = sums[4 * i + 3] = static_cast<std::int16_t>(random());
      }
      evidence_of_sums(sums.data(), count, evidence.data());
      for (std::size_t i = 0; i < size; ++i)
        ASSERT_EQ(evidence[i], sums[4 * i] * 256 / std::max<int>(sums[4 * i + 1], 8192))
            << i << " of " << count;
    }
  });
}

// What PointMap promises, written down directly.
struct Position {
  std::int64_t u, v;
};
Position mapped(const PointMap& map, std::int64_t a, std::int64_t b) {
  const std::int64_t w = (map.across_w * a + map.below_w * b + map.w_offset) >> 16;
  if (w < 1 << 18)
    return {-map.outside, -map.outside};
  const auto place = [&](std::int64_t by_a, std::int64_t by_b, std::int64_t from, std::int64_t middle) {
    const std::int64_t limit = std::int64_t{1} << 32;
    const std::int64_t at =
        std::clamp((by_a * a * 128 + by_b * b + from) >> 12, -limit, limit) * ((std::int64_t{1} << 48) / w);
    return std::clamp<std::int64_t>(middle + (at >> 36), -map.outside, map.outside);
  };
  return {place(map.g0, map.g1, map.x_offset, map.middle), place(map.g3, map.g4, map.y_offset, map.line)};
}

TEST(Kernels, PointDifferences) {
  on_every_target([] {
    const int width = 61, height = 23;
    const auto in = noise_picture(width, height, 3);
    Guarded<std::uint8_t> source(in.size(), true);
    std::copy(in.begin(), in.end(), &source[0]);
    std::mt19937 random(5);
    const auto within = [&](std::int64_t limit) {
      return static_cast<std::int64_t>(random() % static_cast<std::uint64_t>(2 * limit + 1)) - limit;
    };
    for (int trial = 0; trial < 300; ++trial) {
      // Motions as they are, some that throw points far out or behind the camera, and some beyond 32 bits.
      const std::int64_t one = 1 << 24, wild = trial % 4 == 3 ? 64 * one : one / 16, focal = 50;
      const auto near_to = [&](std::int64_t value) {
        return std::clamp<std::int64_t>(value + within(std::min<std::int64_t>(wild, 1 << 30)), -64 * one,
                                        64 * one);
      };
      const std::int64_t perspective = trial % 8 == 7 ? std::int64_t{1} << 26 : trial % 2 ? one : one / 8;
      const PointMap map{near_to(one),
                         near_to(0),
                         near_to(0),
                         near_to(one),
                         near_to(0) * focal * 256,
                         near_to(0) * focal * 256,
                         within(perspective) * 32768 / focal,
                         within(perspective) * 256 / focal,
                         near_to(one) * 65536,
                         (width - 1) * 128,
                         5 * 256,
                         1 << 20};
      const int count = static_cast<int>(random() % 40);
      const auto room = static_cast<std::size_t>(count);
      Guarded<std::int32_t> across(room, true), below(room, true), values(room, true), out(room, true);
      for (std::size_t i = 0; i < room; ++i) {
        across[i] = static_cast<std::int32_t>(within(width));
        below[i] = static_cast<std::int32_t>(within(height * 256));
        values[i] = static_cast<std::int32_t>(random() % 65281);
      }
      const int inside = point_differences({source.data(), width, height}, map,
                                           {across.data(), below.data(), values.data(), count}, out.data());
      int wanted_inside = 0;
      for (std::size_t i = 0; i < room; ++i) {
        std::int32_t wanted = no_difference;
        const Position p = mapped(map, across[i], below[i]);
        if (p.u >= 0 && p.v >= 0 && p.u / 256 < width - 1 && p.v / 256 < height - 1) {
          const auto at = [&](std::int64_t du, std::int64_t dv) {
            return std::int64_t{in[static_cast<std::size_t>((p.v / 256 + dv) * width + p.u / 256 + du)]};
          };
          const std::int64_t fu = p.u % 256, fv = p.v % 256;
          wanted = static_cast<std::int32_t>(((at(0, 0) * (256 - fu) + at(1, 0) * fu) * (256 - fv) +
                                              (at(0, 1) * (256 - fu) + at(1, 1) * fu) * fv + 128) /
                                             256) -
                   values[i];
          ++wanted_inside;
        }
        ASSERT_EQ(out[i], wanted) << trial << ' ' << i;
      }
      ASSERT_EQ(inside, wanted_inside) << trial;
      const Guarded<std::int32_t> positions(2 * room, true);
      const auto row = static_cast<std::int32_t>(within(height * 256));
      map_row(map, across.data(), row, count, positions.data());
      for (std::size_t i = 0; i < room; ++i) {
        const Position p = mapped(map, across[i], row);
        ASSERT_EQ(positions[2 * i], p.u) << trial << ' ' << i;
        ASSERT_EQ(positions[2 * i + 1], p.v) << trial << ' ' << i;
      }
    }
  });
}

TEST(Kernels, CountBelow) {
  on_every_target([] {
    std::mt19937 random(8);
    for (int count = 0; count <= 70; ++count)
      for (const std::int32_t limit : {32, 256 << 5}) {
        const Guarded<std::int32_t> differences(static_cast<std::size_t>(count), true);
        int wanted = 0;
        for (std::int32_t& difference : differences) {
          difference = random() % 8 == 0 ? no_difference : static_cast<std::int32_t>(random() % 131) - 65;
          difference = random() % 4 == 0 ? (random() % 2 ? limit : -limit) : difference;
          wanted += std::abs(difference) < limit;
        }
        ASSERT_EQ(count_below(differences.data(), count, limit), wanted) << count << ' ' << limit;
      }
  });
}

// The offsets of hypotheses along a translation and across it, and those that are not possible.
TEST(Kernels, PlaceHypotheses) {
  on_every_target([] {
    std::mt19937 random(9);
    for (int trial = 0; trial < 200; ++trial) {
      HypothesisShifts shifts{};
      for (std::size_t k = 0; k < most_offsets; ++k) {
        shifts.along[k] = static_cast<std::int32_t>(random() % 81) - 40;
        shifts.aside[k] = static_cast<std::int32_t>(random() % 7) - 3;
        shifts.least_reach[k] = static_cast<std::int32_t>(random() % 1600);
      }
      const int x = static_cast<int>(random() % 32769) - 16384,
                y = static_cast<int>(random() % 32769) - 16384, reach = static_cast<int>(random() % 1600),
                stride = 480 + trial;
      std::array<std::int32_t, most_offsets> offsets{};
      place_hypotheses(shifts, x, y, reach, 20, 8, stride, offsets.data());
      for (std::size_t k = 0; k < most_offsets; ++k) {
        // Halves of a pixel, rounded to pixels with halves up.
        const double along = shifts.along[k] / 2.0, aside = shifts.aside[k] / 2.0;
        const auto column = static_cast<int>(std::floor((along * x - aside * y) / 16384 + 0.5)),
                   row = static_cast<int>(std::floor((along * y + aside * x) / 16384 + 0.5));
        const bool possible = row >= -20 && row <= 8 && shifts.least_reach[k] <= reach;
        ASSERT_EQ(offsets[k], possible ? row * stride + column : no_offset) << trial << ' ' << k;
      }
    }
  });
}

TEST(Kernels, FitSums) {
  on_every_target([] {
    std::mt19937 random(6);
    std::array<std::int32_t, 65> table{};
    for (int k = 0; k < 64; ++k)
      table[static_cast<std::size_t>(k)] = 256 - 4 * k;
    for (const int count : {0, 1, 7, 8, 15, 16, 17, 31, 32, 33, 100}) {
      const std::size_t room =
          static_cast<std::size_t>(count + points_together - 1) / points_together * points_together;
      Guarded<std::int32_t> derivatives(7 * room, true), differences(room, true), weights(room, true);
      for (std::int32_t& derivative : derivatives)
        derivative = static_cast<std::int32_t>(random() % 8388607) - 4194303;
      for (std::int32_t& difference : differences)
        difference = random() % 8 == 0 ? no_difference : static_cast<std::int32_t>(random() % 131073) - 65536;
      const std::int32_t per_index = count % 2 ? 43 : 1365;
      fit_weights(differences.data(), count, per_index, table.data(), weights.data());
      for (std::size_t i = 0; i < room; ++i) {
        const std::int64_t index = std::int64_t{std::abs(differences[i])} * per_index / 65536;
        const bool counts =
            i < static_cast<std::size_t>(count) && differences[i] != no_difference && index < 64;
        ASSERT_EQ(weights[i], counts ? table[static_cast<std::size_t>(index)] : 0) << count << ' ' << i;
      }
      for (const int unknowns : {6, 7}) {
        std::array<std::int64_t, 28> left{};
        std::array<std::int64_t, 7> right{};
        fit_sums({derivatives.data(), static_cast<std::ptrdiff_t>(room), weights.data(), differences.data(),
                  count},
                 unknowns, left.data(), right.data());
        std::size_t k = 0;
        for (std::size_t row = 0; row < static_cast<std::size_t>(unknowns); ++row) {
          std::int64_t explained = 0;
          for (std::size_t i = 0; i < room; ++i)
            explained += std::int64_t{weights[i]} * derivatives[row * room + i] * differences[i];
          ASSERT_EQ(right[row], explained) << count << ' ' << row;
          for (std::size_t column = 0; column <= row; ++column, ++k) {
            std::int64_t sum = 0;
            for (std::size_t i = 0; i < room; ++i)
              sum += std::int64_t{weights[i]} * derivatives[row * room + i] * derivatives[column * room + i];
            ASSERT_EQ(left[k], sum) << count << ' ' << row << ' ' << column;
          }
        }
        for (; k < left.size(); ++k)
          ASSERT_EQ(left[k], 0);
      }
    }
  });
}

TEST(Kernels, CompareCells) {
  on_every_target([] {
    const int width = 48, height = 20, plane = 7;
    const auto frame = noise_picture(width, height, 5);
    auto warped = noise_picture(width, height, 6);
    for (std::uint8_t& pixel : warped)
      pixel = std::max<std::uint8_t>(pixel, 1);
    for (int hole = -1; hole < 4; ++hole) {
      if (hole >= 0)
        warped[static_cast<std::size_t>((8 + hole) * width + 16 + 5 * hole)] = 0; // in cell `hole`
      std::array<std::int32_t, most_offsets> offsets{};
      for (int k = 0; k < most_offsets; ++k)
        offsets[static_cast<std::size_t>(k)] = k % 6 == 5 ? no_offset : (k % 5 - 2) * width + k - 7;
      offsets[0] = 0;
      std::vector<std::uint16_t> sums(static_cast<std::size_t>(plane * most_offsets), 7);
      std::array<std::uint8_t, 4> whole{};
      compare_cells(&frame[8 * width + 16], width, &warped[8 * width + 16], width, offsets.data(),
                    sums.data(), plane, whole.data());
      for (int c = 0; c < plane; ++c) {
        if (c < 4) {
          EXPECT_EQ(whole[static_cast<std::size_t>(c)], c > hole) << c << ' ' << hole;
        }
        for (int k = 0; k < most_offsets; ++k) {
          const std::int32_t offset = offsets[static_cast<std::size_t>(k)];
          int wanted = c >= 4 ? 7 : offset == no_offset ? 640 : 0;
          for (int p = 0; p < 16 && c < 4 && offset != no_offset; ++p) {
            const int at = (8 + p / 4) * width + 16 + 4 * c + p % 4;
            wanted += std::min(
                std::abs(frame[static_cast<std::size_t>(at)] - warped[static_cast<std::size_t>(at + offset)]),
                40);
          }
          ASSERT_EQ(sums[static_cast<std::size_t>(k * plane + c)], wanted) << k << ' ' << c;
        }
      }
    }
  });
}

TEST(Kernels, WindowCosts) {
  on_every_target([] {
    const HypothesisOrder order{1, 6, 6, 7, 15};
    std::mt19937 random(8);
    for (const int columns : {1, 3, 16, 45}) {
      const int plane = columns + 2;
      std::vector<std::uint16_t> rows(static_cast<std::size_t>(3 * most_offsets * plane));
      for (std::uint16_t& sum : rows)
        sum = static_cast<std::uint16_t>(random() % 3 == 0 ? 640 : random() % 641);
      const auto count = static_cast<std::size_t>(columns);
      std::vector<std::uint16_t> ground(count), control(count), even(count), standing(count), which(count),
          work(count + 2);
      const auto row = [&](int i) { return rows.data() + i * most_offsets * plane; };
      window_costs(row(0), row(1), row(2), columns, plane, order,
                   {ground.data(), control.data(), even.data(), standing.data(), which.data()}, work.data());
      for (int j = 0; j < columns; ++j) {
        std::array<int, most_offsets> costs{};
        for (int k = 0; k < most_offsets; ++k)
          for (int i = 0; i < 3; ++i)
            for (int c = j; c < j + 3; ++c)
              costs[static_cast<std::size_t>(k)] += row(i)[k * plane + c];
        const auto at = static_cast<std::size_t>(j);
        const auto* const best = std::min_element(costs.begin() + 7, costs.begin() + 15);
        ASSERT_EQ(ground[at], costs[0]);
        ASSERT_EQ(control[at], *std::min_element(costs.begin() + 1, costs.begin() + 6));
        ASSERT_EQ(even[at], costs[6]);
        ASSERT_EQ(standing[at], *best);
        ASSERT_EQ(which[at], best - costs.begin() - 7) << j << " of " << columns;
      }
    }
  });
}

TEST(Kernels, MovedSums) {
  on_every_target([] {
    const int columns = 9, rows = 5, keep = 224;
    std::mt19937 random(9);
    std::vector<std::int16_t> sums(4 * columns * rows);
    for (std::int16_t& sum : sums)
      sum = static_cast<std::int16_t>(random());
    for (int trial = 0; trial < 300; ++trial) {
      std::vector<std::int32_t> nodes;
      for (int k = 0; k < 2 * (columns / 4 + 2); ++k) // from two cells outside to two cells outside
        nodes.push_back(static_cast<int>(random() % (13 * 1024)) - 2 * 1024);
      std::vector<std::int16_t> out(4 * columns, 99);
      moved_sums({sums.data(), columns, rows}, nodes.data(), columns, keep, out.data());
      for (int j = 0; j < columns; ++j) {
        const auto node = [&](int i) { return nodes[static_cast<std::size_t>(j / 4 * 2 + i)]; };
        const int u = node(0) + (node(2) - node(0)) * (j % 4) / 4,
                  v = node(1) + (node(3) - node(1)) * (j % 4) / 4;
        const double x = std::floor(u / 16.0) / 64, y = std::floor(v / 16.0) / 64; // cells
        const int left = static_cast<int>(std::floor(x)), top = static_cast<int>(std::floor(y));
        for (int i = 0; i < 4; ++i) {
          double wanted = 0;
          if (left >= -1 && left < columns && top >= -1 && top < rows)
            for (const int dy : {0, 1})
              for (const int dx : {0, 1}) {
                const int c = std::clamp(left + dx, 0, columns - 1), r = std::clamp(top + dy, 0, rows - 1);
                wanted += (dx ? x - left : 1 - x + left) * (dy ? y - top : 1 - y + top) *
                          sums[static_cast<std::size_t>(4 * (r * columns + c) + i)];
              }
          wanted = std::floor((std::floor(wanted + 0.5) * keep + 128) / 256);
          ASSERT_EQ(out[static_cast<std::size_t>(4 * j + i)], wanted) << j << ' ' << i << ' ' << trial;
        }
      }
    }
  });
}

TEST(Kernels, AddBlocksAndDoubleEach) {
  on_every_target([] {
    std::mt19937 random(31);
    for (std::size_t blocks = 1; blocks <= 70; ++blocks)
      for (const bool at_end : {false, true}) {
        const Guarded<std::uint8_t> cells(2 * blocks, at_end), ground(2 * blocks, at_end);
        const Guarded<std::uint32_t> sums(blocks, at_end), squares(blocks, at_end), counts(blocks, at_end);
        const Guarded<std::int16_t> in(blocks, at_end), twice(2 * blocks, at_end);
        fill(cells, all_fills[blocks % 5], random);
        for (std::uint8_t& is_ground : ground)
          is_ground = blocks % 4 == 0 || random() % 3 > 0;
        for (std::size_t b = 0; b < blocks; ++b) {
          sums[b] = static_cast<std::uint32_t>(b);
          squares[b] = ~std::uint32_t{0};
          counts[b] = 7;
          in[b] = static_cast<std::int16_t>(random());
        }
        add_blocks(cells.data(), ground.data(), static_cast<int>(blocks), sums.data(), squares.data());
        add_blocks(ground.data(), ground.data(), static_cast<int>(blocks), counts.data(), nullptr);
        double_each(in.data(), static_cast<int>(blocks), twice.data());
        for (std::size_t b = 0; b < blocks; ++b) {
          const int left = ground[2 * b] * cells[2 * b], right = ground[2 * b + 1] * cells[2 * b + 1];
          ASSERT_EQ(sums[b], b + static_cast<std::size_t>(left + right)) << b << " of " << blocks;
          ASSERT_EQ(squares[b], static_cast<std::uint32_t>(left * left + right * right - 1));
          ASSERT_EQ(counts[b], 7u + ground[2 * b] + ground[2 * b + 1]);
          ASSERT_EQ(twice[2 * b], in[b]);
          ASSERT_EQ(twice[2 * b + 1], in[b]);
        }
      }
  });
}

TEST(Kernels, CountBoxes) {
  on_every_target([] {
    std::mt19937 random(36);
    for (int count = 1; count <= 70; ++count)
      for (const bool at_end : {false, true}) {
        const int reach = 2 + count % 9;
        const auto blocks = static_cast<std::size_t>(count), r = static_cast<std::size_t>(reach);
        const Guarded<std::uint32_t> counts(blocks + 2 * r + 1, at_end), cells(blocks, at_end),
            whole(blocks, at_end), lefts(blocks, at_end), rights(blocks, at_end);
        // Few cells, and more than have an inverse that is looked up.
        const unsigned most = count % 3 == 0 ? 4 : count % 3 == 1 ? 900 : 4000;
        counts[0] = static_cast<std::uint32_t>(random()); // sums run over
        for (std::size_t p = 1; p < counts.size(); ++p)
          counts[p] = counts[p - 1] + random() % (random() % 8 ? most + 1 : 2);
        const std::uint32_t least = 1 + random() % (most * static_cast<unsigned>(reach) / 2);
        count_boxes(counts.data(), least, count,
                    {cells.data(), whole.data(), lefts.data(), rights.data(), reach});
        for (std::size_t b = 0; b < blocks; ++b) {
          const std::uint32_t left = counts[b + r] - counts[b],
                              right = counts[b + 2 * r + 1] - counts[b + r + 1],
                              all = counts[b + 2 * r + 1] - counts[b];
          const bool known = left >= least && right >= least;
          ASSERT_EQ(cells[b], all) << b << " of " << count;
          ASSERT_EQ(whole[b], known ? 16777216 / all : 0) << b << " of " << count;
          ASSERT_EQ(lefts[b], known ? 16777216 / left : 0) << b << " of " << count;
          ASSERT_EQ(rights[b], known ? 16777216 / right : 0) << b << " of " << count;
        }
      }
  });
}

TEST(Kernels, LookUpOctaves) {
  on_every_target([] {
    std::mt19937 random(37);
    const Guarded<std::int16_t> table(octaves_of_table * 256 + 1, true);
    for (std::int16_t& entry : table)
      entry = static_cast<std::int16_t>(random());
    for (int count = 1; count <= 70; ++count)
      for (const bool at_end : {false, true}) {
        const auto size = static_cast<std::size_t>(count);
        const Guarded<std::uint32_t> values(size, at_end);
        const Guarded<std::int16_t> out(size, at_end);
        for (std::uint32_t& value : values) {
          const unsigned bit = 10 + random() % octaves_of_table;
          const std::uint32_t below = static_cast<std::uint32_t>(random()) % (1u << bit);
          const std::uint32_t rest[] = {0, (1u << bit) - 1, below, below};
          value = random() % 9 ? (1u << bit) + rest[random() % 4] : 0;
        }
        look_up_octaves(values.data(), table.data(), count, out.data());
        for (std::size_t i = 0; i < size; ++i) {
          std::size_t entry = 0;
          for (std::uint32_t e = 0; e < octaves_of_table; ++e)
            if (values[i] >= 1u << (e + 10))
              entry = e * 256 + values[i] / (4u << e) - 256;
          ASSERT_EQ(out[i], values[i] ? table[entry] : 0) << values[i] << ' ' << i << " of " << count;
        }
      }
  });
}

// Boxes of one kind of cells each, to the last bit; where a count is 0 nothing may come out.
TEST(Kernels, CompareBoxes) {
  on_every_target([] {
    std::mt19937 random(32);
    for (int count = 1; count <= 70; ++count) {
      const int reach = 2 + count % 7;
      const auto blocks = static_cast<std::size_t>(count),
                 entries = blocks + 2 * static_cast<std::size_t>(reach) + 1;
      const bool at_end = count % 2;
      const Guarded<std::uint32_t> sums(entries, at_end), squares(entries, at_end), cells(blocks, at_end),
          whole(blocks, at_end), lefts(blocks, at_end), rights(blocks, at_end), variance(blocks, at_end);
      const Guarded<std::int16_t> left(blocks, at_end), right(blocks, at_end);
      std::vector<std::uint32_t> counts(entries, 0);
      sums[0] = squares[0] = 0;
      const std::uint32_t base = random() % 200, range = 1 + random() % 55;
      for (std::size_t p = 1; p < entries; ++p) {
        const std::uint32_t n = random() % 5;
        counts[p] = counts[p - 1] + n;
        sums[p] = sums[p - 1];
        squares[p] = squares[p - 1];
        for (std::uint32_t k = 0; k < n; ++k) {
          const std::uint32_t x = base + static_cast<std::uint32_t>(random()) % range;
          sums[p] += x;
          squares[p] += x * x;
        }
      }
      const auto r = static_cast<std::size_t>(reach);
      const auto between = [](const auto& running, std::size_t from, std::size_t to) {
        return running[to] - running[from];
      };
      for (std::size_t b = 0; b < blocks; ++b) {
        const std::uint32_t n = between(counts, b, b + 2 * r + 1), a = between(counts, b, b + r),
                            c = between(counts, b + r + 1, b + 2 * r + 1);
        const bool known = a > 0 && c > 0 && b % 5 != 3;
        cells[b] = n;
        whole[b] = known ? (1u << 24) / n : 0;
        lefts[b] = known ? (1u << 24) / a : 0;
        rights[b] = known ? (1u << 24) / c : 0;
      }
      compare_boxes(sums.data(), squares.data(),
                    {cells.data(), whole.data(), lefts.data(), rights.data(), reach}, 1024, count,
                    {left.data(), right.data(), variance.data()});
      for (std::size_t b = 0; b < blocks; ++b) {
        const std::uint64_t s = between(sums, b, b + 2 * r + 1), ss = between(squares, b, b + 2 * r + 1);
        if (whole[b] == 0) {
          ASSERT_EQ(left[b] | right[b], 0);
          ASSERT_EQ(variance[b], 0u);
          continue;
        }
        ASSERT_EQ(left[b], static_cast<int>((std::uint64_t{between(sums, b, b + r)} * lefts[b]) >> 20));
        ASSERT_EQ(right[b], static_cast<int>(
                                (std::uint64_t{between(sums, b + r + 1, b + 2 * r + 1)} * rights[b]) >> 20));
        // The same around the mean's whole part, in 64 bits.
        const std::uint64_t w = whole[b], n = cells[b], m = (s * w) >> 24, rest = s - n * m;
        const std::uint64_t power = ((ss + n * m * m - 2 * m * s) * w) >> 16, mean = (rest * w) >> 16,
                            lost = mean * mean / 256;
        ASSERT_EQ(variance[b], 1024 + (power > lost ? power - lost : 0)) << b << " of " << count;
      }
    }
  });
}

TEST(Kernels, DeviationsAndOddness) {
  on_every_target([] {
    std::mt19937 random(33);
    for (int count = 1; count <= 150; ++count)
      for (const bool at_end : {false, true}) {
        const auto size = static_cast<std::size_t>(count);
        const Guarded<std::uint8_t> cells(size, at_end), y(size, at_end), u(size, at_end), v(size, at_end),
            dark(size, at_end), ground(size, at_end), out(size, at_end);
        const Guarded<std::int16_t> left(size, at_end), right(size, at_end), inverse(size, at_end),
            nearest(size, at_end);
        fill(cells, all_fills[count % 5], random);
        for (std::size_t i = 0; i < size; ++i) {
          left[i] = static_cast<std::int16_t>(random() % 4081);
          right[i] = static_cast<std::int16_t>(random() % 4081);
          inverse[i] = static_cast<std::int16_t>(random() % 2049);
          nearest[i] = static_cast<std::int16_t>(random() % 5 ? random() % 40 : 30000);
          ground[i] = random() % 3 > 0;
          u[i] = random() % 128;
          v[i] = random() % (i % 2 ? 20 : 128);
        }
        deviations(cells.data(), left.data(), right.data(), inverse.data(), count, y.data(), dark.data());
        const std::vector<std::int16_t> before(nearest.begin(), nearest.end());
        const Guarded<std::uint8_t> work(size + 2, at_end);
        note_dark({y.data(), u.data(), v.data(), ground.data(), dark.data()}, 16, 7, count, work.data(),
                  nearest.data());
        for (std::size_t i = 0; i < size; ++i) {
          bool near = false;
          for (std::size_t k = i == 0 ? 0 : i - 1; k <= std::min(i + 1, size - 1); ++k)
            near |= ground[k] && dark[k] && y[k] > 16;
          ASSERT_EQ(nearest[i], near ? 7 : before[i]) << i << " of " << count;
        }
        oddness({y.data(), u.data(), v.data(), ground.data(), dark.data()}, nearest.data(), 20, 96, count,
                out.data());
        for (std::size_t i = 0; i < size; ++i) {
          const int a = 16 * cells[i] - left[i], b = 16 * cells[i] - right[i];
          const int beyond = a > 0 && b > 0 ? std::min(a, b) : a < 0 && b < 0 ? std::min(-a, -b) : 0;
          ASSERT_EQ(y[i], std::min(beyond * inverse[i] / 4096, 127)) << i << " of " << count;
          ASSERT_EQ(dark[i], a < 0 && b < 0);
          const int luma = !dark[i] && nearest[i] > 20 ? y[i] / 4 : y[i];
          const int sum = std::max({luma, int{u[i]}, int{v[i]}}) + luma + u[i] + v[i];
          ASSERT_EQ(out[i], ground[i] ? std::min(sum / 2, 96) : 0) << i << " of " << count;
        }
      }
  });
}

TEST(Kernels, RunDifferences) {
  on_every_target([] {
    std::mt19937 random(35);
    for (int count = 1; count <= 70; ++count)
      for (const bool at_end : {false, true}) {
        const auto size = static_cast<std::size_t>(count);
        const Guarded<std::uint32_t> a(size, at_end), b(size, at_end), out(size, at_end);
        for (std::size_t i = 0; i < size; ++i) {
          a[i] = static_cast<std::uint32_t>(random());
          b[i] = static_cast<std::uint32_t>(random());
        }
        run_differences(a.data(), b.data(), count, out.data());
        std::uint32_t sum = 0;
        for (std::size_t i = 0; i < size; ++i)
          ASSERT_EQ(out[i], sum += b[i] - a[i]) << i << " of " << count;
      }
  });
}

TEST(Kernels, AddMoments) {
  on_every_target([] {
    std::mt19937 random(51);
    for (int count = 1; count <= 150; ++count)
      for (const bool at_end : {false, true}) {
        const auto size = static_cast<std::size_t>(count);
        const Guarded<std::uint8_t> luma(size, at_end), ground(size, at_end);
        const Guarded<std::uint16_t> cells(size, at_end), sums(size, at_end);
        const Guarded<std::uint32_t> squares(size, at_end);
        std::vector<unsigned> n(size, 3), sum(size, 700), square(size, 40000);
        for (std::size_t i = 0; i < size; ++i) {
          cells[i] = 3;
          sums[i] = 700;
          squares[i] = 40000;
        }
        for (int row = 0; row < 13; ++row) {
          fill(luma, all_fills[static_cast<std::size_t>(count + row) % 5], random);
          for (std::size_t i = 0; i < size; ++i) {
            ground[i] = random() % 3 > 0;
            if (!ground[i])
              continue;
            ++n[i];
            sum[i] += luma[i];
            square[i] += static_cast<unsigned>((luma[i] - 128) * (luma[i] - 128));
          }
          add_moments(luma.data(), ground.data(), count, {cells.data(), sums.data(), squares.data()});
        }
        for (std::size_t i = 0; i < size; ++i) {
          ASSERT_EQ(cells[i], n[i]) << i << " of " << count;
          ASSERT_EQ(sums[i], sum[i]) << i << " of " << count;
          ASSERT_EQ(squares[i], square[i]) << i << " of " << count;
        }
      }
  });
}

TEST(Kernels, AddNear) {
  on_every_target([] {
    std::mt19937 random(52);
    for (int count = 1; count <= 150; ++count)
      for (const bool at_end : {false, true}) {
        const auto size = static_cast<std::size_t>(count);
        const Guarded<std::uint8_t> luma(size, at_end), ground(size, at_end), middle(size, at_end),
            reach(size, at_end);
        const Guarded<std::uint16_t> cells(size, at_end), sums(size, at_end), distances(size, at_end);
        fill(luma, all_fills[static_cast<std::size_t>(count) % 5], random);
        std::vector<unsigned> before(size);
        for (std::size_t i = 0; i < size; ++i) {
          ground[i] = random() % 3 > 0;
          middle[i] = static_cast<std::uint8_t>(random());
          reach[i] = random() % 5 ? static_cast<std::uint8_t>(random()) // and the limit itself
                                  : static_cast<std::uint8_t>(std::abs(luma[i] - middle[i]));
          cells[i] = static_cast<std::uint16_t>(before[i] = static_cast<unsigned>(random() % 100));
          sums[i] = static_cast<std::uint16_t>(20 * before[i]);
          distances[i] = static_cast<std::uint16_t>(7 * before[i]);
        }
        add_near(luma.data(), ground.data(), middle.data(), reach.data(), count,
                 {cells.data(), sums.data(), distances.data()});
        for (std::size_t i = 0; i < size; ++i) {
          const unsigned away = static_cast<unsigned>(std::abs(luma[i] - middle[i]));
          const bool near = ground[i] && away <= reach[i];
          ASSERT_EQ(cells[i], before[i] + near) << i << " of " << count;
          ASSERT_EQ(sums[i], 20 * before[i] + (near ? luma[i] : 0)) << i << " of " << count;
          ASSERT_EQ(distances[i], 7 * before[i] + (near ? away : 0)) << i << " of " << count;
        }
      }
  });
}

TEST(Kernels, DeviationsFrom) {
  on_every_target([] {
    std::mt19937 random(53);
    for (int count = 1; count <= 150; ++count)
      for (const bool at_end : {false, true}) {
        const auto size = static_cast<std::size_t>(count);
        const Guarded<std::uint8_t> luma(size, at_end), ground(size, at_end), middle(size, at_end),
            out(size, at_end);
        const Guarded<std::uint16_t> scale(size, at_end);
        fill(luma, all_fills[static_cast<std::size_t>(count) % 5], random);
        for (std::size_t i = 0; i < size; ++i) {
          ground[i] = random() % 3 > 0;
          middle[i] = static_cast<std::uint8_t>(random());
          scale[i] = static_cast<std::uint16_t>(random() % 1025);
        }
        scale[0] = 1024;
        deviations_from(luma.data(), ground.data(), middle.data(), scale.data(), count, out.data());
        for (std::size_t i = 0; i < size; ++i)
          ASSERT_EQ(out[i], ground[i] ? std::min(std::abs(luma[i] - middle[i]) * scale[i] / 256, 127) : 0)
              << i << " of " << count;
      }
  });
}

TEST(Kernels, AddExcess) {
  on_every_target([] {
    std::mt19937 random(34);
    for (int count = 1; count <= 150; ++count)
      for (const bool at_end : {false, true}) {
        const auto size = static_cast<std::size_t>(count);
        const Guarded<std::uint8_t> values(size, at_end), ground(size, at_end);
        const Guarded<std::int16_t> sums(size, at_end);
        fill(values, all_fills[count % 5], random);
        std::vector<int> before(size);
        for (std::size_t i = 0; i < size; ++i) {
          values[i] &= 127;
          ground[i] = random() % 3 > 0;
          sums[i] = static_cast<std::int16_t>(random());
          before[i] = sums[i];
        }
        const int enough = count % 128, sign = count % 2 ? 1 : -1;
        add_excess(values.data(), ground.data(), enough, sign, count, sums.data());
        for (std::size_t i = 0; i < size; ++i)
          ASSERT_EQ(sums[i],
                    static_cast<std::int16_t>(before[i] + sign * (values[i] - (ground[i] ? enough : 0))))
              << i << " of " << count;
      }
  });
}

TEST(Kernels, MarkBoxes) {
  on_every_target([] {
    std::mt19937 random(35);
    for (int count = 1; count <= 150; ++count)
      for (const bool at_end : {false, true}) {
        const int reach = static_cast<int>(random() % 16), least = static_cast<int>(random() % 128),
                  most = 127 * (2 * reach + 1);
        const auto size = static_cast<std::size_t>(count);
        const Guarded<std::uint8_t> values(size, at_end), marks(size, at_end);
        const Guarded<std::int16_t> columns(size + static_cast<std::size_t>(2 * reach), at_end);
        std::fill_n(columns.data(), columns.size(), std::int16_t{0});
        std::int16_t* const inside = columns.data() + reach;
        const bool extreme = random() % 8 == 0; // the largest sums must not overflow
        for (std::size_t i = 0; i < size; ++i) {
          values[i] = random() & 127;
          inside[i] = static_cast<std::int16_t>(extreme ? most : static_cast<int>(random() % 512) - 256);
        }
        const auto least_sum =
            static_cast<std::int16_t>(count % 3 == 0 ? 0 : static_cast<int>(random() % 2048) - 1024);
        const bool any = mark_boxes({inside, reach, least_sum}, values.data(), least, count, marks.data());
        bool some = false;
        for (int i = 0; i < count; ++i) {
          int sum = 0;
          for (int j = std::max(i - reach, 0); j <= std::min(i + reach, count - 1); ++j)
            sum += inside[j];
          const bool marked = sum >= least_sum && values[static_cast<std::size_t>(i)] >= least;
          some |= marked;
          ASSERT_EQ(marks[static_cast<std::size_t>(i)], marked) << i << " of " << count;
        }
        ASSERT_EQ(any, some) << count;
      }
  });
}

} // namespace
