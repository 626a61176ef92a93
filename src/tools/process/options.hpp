// SPDX-License-Identifier: LGPL-2.1-or-later
// The command line as a value.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <utility>
#include <variant>
#include <vector>

namespace terrainseg::process {

/// Exit codes, the same numbers as in docs/tasks/files.md.
enum class Exit : int {
  ok = 0,          ///< every input was processed whole, or skipped because it was whole already
  some_failed = 1, ///< at least one input failed, or was kept in part
  usage = 2,       ///< a wrong option, setting or value; nothing was touched
  environment = 3, ///< a GStreamer plugin is missing; nothing was touched
  output = 4,      ///< the output folder cannot be written; nothing was touched
};

/// What is written for an input, in the order of `output_kinds`.
enum class Output : std::uint8_t { annotated, masks, json, csv };
inline constexpr int output_count = 4;

struct OutputKind {
  const char* name;   ///< in --outputs
  const char* suffix; ///< after the input's name
};
inline constexpr OutputKind output_kinds[output_count] = {
    {"annotated", "annotated.mp4"}, {"masks", "masks.mkv"}, {"json", "jsonl"}, {"csv", "csv"}};

struct Options {
  std::vector<std::string> inputs; ///< as given, in the file system's encoding
  std::filesystem::path output_dir = ".";
  std::optional<std::string> name; ///< --name: instead of the input's own
  bool wanted[output_count] = {true, true, true, true};
  bool json_mask = false;
  std::string preset; ///< empty = the element's default
  std::vector<std::pair<std::string, std::string>> settings;
  int fps_numerator = 30, fps_denominator = 1; ///< of image sequences
  std::uint64_t max_frames = 0;                ///< 0 = all
  int quality = 21;                            ///< H.264 constant quality, 1 best .. 50
  int jobs = 1;
  bool resume = false;
  bool quiet = false;
};

/// Why the program ends before it starts: 0 for --version, a text for stderr otherwise.
struct EarlyExit {
  Exit code;
  std::string message;
};

/// Reads the command line; also initialises GStreamer (its own --gst-... options are understood).
std::variant<Options, EarlyExit> parse_options(int argc, char** argv);

} // namespace terrainseg::process
