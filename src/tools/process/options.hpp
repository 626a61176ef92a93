// SPDX-License-Identifier: LGPL-2.1-or-later
// The command line as a plain value.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "tools/process/inputs.hpp"

namespace terrainseg::process {

/// Exit codes, as documented in docs/tasks/files.md.
enum class Exit : int {
  ok = 0,            ///< every input was processed completely, or skipped because it was complete
  damaged = 1,       ///< an input is permanently damaged: another attempt gives the same result
  usage = 2,         ///< a wrong option, setting or value, or a name conflict; nothing was written
  environment = 3,   ///< a GStreamer plugin is missing; nothing was written
  output = 4,        ///< the output folder is not writable; nothing was written
  try_again = 75,    ///< EX_TEMPFAIL: disk, memory, a missing input, SIGTERM. Has priority over 1.
  interrupted = 130, ///< Ctrl-C
};

/// The outputs of an input, in the order of `output_kinds`. `bag` is the metadata.yaml of a recording and is
/// written with it.
enum class Output : std::uint8_t { annotated, masks, json, csv, mcap, bag };
inline constexpr int output_count = 6;

struct OutputKind {
  const char* name;   ///< value in --outputs
  const char* suffix; ///< appended to the input's name
  const char* bare;   ///< complete name if the input's name is left out
};
inline constexpr OutputKind output_kinds[output_count] = {
    {"annotated", "annotated.mp4", "annotated.mp4"},
    {"masks", "masks.mkv", "masks.mkv"},
    {"json", "jsonl", "terrain.jsonl"},
    {"csv", "csv", "terrain.csv"},
    {"mcap", "bag/terrain.mcap", "terrain.bag/terrain.mcap"},
    {"mcap-metadata", "bag/metadata.yaml", "terrain.bag/metadata.yaml"}};

inline const OutputKind& names_of(Output kind) {
  return output_kinds[static_cast<int>(kind)];
}

struct Options {
  std::vector<std::string> inputs; ///< as given, in the encoding of the file system
  std::filesystem::path output_dir = ".";
  bool output_dir_given = false;
  Shard shard;
  std::filesystem::path manifest;  ///< empty = no manifest
  std::string check;               ///< a manifest to verify instead of processing, "-" = standard input
  std::optional<std::string> name; ///< --name: replaces the input's name
  Names names = Names::base;
  bool wanted[output_count] = {true, true, true, true, false, false};
  int json_mask = false; ///< as `resume` and `quiet` an int, which GLib sets
  std::string preset;    ///< empty = default of the element
  std::vector<std::pair<std::string, std::string>> settings;
  int fps_numerator = 30, fps_denominator = 1; ///< frame rate of image sequences
  bool fps_given = false;
  std::uint64_t max_frames = 0; ///< 0 = all
  int quality = 21;             ///< H.264 constant quality, 1 best .. 50
  int jobs = 1;
  int threads = 0;        ///< of decoder and encoders of one input; 0 = available processors / jobs
  int stall_seconds = 60; ///< seconds without a frame after which an input is given up
  int resume = false, quiet = false;
  int worker_socket = -1; ///< of a worker process (worker.hpp); -1 = this is none

  bool wants(Output kind) const { return wanted[static_cast<int>(kind)]; }
  /// The outputs that are wanted, in their order.
  std::vector<Output> outputs() const;
  /// The value of a property of terrainseg; the last one of several. Empty if it is not set.
  std::string setting(std::string_view name) const {
    for (auto each = settings.rbegin(); each != settings.rend(); ++each)
      if (each->first == name)
        return each->second;
    return {};
  }
};

/// Thrown when the program ends before it starts: 0 for --version, otherwise an error text for stderr.
struct EarlyExit {
  Exit code = Exit::ok;
  std::string message;
};

/// Parses the command line, including the program's name. Also initialises GStreamer and applies its
/// --gst-... options. Throws EarlyExit.
Options parse_options(const std::vector<std::string>& arguments);

/// Parses --shard: "I/N" with I in 1..N, or "auto": from the environment, either a Slurm array
/// (SLURM_ARRAY_TASK_ID, _MIN, _STEP and _COUNT) or a Kubernetes indexed Job (JOB_COMPLETION_INDEX, from 0,
/// and TERRAINSEG_SHARD_COUNT). Throws tools::UsageError if that is invalid.
Shard read_shard(const std::string& text);

} // namespace terrainseg::process
