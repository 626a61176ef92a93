// SPDX-License-Identifier: LGPL-2.1-or-later
#include <algorithm>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <iterator>
#include <stdexcept>

#include <opencv2/core.hpp>

#include "tools/experiments/arguments.hpp"
#include "tools/experiments/experiments.hpp"
#include "tools/experiments/parts.hpp"

namespace terrainseg::experiments {

const char* const usage =
    "usage: terrainseg-eval paper [--only PART] [OPTIONS]     tables and figures of the paper, as Markdown "
    "and charts\n"
    "       terrainseg-eval figures [OPTIONS]                 pictures after its figures 4 to 9\n\n"
    "  --only PART   table1, table2, curves, training or readings; more than once if wished\n"
    "  --data DIR    a folder of labelled sequences; without it scenes are rendered\n"
    "  --out DIR     where the results go (default: paper)\n"
    "  --limit N     the first N frames of each sequence\n";

Arguments parse(const std::vector<std::string>& words, bool parts_allowed) {
  Arguments a;
  for (std::size_t i = 0; i < words.size(); ++i) {
    const std::string& word = words[i];
    const auto value = [&]() -> const std::string& {
      if (++i >= words.size())
        throw UsageError(word + " needs a value");
      return words[i];
    };
    if (word == "--data")
      a.data = value();
    else if (word == "--out")
      a.out = value();
    else if (word == "--only" && parts_allowed)
      a.only.push_back(value());
    else if (word == "--limit") {
      const std::string& text = value();
      if (text.empty() || text.find_first_not_of("0123456789") != std::string::npos || text.size() > 6)
        throw UsageError("--limit " + text + ": not a number of frames");
      a.limit = std::stoi(text);
    } else
      throw UsageError(word + ": no such option\n" + usage);
  }
  return a;
}

void run_paper(const std::vector<std::string>& arguments) {
  struct Part {
    const char* name;
    std::string (*run)(const Context&);
  };
  constexpr Part parts[] = {{"table1", stage_times},
                            {"table2", error_rates},
                            {"curves", scale_and_shift},
                            {"training", training_pixels},
                            {"readings", readings}};
  const Arguments a = parse(arguments, true);
  for (const std::string& name : a.only)
    if (std::none_of(std::begin(parts), std::end(parts), [&](const Part& part) { return part.name == name; }))
      throw UsageError("--only " + name + ": no such part\n" + usage);
  std::filesystem::create_directories(a.out);
  const Context context{a.data, a.out, a.limit, [](const std::string& what) { std::cerr << what << '\n'; }};
  cv::setNumThreads(1); // everything is measured on one thread
  const std::string path = a.out + "/paper.md";
  std::ofstream report(path);
  report << "# The paper's experiments\n\nMade by `terrainseg-eval paper` from "
         << (a.data.empty() ? "rendered scenes (no data folder was given)" : "labelled sequences")
         << (a.limit > 0 ? ", the first " + std::to_string(a.limit) + " frames of each" : "") << ".\n";
  for (const Part& part : parts)
    if (a.only.empty() || std::find(a.only.begin(), a.only.end(), part.name) != a.only.end()) {
      const std::string text = part.run(context);
      report << '\n' << text << std::flush;
      std::cout << text << '\n' << std::flush;
    }
  if (!report)
    throw std::runtime_error(path + ": cannot be written");
}

} // namespace terrainseg::experiments
