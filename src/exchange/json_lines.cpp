// SPDX-License-Identifier: LGPL-2.1-or-later
#include "exchange/json_lines.hpp"

#include <algorithm>
#include <charconv>
#include <chrono>
#include <cmath>
#include <cstdio>

#include "exchange/bytes.hpp"

namespace terrainseg {
namespace {

template <class Integer> void put(std::string& out, Integer value) {
  char digits[24];
  const auto end = std::to_chars(digits, digits + sizeof digits, value).ptr;
  out.append(digits, static_cast<std::size_t>(end - digits));
}

/// value / 10^decimals without trailing zeros.
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

/// A number with 8 fraction bits, rounded to a thousandth.
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
  // Neighbouring columns mostly have the same row: its text is reused.
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
                            {flag_horizon_held, "\"horizon-held\""}, {flag_blocked, "\"blocked\""},
                            {flag_window_still, "\"window-still\""}};
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

/// A number with 16 fraction bits, rounded to a thousandth.
void put_q16(std::string& out, std::int64_t value) {
  if (value < 0)
    out += '-';
  put_decimal(out, (static_cast<std::uint64_t>(value < 0 ? -value : value) * 1000 + 32768) >> 16, 3);
}

/// The vanishing row and the speed are left out if motion found neither.
void put_motion(std::string& out, const Estimate& e) {
  if (e.vanishing_row < 0 && e.speed_over_height == 0)
    return;
  out += ", \"motion\": {\"vanishing_row\": ";
  if (e.vanishing_row < 0)
    out += "null";
  else
    put_q16(out, e.vanishing_row);
  out += ", \"speed_over_height\": ";
  put_q16(out, e.speed_over_height);
  out += '}';
}

void put_real(std::string& out, double value, int decimals) {
  double one = 1;
  for (int i = 0; i < decimals; ++i)
    one *= 10;
  const long long fixed = std::llround(value * one);
  if (fixed < 0)
    out += '-';
  put_decimal(out, static_cast<std::uint64_t>(fixed < 0 ? -fixed : fixed), decimals);
}

constexpr int millimetres = 3;  ///< decimals of ranges in metres
constexpr int microradians = 6; ///< decimals of angles in radians: 0.001 degrees are 17e-6

/// null for unknown values. Values are limited to `most`.
void put_reals(std::string& out, const char* name, std::span<const float> values, int decimals, double most) {
  out.append("\"").append(name).append("\": [");
  for (std::size_t i = 0; i < values.size(); ++i) {
    if (i > 0)
      out += ',';
    if (std::isnan(values[i]))
      out += "null";
    else
      put_real(out, std::min<double>(values[i], most), decimals);
  }
  out += "], ";
}

void put_metric(std::string& out, const MetricEstimate& m) {
  constexpr double any = 1e6;
  out += ", \"metric\": {";
  put_reals(out, "ranges", m.ranges, millimetres, m.range_max);
  put_reals(out, "bearings", m.bearings, microradians, any);
  put_reals(out, "low", m.low, millimetres, m.range_max);
  put_reals(out, "high", m.high, millimetres, m.range_max);
  out += "\"free\": [";
  for (std::size_t i = 0; i < m.ranges.size(); ++i)
    out.append(i > 0 ? "," : "").append(std::isinf(m.ranges[i]) ? "true" : "false");
  out += ']';
  struct Number {
    const char* name;
    double value;
    int decimals;
  };
  for (const Number& n :
       {Number{"height", m.height, millimetres}, Number{"pitch", m.pitch, microradians},
        Number{"roll", m.roll, microradians}, Number{"yaw", m.yaw, microradians},
        Number{"range_min", m.range_min, millimetres}, Number{"range_max", m.range_max, millimetres}}) {
    out.append(", \"").append(n.name).append("\": ");
    put_real(out, n.value, n.decimals);
  }
  out.append(", \"posed\": ").append(m.flags & metric_flag_pose ? "true" : "false");
  out.append(", \"horizon_off\": ").append(m.flags & metric_flag_horizon ? "true" : "false").append("}");
}

} // namespace

std::string utc_text(std::uint64_t nanoseconds) {
  using namespace std::chrono;
  const std::uint64_t micro = nanoseconds / 1000;
  const std::uint64_t in_day = micro % 86'400'000'000u;
  const year_month_day date{sys_days{days{static_cast<int>(micro / 86'400'000'000u)}}};
  char text[40];
  std::snprintf(text, sizeof text, "%04d-%02u-%02uT%02u:%02u:%02u.%06uZ", static_cast<int>(date.year()),
                static_cast<unsigned>(date.month()), static_cast<unsigned>(date.day()),
                static_cast<unsigned>(in_day / 3'600'000'000u),
                static_cast<unsigned>(in_day / 60'000'000u % 60),
                static_cast<unsigned>(in_day / 1'000'000u % 60), static_cast<unsigned>(in_day % 1'000'000u));
  return text;
}

void append_json_line(std::string& out, const Estimate& e, std::int64_t pts, bool with_mask,
                      const LineExtras& extras) {
  out += "{\"frame\": ";
  put(out, e.frame);
  out += ", \"pts\": ";
  if (pts < 0)
    out += "null";
  else
    put(out, pts);
  if (extras.utc)
    out.append(", \"utc\": \"").append(utc_text(*extras.utc)).append("\"");
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
  out += "}";
  put_motion(out, e);
  out += ", \"traversable\": ";
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
  if (extras.metric)
    put_metric(out, *extras.metric);
  if (with_mask) {
    out += ", \"mask\": ";
    put_runs(out, e.mask);
  }
  out += "}\n";
}

} // namespace terrainseg
