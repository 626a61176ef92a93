// SPDX-License-Identifier: LGPL-2.1-or-later
// What terrainseg-process reads back: manifests (JSON Lines) and the record beside an input's outputs (JSON),
// of any bytes. A check ends, says no more than the manifest has lines, and calls nothing whole that is not.
#include <stdlib.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <sstream>
#include <string>

#include "input.hpp"
#include "tools/process/manifest.hpp"
#include "tools/process/outputs.hpp"

namespace {

namespace fs = std::filesystem;
using namespace terrainseg::process;
using terrainseg::fuzz::require;

/// A folder with an input and one output of it, which goes with the process.
const fs::path& folder() {
  static const fs::path made = [] {
    std::string name = (fs::temp_directory_path() / "terrainseg-fuzz-XXXXXX").string();
    require(mkdtemp(name.data()) != nullptr);
    for (const char* file : {"a", "a.csv"})
      std::ofstream(fs::path(name) / file) << "abc";
    return fs::path(name);
  }();
  static const bool gone = std::atexit([] { fs::remove_all(folder()); }) == 0;
  require(gone);
  return made;
}

Options options_for_one_output() {
  Options options;
  options.output_dir = folder();
  options.output_dir_given = true;
  std::fill(std::begin(options.wanted), std::end(options.wanted), false);
  options.wanted[static_cast<int>(Output::csv)] = true;
  return options;
}

void check_manifest_of(const std::string& text) {
  Options options = options_for_one_output();
  options.check = "-";
  std::istringstream stream(text);
  std::streambuf* const standard = std::cin.rdbuf(stream.rdbuf());
  std::cin.clear();
  Check check;
  try {
    check = check_manifest(options, {});
  } catch (const EarlyExit&) { // no manifest
  }
  std::cin.rdbuf(standard);
  const auto lines = static_cast<std::size_t>(std::count(text.begin(), text.end(), '\n')) + 1;
  require(check.whole <= lines);
  // Of a line: it, its shard, the gap before and the one after. Of an output, which takes more than 20
  // bytes: it.
  require(check.again.size() <= 4 * lines + text.size() / 20 && check.damaged.size() <= lines);
}

void check_record(const std::string& text) {
  const Naming naming(folder(), "a");
  std::ofstream(naming.record(), std::ios::binary) << text;
  Input input;
  input.label = input.stem = "a";
  input.path = folder() / "a";
  static const Options options = options_for_one_output();
  const bool complete = is_complete(input, options);
  require(!complete || read_origin(naming.record()).has_value() || text.find("place") == text.npos);
}

} // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string text(reinterpret_cast<const char*>(data), size);
  check_manifest_of(text);
  check_record(text);
  is_manifest(folder() / "a.summary.json");
  return 0;
}
