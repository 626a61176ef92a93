// SPDX-License-Identifier: LGPL-2.1-or-later
// The command line as a value.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <variant>
#include <vector>

#include "tools/process/inputs.hpp"
#include "tools/process/shard.hpp"

namespace terrainseg::process {

/// Exit codes, the same numbers as in docs/tasks/files.md.
enum class Exit : int {
  ok = 0,          ///< every input was processed whole, or skipped because it was whole already
  damaged = 1,     ///< some input is damaged for good: trying again changes nothing
  usage = 2,       ///< a wrong option, setting, value or a name that clashes; nothing was touched
  environment = 3, ///< a GStreamer plugin is missing; nothing was touched
  output = 4,      ///< the output folder cannot be written; nothing was touched
  try_again = 75, ///< EX_TEMPFAIL: disk, memory, an input that is not there yet, SIGTERM; 1 is left for later
};

/// What is written for an input, in the order of `output_kinds`.
/// A bag is the metadata.yaml beside a recording, which is wanted with it.
enum class Output : std::uint8_t { annotated, masks, json, csv, mcap, bag };
inline constexpr int output_count = 6;

struct OutputKind {
  const char* name;   ///< in --outputs
  const char* suffix; ///< after the input's name
  const char* bare;   ///< the whole name where the input's is left out
};
inline constexpr OutputKind output_kinds[output_count] = {
    {"annotated", "annotated.mp4", "annotated.mp4"},
    {"masks", "masks.mkv", "masks.mkv"},
    {"json", "jsonl", "terrain.jsonl"},
    {"csv", "csv", "terrain.csv"},
    {"mcap", "bag/terrain.mcap", "terrain.bag/terrain.mcap"},
    {"mcap-metadata", "bag/metadata.yaml", "terrain.bag/metadata.yaml"}};

struct Options {
  std::vector<std::string> inputs; ///< as given, in the file system's encoding
  std::filesystem::path output_dir = ".";
  bool output_dir_given = false;
  Shard shard;
  std::filesystem::path manifest;  ///< empty = none is written
  std::string check;               ///< a manifest to check instead of processing, "-" = standard input
  std::optional<std::string> name; ///< --name: instead of the input's own
  Names names = Names::base;
  bool wanted[output_count] = {true, true, true, true, false, false};
  bool json_mask = false;
  std::string preset; ///< empty = the element's default
  std::vector<std::pair<std::string, std::string>> settings;
  int fps_numerator = 30, fps_denominator = 1; ///< of image sequences
  bool fps_given = false;
  std::uint64_t max_frames = 0; ///< 0 = all
  int quality = 21;             ///< H.264 constant quality, 1 best .. 50
  int jobs = 1;
  int threads =
      0; ///< of the decoder and the encoders of one input; 0 = the processors allowed, over the jobs
  int stall_seconds = 60; ///< without a frame: the input is given up
  bool resume = false;
  bool quiet = false;
  std::optional<int> worker_socket; ///< of a program that works for another of its kind (worker.hpp)

  /// The value that a property of terrainseg is set to, the last one counting; empty when it is not set.
  std::string setting(std::string_view name) const {
    for (auto each = settings.rbegin(); each != settings.rend(); ++each)
      if (each->first == name)
        return each->second;
    return {};
  }
};

/// Why the program ends before it starts: 0 for --version, a text for stderr otherwise.
struct EarlyExit {
  Exit code;
  std::string message;
};

/// Reads the command line, the name of the program first; also initialises GStreamer (its own --gst-...
/// options are understood).
std::variant<Options, EarlyExit> parse_options(const std::vector<std::string>& arguments);

} // namespace terrainseg::process
