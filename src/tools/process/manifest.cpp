// SPDX-License-Identifier: LGPL-2.1-or-later
#include "tools/process/manifest.hpp"

#include <cerrno>
#include <cstring>
#include <fstream>
#include <iostream>
#include <map>
#include <nlohmann/json.hpp>
#include <set>

namespace terrainseg::process {
namespace {

namespace fs = std::filesystem;
using nlohmann::ordered_json;

constexpr int format_version = 1;
constexpr std::streamsize longest_head = 64 * 1024; ///< of the first line of a manifest

std::string as_line(const ordered_json& json) {
  return json.dump(-1, ' ', false, ordered_json::error_handler_t::replace) + "\n";
}

/// A non-negative integer; throws for other JSON, such as -1 and 1e300.
std::uint64_t natural(const nlohmann::json& json) {
  return json.get_ref<const nlohmann::json::number_unsigned_t&>();
}

/// The content of a manifest for one input, and its run.
// NOLINTNEXTLINE(bugprone-exception-escape)
struct Entry {
  nlohmann::json json;
  fs::path folder;
};

class Checker {
 public:
  explicit Checker(const Options& options) : options_(options) {}

  /// Returns false if it is no manifest.
  bool read(std::istream& stream) {
    std::string text;
    for (int number = 1; std::getline(stream, text); ++number)
      if (!text.empty() && !take(text))
        check_.again.push_back("line " + std::to_string(number) + " of the manifest cannot be read");
    return runs_ > 0;
  }
  Check finish(const std::vector<Input>& inputs);

 private:
  bool take(const std::string& text);
  void check(const std::string& input, const Entry& line);
  void check_shards();

  const Options& options_;
  Check check_;
  fs::path folder_;
  int runs_ = 0;
  std::map<std::string, Entry> lines_; ///< by input; a later line replaces an earlier one of the same input
  struct Promise {
    std::size_t inputs = 0;
    std::set<std::string> seen;
  };
  std::map<std::pair<int, int>, Promise> shards_; ///< by count and index
  Promise* promise_ = nullptr;
};

/// Returns false if the line cannot be read.
bool Checker::take(const std::string& text) {
  const std::size_t mark = text.starts_with("\xEF\xBB\xBF") ? 3 : 0; // byte order mark
  auto json =
      nlohmann::json::parse(text.begin() + static_cast<std::ptrdiff_t>(mark), text.end(), nullptr, false);
  try {
    if (json.contains("manifest")) {
      ++runs_;
      promise_ = nullptr;
      const std::string written = json.at("output_dir");
      folder_ = options_.output_dir_given ? options_.output_dir : fs::path(written);
      const std::uint64_t count = natural(json.at("shards")), index = natural(json.at("shard")),
                          inputs = natural(json.at("inputs"));
      if (count > most_shards || index < 1 || index > count)
        return false;
      promise_ = &shards_[{static_cast<int>(count), static_cast<int>(index)}];
      promise_->inputs = inputs;
      return true;
    }
    const std::string input = json.at("input");
    json.at("status").get<std::string>();
    lines_[input] = {std::move(json), folder_}; // moved, because a copy recurses through nested brackets
    if (promise_)
      promise_->seen.insert(input);
    return true;
  } catch (const nlohmann::json::exception&) {
    return false;
  }
}

void Checker::check(const std::string& input, const Entry& line) {
  const auto& json = line.json;
  const std::string status = json.at("status");
  if (status != "complete" && status != "skipped") {
    const std::string problem = input + ": " + status + ": " + json.value("problem", "no cause is given");
    (json.value("try_again", true) ? check_.again : check_.damaged).push_back(problem);
    return;
  }
  bool whole = true;
  for (const auto& [kind, output] : json.at("outputs").items()) {
    const fs::path path = line.folder / output.at("file").get<std::string>();
    std::error_code error;
    const std::uint64_t expected = natural(output.at("bytes")), bytes = fs::file_size(path, error);
    std::string problem;
    if (error)
      problem = " is missing";
    else if (bytes != expected)
      problem = " has " + std::to_string(bytes) + " bytes instead of " + std::to_string(expected);
    else if (sha256_of(path) != output.at("sha256").get<std::string>())
      problem = " is not the file that was written: its SHA-256 differs";
    if (problem.empty())
      continue;
    // NOLINTNEXTLINE(performance-inefficient-string-concatenation)
    check_.again.push_back(input + ": " + path.string() + problem);
    whole = false;
  }
  check_.whole += whole;
}

/// Each shard of a set must exist, with a line for each of its inputs.
void Checker::check_shards() {
  for (const auto& [key, promise] : shards_) {
    const auto [count, index] = key;
    if (promise.seen.size() < promise.inputs)
      check_.again.push_back("shard " + std::to_string(index) + "/" + std::to_string(count) + ": only " +
                             std::to_string(promise.seen.size()) + " of its " +
                             std::to_string(promise.inputs) + " inputs have a line");
  }
  const auto say_missing = [this](int first, int last, int count) {
    const std::string number = std::to_string(first), of = "/" + std::to_string(count);
    if (first == last)
      check_.again.push_back("shard " + number + of + " has no manifest");
    else if (first < last)
      check_.again.push_back("shards " + number + " to " + std::to_string(last) + of + " have no manifest");
  };
  // In rising order. Consecutive missing shards are one line, because the file may claim any number.
  for (auto next = shards_.begin(); next != shards_.end();) {
    const int count = next->first.first;
    int expected = 1;
    for (; next != shards_.end() && next->first.first == count; ++next) {
      say_missing(expected, next->first.second - 1, count);
      expected = next->first.second + 1;
    }
    say_missing(expected, count, count);
  }
}

Check Checker::finish(const std::vector<Input>& inputs) {
  for (const auto& [input, line] : lines_) {
    try {
      check(input, line);
    } catch (const nlohmann::json::exception&) {
      check_.again.push_back(input + ": its line in the manifest cannot be read");
    }
  }
  check_shards();
  for (const Input& input : inputs)
    if (!lines_.count(input.label))
      check_.again.push_back(input.label + ": has no line in the manifest");
  return std::move(check_);
}

} // namespace

std::string manifest_head(const Options& options, std::size_t inputs) {
  std::error_code error;
  ordered_json json;
  json["manifest"] = format_version;
  json["tool"] = "terrainseg-process";
  json["version"] = TERRAINSEG_VERSION;
  json["output_dir"] = fs::weakly_canonical(options.output_dir, error).string();
  json["shard"] = options.shard.index;
  json["shards"] = options.shard.count;
  json["inputs"] = inputs;
  return as_line(json);
}

std::string manifest_line(const Options& options, const Input& input, const Outcome& outcome) {
  constexpr const char* names[Outcome::kinds] = {"complete", "partial", "failed", "interrupted", "skipped"};
  const Record& record = outcome.record;
  const bool skipped = outcome.kind == Outcome::Kind::skipped;
  const bool whole = skipped || outcome.kind == Outcome::Kind::complete;
  const Naming naming(options, input);
  ordered_json json;
  json["input"] = input.label;
  json["status"] = names[static_cast<int>(outcome.kind)];
  json["cause"] = whole ? ordered_json() : ordered_json(name_of(record.fault.cause));
  if (!whole)
    json["problem"] = record.fault.text;
  json["try_again"] = !whole && may_pass_later(record.fault.cause);
  const Identity identity = skipped ? input.identity() : record.identity;
  json["bytes"] = identity.bytes;
  json["fingerprint"] = identity.fingerprint;
  ordered_json outputs = ordered_json::object();
  for (const Output kind : skipped || outcome.kept() ? options.outputs() : std::vector<Output>()) {
    const fs::path path = naming.output(kind, !whole);
    std::error_code error;
    outputs[names_of(kind).name] = {{"file", path.lexically_relative(options.output_dir).string()},
                                    {"bytes", fs::file_size(path, error)},
                                    {"sha256", sha256_of(path)}};
  }
  json["outputs"] = outputs;
  return as_line(json);
}

bool is_manifest(const fs::path& path) {
  std::error_code error;
  if (!fs::is_regular_file(path, error))
    return false;
  std::ifstream file(path);
  std::string text(longest_head, '\0'); // another file may have no line ends
  file.getline(text.data(), longest_head);
  const auto json = nlohmann::json::parse(text.c_str(), nullptr, false);
  return json.is_object() && json.contains("manifest");
}

Check check_manifest(const Options& options, const std::vector<Input>& inputs) {
  std::ifstream file;
  if (options.check != "-")
    file.open(options.check);
  if (!file)
    throw EarlyExit{Exit::usage, "--check: cannot read " + options.check + ": " + std::strerror(errno)};
  Checker checker(options);
  if (!checker.read(options.check == "-" ? std::cin : file))
    throw EarlyExit{Exit::usage,
                    "--check: " + (options.check == "-" ? "what standard input gave" : options.check) +
                        " is not a manifest of this tool (--manifest FILE writes one)"};
  return checker.finish(inputs);
}

} // namespace terrainseg::process
