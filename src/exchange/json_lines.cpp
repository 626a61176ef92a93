// SPDX-License-Identifier: LGPL-2.1-or-later
#include "exchange/json_lines.hpp"

#include <algorithm>
#include <charconv>

#include "exchange/bytes.hpp"

namespace terrainseg {
namespace {

template <class Integer> void put(std::string& out, Integer value) {
  char digits[24];
  const auto end = std::to_chars(digits, digits + sizeof digits, value).ptr;
  out.append(digits, static_cast<std::size_t>(end - digits));
}

/// value / 10^decimals, without trailing zeros.
void put_decimal(std::string& out, std::uint64_t value, int decimals) {
  std::uint64_t one = 1;
  for (int i = 0; i < decimals; ++i)
    one *= 10;
  put(out, value / one);
  std::uint64_t rest = value % one;
  if (rest == 0)
    return;
  char digits[20];
  int n = decimals;
  for (int i = decimals - 1; i >= 0; --i, rest /= 10)
    digits[i] = static_cast<char>('0' + rest % 10);
  while (digits[n - 1] == '0')
    --n;
  out += '.';
  out.append(digits, static_cast<std::size_t>(n));
}

/// A number with 8 fraction bits, to a thousandth.
void put_q8(std::string& out, std::uint64_t value) {
  put_decimal(out, (value * 1000 + 128) >> 8, 3);
}

template <std::size_t N, class Number>
void put_q8_list(std::string& out, const std::array<Number, N>& values) {
  char separator = '[';
  for (const Number value : values) {
    out += separator;
    put_q8(out, value);
    separator = ',';
  }
  out += ']';
}

void put_boundary(std::string& out, std::span<const std::uint16_t> boundary, int frame_height) {
  const std::uint32_t height = static_cast<std::uint32_t>(std::max(frame_height, 1));
  out += '[';
  // Neighbouring columns mostly share their row: its text is made once.
  std::uint32_t last = ~0u;
  std::string text;
  for (std::size_t i = 0; i < boundary.size(); ++i) {
    const std::uint32_t row = std::min<std::uint32_t>(boundary[i], height);
    if (row != last) {
      text.clear();
      put_decimal(text, (row * 10000ull + height / 2) / height, 4);
      text += ',';
      last = row;
    }
    out += text;
  }
  if (boundary.empty())
    out += ']';
  else
    out.back() = ']';
}

void put_flags(std::string& out, std::uint32_t flags) {
  struct Name {
    std::uint32_t bit;
    const char* text;
  };
  constexpr Name names[] = {{flag_learned, "\"learned\""},           {flag_frozen, "\"frozen\""},
                            {flag_starved, "\"starved\""},           {flag_unknown, "\"unknown\""},
                            {flag_horizon_held, "\"horizon-held\""}, {flag_blocked, "\"blocked\""}};
  out += '[';
  bool first = true;
  for (const Name& name : names) {
    if (!(flags & name.bit))
      continue;
    if (!first)
      out += ',';
    out += name.text;
    first = false;
  }
  out += ']';
}

void put_runs(std::string& out, const GrayView& mask) {
  out += "{\"width\": ";
  put(out, std::max(mask.width, 0));
  out += ", \"height\": ";
  put(out, std::max(mask.height, 0));
  out += ", \"runs\": [";
  const std::size_t before = out.size();
  for_each_run(mask, [&](std::uint8_t value, std::size_t length) {
    put(out, static_cast<unsigned>(value));
    out += ',';
    put(out, length);
    out += ',';
    return true;
  });
  if (out.size() > before)
    out.pop_back();
  out += "]}";
}

} // namespace

void append_json_line(std::string& out, const Estimate& e, std::int64_t pts, bool with_mask) {
  out += "{\"frame\": ";
  put(out, e.frame);
  out += ", \"pts\": ";
  if (pts < 0)
    out += "null";
  else
    put(out, pts);
  out += ", \"width\": ";
  put(out, e.frame_width);
  out += ", \"height\": ";
  put(out, e.frame_height);
  out += ", \"horizon\": {\"row\": ";
  if (e.horizon_row < 0)
    out += "null";
  else
    put(out, e.horizon_row);
  out += ", \"confidence\": ";
  put(out, static_cast<unsigned>(e.horizon_confidence));
  out += "}, \"traversable\": ";
  put_decimal(out, static_cast<std::uint64_t>(std::clamp(e.traversable_permille, 0, 1000)), 3);
  out += ", \"confidence\": ";
  put(out, static_cast<unsigned>(e.confidence));
  out += ", \"boundary\": ";
  put_boundary(out, e.boundary, e.frame_height);
  out += ", \"window\": [";
  put(out, e.window.x);
  out += ',';
  put(out, e.window.y);
  out += ',';
  put(out, e.window.width);
  out += ',';
  put(out, e.window.height);
  out += "], \"generation\": ";
  put(out, e.model_generation);
  out += ", \"flags\": ";
  put_flags(out, e.flags);
  out += ", \"models\": [";
  const int models = std::clamp(e.model_count, 0, max_models);
  for (int i = 0; i < models; ++i) {
    const ModelSummary& model = e.models[static_cast<std::size_t>(i)];
    out += i ? ", {\"mean\": " : "{\"mean\": ";
    put_q8_list(out, model.mean);
    out += ", \"variance\": ";
    put_q8_list(out, model.variance);
    out += ", \"mass\": ";
    put(out, model.mass);
    out += '}';
  }
  out += ']';
  if (with_mask) {
    out += ", \"mask\": ";
    put_runs(out, e.mask);
  }
  out += "}\n";
}

} // namespace terrainseg
