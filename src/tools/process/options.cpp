// SPDX-License-Identifier: LGPL-2.1-or-later
#include "tools/process/options.hpp"

#include <glib/gprintf.h>
#include <gst/gst.h>

#include <algorithm>
#include <cstring>
#include <fstream>
#include <iostream>
#include <iterator>
#include <memory>

#include "tools/process/handles.hpp"

namespace terrainseg::process {
namespace {

constexpr const char* summary_text =
    "Learns the ground ahead of a rover and labels what is traversable, frame by frame, in videos, folders "
    "of\n"
    "videos, and image sequences. Per input, in the output folder:\n"
    "  NAME.annotated.mp4   the video with the traversable ground drawn on it (H.264)\n"
    "  NAME.masks.mkv       the masks without loss (FFV1, GRAY8): 0 not, 128 doubtful, 255 traversable\n"
    "  NAME.jsonl           one JSON object a frame (docs/terrain.schema.json)\n"
    "  NAME.csv             one row a frame\n"
    "  NAME.bag/            terrain.mcap and metadata.yaml, for Foxglove and ROS 2 (only with --outputs)\n"
    "  NAME.summary.json    written last: what was done, with the sizes of the files above";

constexpr const char* description_text =
    "INPUT is a video file, a folder (every video in it, and its images as one sequence), a numbered "
    "sequence\n"
    "such as frames/%04d.png, or a URI that GStreamer reads. Audio is ignored.\n"
    "\n"
    "Files appear under their name only when they are whole. Of a damaged input what could be decoded is "
    "kept\n"
    "as NAME.partial.*.\n"
    "\n"
    "Exit codes: 0 all inputs are whole; 1 some are damaged for good; 2 usage; 3 a GStreamer plugin is "
    "missing;\n"
    "4 the output folder cannot be written; 75 try again (disk, memory, an input that is not there, "
    "SIGTERM);\n"
    "130 Ctrl-C.\n"
    "\n"
    "Examples:\n"
    "  terrainseg-process --output-dir out drive.mp4\n"
    "  terrainseg-process --output-dir out --resume --jobs 2 recordings/\n"
    "  terrainseg-process --output-dir out --fps 15 'frames/%04d.png'\n"
    "  terrainseg-process --set window-bottom=40 --set caution=8 --outputs json,csv drive.mp4";

EarlyExit usage(const std::string& message) {
  return {Exit::usage, message + "\nTry 'terrainseg-process --help'."};
}

std::optional<std::string> read_outputs(const char* list, Options& options) {
  for (bool& wanted : options.wanted)
    wanted = false;
  const std::string text = list;
  std::size_t begin = 0;
  while (begin <= text.size()) {
    const std::size_t comma = std::min(text.find(',', begin), text.size());
    const std::string word = text.substr(begin, comma - begin);
    begin = comma + 1;
    bool known = false;
    for (int i = 0; i < static_cast<int>(Output::bag); ++i)
      if (word == output_kinds[i].name)
        known = options.wanted[i] = true;
    if (!known)
      return "--outputs: '" + word + "' is none of annotated, masks, json, csv, mcap";
  }
  options.wanted[static_cast<int>(Output::bag)] = options.wanted[static_cast<int>(Output::mcap)];
  return std::nullopt;
}

/// Appends the inputs that a file or standard input lists. An empty list is one: a shard may have no share.
std::optional<std::string> read_list(const std::string& name, std::vector<std::string>& inputs) {
  std::ifstream file;
  if (name != "-")
    file.open(name, std::ios::binary);
  std::istream& stream = name == "-" ? std::cin : file;
  const std::string text{std::istreambuf_iterator<char>(stream), {}};
  if ((name != "-" && !file.is_open()) || stream.bad())
    return "--inputs-from: cannot read " + name;
  const char separator = text.find('\0') != std::string::npos ? '\0' : '\n';
  std::size_t begin = 0;
  while (begin < text.size()) {
    const std::size_t end = std::min(text.find(separator, begin), text.size());
    std::string line = text.substr(begin, end - begin);
    if (separator == '\n' && !line.empty() && line.back() == '\r') // a list from Windows
      line.pop_back();
    if (!line.empty())
      inputs.push_back(std::move(line));
    begin = end + 1;
  }
  return std::nullopt;
}

/// The processors that this process may use, shared out among the jobs; Slurm's word counts where it binds
/// none.
int threads_per_job(int jobs) {
  guint processors = g_get_num_processors();
  if (const char* text = g_getenv("SLURM_CPUS_PER_TASK"))
    if (const guint64 given = g_ascii_strtoull(text, nullptr, 10); given > 0 && given < processors)
      processors = static_cast<guint>(given);
  return std::max(static_cast<int>(processors) / jobs, 1);
}

std::optional<std::string> read_names(const std::string& text, Options& options) {
  if (text != "base" && text != "path" && text != "hash")
    return "--names: '" + text + "' is none of base, path, hash";
  options.names = text == "base" ? Names::base : text == "path" ? Names::path : Names::hash;
  return std::nullopt;
}

std::optional<std::string> read_fps(const char* text, Options& options) {
  GValue value = G_VALUE_INIT;
  g_value_init(&value, GST_TYPE_FRACTION);
  const bool ok = gst_value_deserialize(&value, text) && gst_value_get_fraction_numerator(&value) > 0;
  if (ok) {
    options.fps_numerator = gst_value_get_fraction_numerator(&value);
    options.fps_denominator = gst_value_get_fraction_denominator(&value);
  }
  g_value_unset(&value);
  if (!ok)
    return std::string("--fps: '") + text + "' is no frame rate above 0 such as 15 or 30000/1001";
  return std::nullopt;
}

} // namespace

std::variant<Options, EarlyExit> parse_options(int argc, char** argv) {
  Options options;
  char* output_dir = nullptr;
  char* name = nullptr;
  char* outputs = nullptr;
  char* names = nullptr;
  char* inputs_from = nullptr;
  char* shard = nullptr;
  char* manifest = nullptr;
  char* check = nullptr;
  char* preset = nullptr;
  char* camera_info = nullptr;
  char* mount = nullptr;
  char* fps = nullptr;
  char** settings = nullptr;
  char** inputs = nullptr;
  gint64 frames = 0;
  int worker_socket = -1;
  gboolean json_mask = FALSE, resume = FALSE, quiet = FALSE, version = FALSE;
  const GOptionEntry entries[] = {
      {"output-dir", 'o', 0, G_OPTION_ARG_FILENAME, &output_dir,
       "Folder for the outputs, made if missing (default: the current one)", "DIR"},
      {"outputs", 0, 0, G_OPTION_ARG_STRING, &outputs,
       "Which: annotated,masks,json,csv,mcap (default: all but mcap)", "LIST"},
      {"name", 0, 0, G_OPTION_ARG_FILENAME, &name,
       "Name of the outputs of a single input; empty: annotated.mp4, masks.mkv, terrain.jsonl, terrain.csv",
       "NAME"},
      {"names", 0, 0, G_OPTION_ARG_STRING, &names,
       "How outputs are named: base (drive), path (as it was written: monday/drive), hash (drive-1f0c5a2e); "
       "default: base; with --inputs-from: path",
       "HOW"},
      {"inputs-from", 0, 0, G_OPTION_ARG_FILENAME, &inputs_from,
       "Inputs from a file or - for standard input: one a line, or ended by NUL (find -print0)", "FILE"},
      {"shard", 0, 0, G_OPTION_ARG_STRING, &shard,
       "Only the I-th of N shares of the inputs; auto: as Slurm's array or a Kubernetes indexed Job says",
       "I/N"},
      {"manifest", 0, 0, G_OPTION_ARG_FILENAME, &manifest,
       "Write what became of every input, with the outputs' SHA-256, as JSON Lines", "FILE"},
      {"check", 0, 0, G_OPTION_ARG_FILENAME, &check,
       "Process nothing: name what is missing or damaged of what a manifest promises (- for standard input)",
       "FILE"},
      {"preset", 'p', 0, G_OPTION_ARG_STRING, &preset,
       "Settings of terrainseg to start from: default or paper", "PRESET"},
      {"set", 's', 0, G_OPTION_ARG_STRING_ARRAY, &settings,
       "Any property of terrainseg (gst-inspect-1.0 terrainseg); may be repeated", "PROPERTY=VALUE"},
      {"camera-info", 0, 0, G_OPTION_ARG_FILENAME, &camera_info,
       "Calibration of the camera (ROS, Kalibr or OpenCV YAML); with --mount json, csv and mcap have metres",
       "FILE"},
      {"mount", 0, 0, G_OPTION_ARG_FILENAME, &mount,
       "How the camera stands over the ground: a file, or height=0.5,pitch=10deg", "MOUNT"},
      {"json-mask", 0, 0, G_OPTION_ARG_NONE, &json_mask, "Put the mask into the JSON lines, as run lengths",
       nullptr},
      {"fps", 0, 0, G_OPTION_ARG_STRING, &fps, "Frame rate of image sequences (default: 30)", "N[/D]"},
      {"frames", 0, 0, G_OPTION_ARG_INT64, &frames, "Only the first N frames of each input (default: all)",
       "N"},
      {"quality", 0, 0, G_OPTION_ARG_INT, &options.quality,
       "Of the annotated video, 1 best to 50 smallest (default: 21)", "Q"},
      {"resume", 'r', 0, G_OPTION_ARG_NONE, &resume,
       "Skip inputs whose outputs are whole and were made with the same settings", nullptr},
      {"jobs", 'j', 0, G_OPTION_ARG_INT, &options.jobs, "Inputs processed at a time (default: 1)", "N"},
      {"stall-timeout", 0, 0, G_OPTION_ARG_INT, &options.stall_seconds,
       "Give an input up when no frame came for so long, in seconds (default: 60)", "SECONDS"},
      {"threads", 0, 0, G_OPTION_ARG_INT, &options.threads,
       "Of the decoder and of each encoder of an input (default: the processors allowed, over --jobs)", "N"},
      {"quiet", 'q', 0, G_OPTION_ARG_NONE, &quiet, "No progress and no summary, only problems", nullptr},
      {"version", 0, 0, G_OPTION_ARG_NONE, &version, "Print the version", nullptr},
      {"worker", 0, G_OPTION_FLAG_HIDDEN, G_OPTION_ARG_INT, &worker_socket, nullptr, nullptr},
      {G_OPTION_REMAINING, 0, 0, G_OPTION_ARG_FILENAME_ARRAY, &inputs, nullptr, "INPUT..."},
      {}};

  GOptionContext* context = g_option_context_new(nullptr);
  g_option_context_set_summary(context, summary_text);
  g_option_context_set_description(context, description_text);
  g_option_context_add_main_entries(context, entries, nullptr);
  g_option_context_add_group(context, gst_init_get_option_group());
  GError* error = nullptr;
  const bool parsed = g_option_context_parse(context, &argc, &argv, &error);
  g_option_context_free(context);

  const CharPointer owned[] = {CharPointer(output_dir),  CharPointer(name), CharPointer(outputs),
                               CharPointer(preset),      CharPointer(fps),  CharPointer(names),
                               CharPointer(camera_info), CharPointer(mount)};
  const StringArray owned_arrays[] = {StringArray(settings), StringArray(inputs)};
  if (!parsed) {
    const EarlyExit result = usage(error->message);
    g_error_free(error);
    return result;
  }
  if (version) {
    g_printf("terrainseg-process %s\n", TERRAINSEG_VERSION);
    return EarlyExit{Exit::ok, {}};
  }

  for (char** input = inputs; input && *input; ++input)
    options.inputs.emplace_back(*input);
  if (worker_socket >= 0)
    options.worker_socket = worker_socket;
  else if (inputs_from) // may be standard input, which can be read but once
    if (auto problem = read_list(inputs_from, options.inputs))
      return usage(*problem);
  if (inputs_from)
    options.names = Names::path;
  if (check)
    options.check = check;
  if (options.inputs.empty() && !inputs_from && !check)
    return usage("no INPUT given");
  if (manifest)
    options.manifest = manifest;
  if (check && manifest)
    return usage("--check processes nothing, so there is nothing for --manifest");
  if (shard) {
    auto result = read_shard(shard);
    if (const std::string* problem = std::get_if<std::string>(&result))
      return usage(*problem);
    options.shard = std::get<Shard>(result);
  }
  options.output_dir_given = output_dir != nullptr;
  if (output_dir)
    options.output_dir = output_dir;
  if (options.output_dir.empty())
    return usage("--output-dir: an empty name is no folder");
  if (name) {
    options.name = name;
    if (options.name->find('/') != std::string::npos)
      return usage("--name: '" + *options.name + "' holds a '/'; the folder is --output-dir");
    if (*options.name == "." || *options.name == "..")
      return usage("--name: '" + *options.name + "' is a folder's name; '' leaves the name out");
  }
  if (names)
    if (auto problem = read_names(names, options))
      return usage(*problem);
  if (preset)
    options.preset = preset;
  if (outputs)
    if (auto problem = read_outputs(outputs, options))
      return usage(*problem);
  options.fps_given = fps != nullptr;
  if (fps)
    if (auto problem = read_fps(fps, options))
      return usage(*problem);
  for (char** setting = settings; setting && *setting; ++setting) {
    const char* equals = std::strchr(*setting, '=');
    if (!equals || equals == *setting)
      return usage(std::string("--set: '") + *setting + "' is no PROPERTY=VALUE");
    options.settings.emplace_back(std::string_view(*setting, static_cast<std::size_t>(equals - *setting)),
                                  std::string(equals + 1));
  }
  // Settings of terrainseg like any other, which the recording takes too.
  if (camera_info)
    options.settings.emplace_back("camera-info", camera_info);
  if (mount)
    options.settings.emplace_back("mount", mount);
  if (options.setting("camera-info").empty() != options.setting("mount").empty())
    return usage("metres take both --camera-info and --mount");
  if (frames < 0)
    return usage("--frames: must be 0 (all) or more");
  if (options.quality < 1 || options.quality > 50)
    return usage("--quality: must lie in 1..50");
  if (options.jobs < 1 || options.jobs > 64)
    return usage("--jobs: must lie in 1..64");
  if (options.threads < 0 || options.threads > 256)
    return usage("--threads: must lie in 0..256");
  if (options.threads == 0)
    options.threads = threads_per_job(options.jobs);
  if (options.stall_seconds < 1 || options.stall_seconds > 86400)
    return usage("--stall-timeout: must lie in 1..86400 seconds");
  options.max_frames = static_cast<std::uint64_t>(frames);
  options.json_mask = json_mask;
  options.resume = resume;
  options.quiet = quiet;
  return options;
}

} // namespace terrainseg::process
