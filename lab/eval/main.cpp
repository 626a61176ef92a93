// SPDX-License-Identifier: LGPL-2.1-or-later
// terrainseg-eval: accuracy on labelled sequences, and the paper's experiments.
#include <clocale>
#include <cstdlib>
#include <iostream>
#include <string>
#include <vector>

#include <opencv2/core/utils/logger.hpp>

#include "lab/eval/comparison.hpp"
#include "lab/eval/engines.hpp"
#include "lab/eval/evaluation.hpp"
#include "lab/eval/metres.hpp"
#include "lab/eval/options.hpp"
#include "lab/eval/paper.hpp"
#include "lab/eval/report.hpp"

namespace {

using namespace terrainseg::eval;

constexpr int exit_usage = 2;

void compare_files(const std::vector<std::string>& files) {
  if (files.size() != 2)
    throw UsageError("compare needs two JSON files");
  write_comparison(std::cout, read_json(files[0]), read_json(files[1]));
}

void run(const std::vector<std::string>& words) {
  const std::string& command = words[0];
  const std::vector<std::string> rest(words.begin() + 1, words.end());
  if (command == "paper")
    run_paper(rest);
  else if (command == "figures")
    run_figures(rest);
  else if (command == "metres")
    run_metres(rest);
  else if (command == "compare")
    compare_files(rest);
  else if (command == "tuning")
    list_tuning(std::cout);
  else
    evaluate(parse_eval_options(words));
}

} // namespace

int main(int argc, char** argv) {
  std::setlocale(LC_CTYPE, ""); // for GLib's help; numbers keep their points
  const std::vector<std::string> words(argv + 1, argv + argc);
  cv::utils::logging::setLogLevel(cv::utils::logging::LOG_LEVEL_SILENT);
  try {
    if (words.empty()) {
      std::cerr << eval_help();
      return exit_usage;
    }
    run(words);
    return EXIT_SUCCESS;
  } catch (const UsageError& error) {
    std::cerr << "terrainseg-eval: " << error.what() << "; --help shows how\n";
    return exit_usage;
  } catch (const std::exception& error) {
    std::cerr << "terrainseg-eval: " << error.what() << '\n';
    return EXIT_FAILURE;
  }
}
