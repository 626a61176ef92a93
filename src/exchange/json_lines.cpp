// SPDX-License-Identifier: LGPL-2.1-or-later
#include "exchange/json_lines.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <tuple>
#include <utility>

#include "exchange/bytes.hpp"

namespace terrainseg {
namespace {

template <class Integer> void put(std::string& out, Integer value) {
  char digits[24];
  const auto end = std::to_chars(digits, digits + sizeof digits, value).ptr;
  out.append(digits, static_cast<std::size_t>(end - digits));
}

/// A number; null if it is negative, which means that it is unknown.
void put_known(std::string& out, std::int64_t value) {
  if (value < 0)
    out += "null";
  else
    put(out, value);
}

template <class Integer> void put_member(std::string& out, const char* name, Integer value) {
  out.append(", \"").append(name).append("\": ");
  put(out, value);
}

/// Ends a list in which a comma follows each value.
void end_list(std::string& out) {
  if (out.back() == ',')
    out.pop_back();
  out += ']';
}

/// A list of what put_one(value) writes of each value.
template <class Values, class Put> void put_list(std::string& out, const Values& values, Put put_one) {
  out += '[';
  for (const auto& value : values) {
    put_one(value);
    out += ',';
  }
  end_list(out);
}

constexpr std::uint64_t powers_of_ten[] = {1, 10, 100, 1000, 10'000, 100'000, 1'000'000};

/// value / 10^decimals without trailing zeros.
void put_decimal(std::string& out, std::uint64_t value, int decimals) {
  const std::uint64_t one = powers_of_ten[decimals];
  char digits[48];
  char* end = std::to_chars(digits, digits + 24, value / one).ptr;
  if (const std::uint64_t rest = value % one; rest != 0) {
    char* const point = end;
    end = std::to_chars(point, point + 24, one + rest).ptr; // its first digit becomes the point
    *point = '.';
    while (end[-1] == '0')
      --end;
  }
  out.append(digits, end);
}

void put_boundary(std::string& out, std::span<const std::uint16_t> boundary, int frame_height) {
  const std::uint32_t height = static_cast<std::uint32_t>(std::max(frame_height, 1));
  // Neighbouring columns mostly have the same row: its text is reused.
  std::uint32_t last = ~0u;
  std::string text;
  put_list(out, boundary, [&](std::uint16_t at) {
    const std::uint32_t row = std::min<std::uint32_t>(at, height);
    if (row != last) {
      text.clear();
      put_decimal(text, (row * 10000ull + height / 2) / height, 4);
      last = row;
    }
    out += text;
  });
}

void put_flags(std::string& out, std::uint32_t flags) {
  constexpr std::pair<Flag, const char*> names[] = {
      {flag_learned, "learned"},           {flag_frozen, "frozen"},
      {flag_starved, "starved"},           {flag_unknown, "unknown"},
      {flag_horizon_held, "horizon-held"}, {flag_blocked, "blocked"},
      {flag_window_still, "window-still"}};
  out += '[';
  for (const auto& [flag, name] : names)
    if (flags & flag)
      out.append("\"").append(name).append("\",");
  end_list(out);
}

void put_runs(std::string& out, const GrayView& mask) {
  out += "{\"width\": ";
  put(out, std::max(mask.width, 0));
  put_member(out, "height", std::max(mask.height, 0));
  out += ", \"runs\": [";
  for_each_run(mask, [&](std::uint8_t value, std::size_t length) {
    put(out, value);
    out += ',';
    put(out, length);
    out += ',';
    return true;
  });
  end_list(out);
  out += '}';
}

void put_signed(std::string& out, bool negative, std::uint64_t size, int decimals) {
  if (negative)
    out += '-';
  put_decimal(out, size, decimals);
}

/// A number with 16 fraction bits, rounded to a thousandth.
void put_q16(std::string& out, std::int64_t value) {
  put_signed(out, value < 0, (static_cast<std::uint64_t>(std::abs(value)) * 1000 + 32768) >> 16, 3);
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
  const long long fixed = std::llround(value * static_cast<double>(powers_of_ten[decimals]));
  put_signed(out, fixed < 0, static_cast<std::uint64_t>(std::abs(fixed)), decimals);
}

constexpr int millimetres = 3;  ///< decimals of ranges in metres
constexpr int microradians = 6; ///< decimals of angles in radians: 0.001 degrees are 17e-6

/// null for unknown values. Values are limited to `most`.
void put_reals(std::string& out, const char* name, std::span<const float> values, int decimals, double most) {
  out.append("\"").append(name).append("\": ");
  put_list(out, values, [&](float value) {
    if (std::isnan(value))
      out += "null";
    else
      put_real(out, std::min<double>(value, most), decimals);
  });
  out += ", ";
}

void put_metric(std::string& out, const MetricEstimate& m) {
  constexpr double any = 1e6;
  out += ", \"metric\": {";
  put_reals(out, "ranges", m.ranges, millimetres, m.range_max);
  put_reals(out, "bearings", m.bearings, microradians, any);
  put_reals(out, "low", m.low, millimetres, m.range_max);
  put_reals(out, "high", m.high, millimetres, m.range_max);
  out += "\"free\": ";
  put_list(out, m.ranges, [&](float range) { out += std::isinf(range) ? "true" : "false"; });
  using Number = std::tuple<const char*, double, int>;
  for (const auto& [name, value, decimals] :
       {Number{"height", m.height, millimetres}, Number{"pitch", m.pitch, microradians},
        Number{"roll", m.roll, microradians}, Number{"yaw", m.yaw, microradians},
        Number{"range_min", m.range_min, millimetres}, Number{"range_max", m.range_max, millimetres}}) {
    out.append(", \"").append(name).append("\": ");
    put_real(out, value, decimals);
  }
  out.append(", \"posed\": ").append(m.flags & metric_flag_pose ? "true" : "false");
  out.append(", \"horizon_off\": ").append(m.flags & metric_flag_horizon ? "true" : "false").append("}");
}

} // namespace

std::string utc_text(std::uint64_t nanoseconds) {
  const auto seconds = static_cast<std::time_t>(nanoseconds / 1'000'000'000);
  std::tm date{};
  ::gmtime_r(&seconds, &date);
  char text[40];
  const std::size_t end = std::strftime(text, sizeof text, "%Y-%m-%dT%H:%M:%S", &date);
  std::snprintf(text + end, sizeof text - end, ".%06uZ",
                static_cast<unsigned>(nanoseconds / 1000 % 1'000'000));
  return text;
}

void append_json_line(std::string& out, const Estimate& e, std::int64_t pts, bool with_mask,
                      const LineExtras& extras) {
  out += "{\"frame\": ";
  put(out, e.frame);
  out += ", \"pts\": ";
  put_known(out, pts);
  if (extras.utc)
    out.append(", \"utc\": \"").append(utc_text(*extras.utc)).append("\"");
  put_member(out, "width", e.frame_width);
  put_member(out, "height", e.frame_height);
  out += ", \"horizon\": {\"row\": ";
  put_known(out, e.horizon_row);
  put_member(out, "confidence", e.horizon_confidence);
  out += "}";
  put_motion(out, e);
  out += ", \"traversable\": ";
  put_decimal(out, static_cast<std::uint64_t>(std::clamp(e.traversable_permille, 0, 1000)), 3);
  put_member(out, "confidence", e.confidence);
  out += ", \"boundary\": ";
  put_boundary(out, e.boundary, e.frame_height);
  out += ", \"window\": ";
  const auto plain = [&](int value) { put(out, value); };
  put_list(out, std::array{e.window.x, e.window.y, e.window.width, e.window.height}, plain);
  put_member(out, "generation", e.model_generation);
  out += ", \"flags\": ";
  put_flags(out, e.flags);
  out += ", \"models\": [";
  const int models = std::clamp(e.model_count, 0, max_models);
  // A number with 8 fraction bits, rounded to a thousandth.
  const auto q8 = [&](std::uint64_t value) { put_decimal(out, (value * 1000 + 128) >> 8, 3); };
  for (int i = 0; i < models; ++i) {
    const ModelSummary& model = e.models[static_cast<std::size_t>(i)];
    out += i ? ", {\"mean\": " : "{\"mean\": ";
    put_list(out, model.mean, q8);
    out += ", \"variance\": ";
    put_list(out, model.variance, q8);
    put_member(out, "mass", model.mass);
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
