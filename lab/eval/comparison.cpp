// SPDX-License-Identifier: LGPL-2.1-or-later
#include "lab/eval/comparison.hpp"

#include <algorithm>
#include <cmath>
#include <iomanip>
#include <numeric>
#include <random>
#include <stdexcept>

namespace terrainseg::eval {

Comparison compare(const std::vector<double>& a, const std::vector<double>& b, int block) {
  Comparison c;
  c.pairs = static_cast<int>(std::min(a.size(), b.size()));
  if (c.pairs == 0)
    return c;
  std::vector<double> blocks;
  std::vector<int> sizes;
  for (int i = 0; i < c.pairs; ++i) {
    const double difference = b[static_cast<std::size_t>(i)] - a[static_cast<std::size_t>(i)];
    c.mean_difference += difference / c.pairs;
    c.better += difference < 0;
    c.worse += difference > 0;
    if (i % block == 0) {
      blocks.push_back(0);
      sizes.push_back(0);
    }
    blocks.back() += difference;
    ++sizes.back();
  }
  c.blocks = static_cast<int>(blocks.size());
  constexpr int rounds = 5000;
  std::mt19937 random(1);
  const double seen = std::abs(std::accumulate(blocks.begin(), blocks.end(), 0.0));
  int as_far = 0;
  std::vector<double> means;
  for (int r = 0; r < rounds; ++r) {
    double flipped = 0, drawn = 0;
    int frames = 0;
    for (std::size_t i = 0; i < blocks.size(); ++i) {
      flipped += random() & 1 ? blocks[i] : -blocks[i];
      const std::size_t pick = random() % blocks.size();
      drawn += blocks[pick];
      frames += sizes[pick];
    }
    as_far += std::abs(flipped) >= seen - 1e-12;
    means.push_back(drawn / frames);
  }
  c.p = (as_far + 1.0) / (rounds + 1.0);
  std::sort(means.begin(), means.end());
  c.low = means[static_cast<std::size_t>(rounds * 0.025)];
  c.high = means[static_cast<std::size_t>(rounds * 0.975)];
  return c;
}

void write_comparison(std::ostream& out, const std::vector<Figures>& first,
                      const std::vector<Figures>& second) {
  const auto write = [&](const std::string& name, const char* what, const Comparison& c) {
    const char* verdict = c.too_few()             ? "too few frames to tell"
                          : c.p > 0.05            ? "no difference shown"
                          : c.mean_difference < 0 ? "better"
                                                  : "worse";
    out << std::fixed << std::setprecision(2) << "| " << name << " | " << what << " | " << c.pairs << " | "
        << std::showpos << c.mean_difference << " [" << c.low << ", " << c.high << "]" << std::noshowpos
        << " | " << c.better << " / " << c.worse << " | " << std::setprecision(4) << c.p << " | " << verdict
        << " |\n";
  };
  // Runs of the same name belong together; where there are none, two settings are compared.
  const bool same_names = std::any_of(first.begin(), first.end(), [&](const Figures& a) {
    return std::any_of(second.begin(), second.end(), [&](const Figures& b) { return a.engine == b.engine; });
  });
  bool head = false;
  std::vector<double> error_a, error_b, unsafe_a, unsafe_b;
  for (const Figures& a : first)
    for (const Figures& b : second) {
      if (same_names && a.engine != b.engine)
        continue;
      if (a.sequence != b.sequence || a.input != b.input || a.frames.size() != b.frames.size())
        continue;
      if (!head)
        out << "| sequence | figure | frames | second minus first, points [95 %] | frames better / worse | p "
               "| second is "
               "|\n|---|---|---|---|---|---|---|\n";
      head = true;
      std::vector<double> ea, eb, ua, ub;
      for (std::size_t i = 0; i < a.frames.size(); ++i) {
        ea.push_back(a.frames[i].error);
        eb.push_back(b.frames[i].error);
        ua.push_back(a.frames[i].unsafe);
        ub.push_back(b.frames[i].unsafe);
      }
      const std::string name =
          a.sequence + (a.input == "as it is" ? "" : ", " + a.input) + ": " + a.engine + " / " + b.engine;
      const int block = a.stills ? 1 : 5;
      write(name, "error", compare(ea, eb, block));
      write(name, "unsafe", compare(ua, ub, block));
      error_a.insert(error_a.end(), ea.begin(), ea.end());
      error_b.insert(error_b.end(), eb.begin(), eb.end());
      unsafe_a.insert(unsafe_a.end(), ua.begin(), ua.end());
      unsafe_b.insert(unsafe_b.end(), ub.begin(), ub.end());
    }
  if (!head)
    throw std::runtime_error("the two files share no sequence with the same input and number of frames");
  write("all", "error", compare(error_a, error_b));
  write("all", "unsafe", compare(unsafe_a, unsafe_b));
}

} // namespace terrainseg::eval
