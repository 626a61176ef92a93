// SPDX-License-Identifier: LGPL-2.1-or-later
#include "tools/process/options.hpp"

#include <glib/gprintf.h>
#include <gst/gst.h>

#include <algorithm>
#include <fstream>
#include <iostream>
#include <iterator>
#include <sstream>

#include "tools/command_line.hpp"
#include "tools/process/handles.hpp"

namespace terrainseg::process {

using tools::OptionContext, tools::UsageError, tools::Word, tools::Words;

namespace {

constexpr const char* summary_text =
    R"(Learns the ground ahead of a rover and labels what is traversable, frame by frame, in videos, folders of
videos, and image sequences. Per input, in the output folder:
  NAME.annotated.mp4   the video with the traversable ground drawn on it (H.264)
  NAME.masks.mkv       the masks without loss (FFV1, GRAY8): 0 not, 128 doubtful, 255 traversable
  NAME.jsonl           one JSON object a frame (docs/terrain.schema.json)
  NAME.csv             one row a frame
  NAME.bag/            terrain.mcap and metadata.yaml, for Foxglove and ROS 2 (only with --outputs)
  NAME.summary.json    written last: what was done, with the sizes of the files above)";

constexpr const char* description_text =
    R"(INPUT is a video file, a folder (every video in it, and its images as one sequence), a numbered sequence
such as frames/%04d.png, or a URI that GStreamer reads. Audio is ignored.

Files get their names when they are complete. The decoded part of a damaged input is kept as
NAME.partial.*.

Exit codes: 0 all inputs are complete; 1 some are permanently damaged; 2 usage; 3 a GStreamer plugin
is missing; 4 the output folder is not writable; 75 try again (disk, memory, a missing input, SIGTERM);
130 Ctrl-C.

Examples:
  terrainseg-process --output-dir out drive.mp4
  terrainseg-process --output-dir out --resume --jobs 2 recordings/
  terrainseg-process --output-dir out --fps 15 'frames/%04d.png'
  terrainseg-process --set window-bottom=40 --set caution=8 --outputs json,csv drive.mp4)";

/// The values that GLib parses, before validation.
struct Given {
  Word output_dir, outputs, name, names, inputs_from, shard, manifest, check, preset, camera_info, mount, fps;
  Words settings, inputs;
  gint64 frames = 0;
  gboolean version = FALSE;
};

std::vector<GOptionEntry> entries_of(Given& given, Options& options) {
  return {
      {"output-dir", 'o', 0, G_OPTION_ARG_FILENAME, &given.output_dir.text,
       "Folder for the outputs, made if missing (default: the current one)", "DIR"},
      {"outputs", 0, 0, G_OPTION_ARG_STRING, &given.outputs.text,
       "Which: annotated,masks,json,csv,mcap (default: all but mcap)", "LIST"},
      {"name", 0, 0, G_OPTION_ARG_FILENAME, &given.name.text,
       "Name of the outputs of a single input; empty: annotated.mp4, masks.mkv, terrain.jsonl, terrain.csv",
       "NAME"},
      {"names", 0, 0, G_OPTION_ARG_STRING, &given.names.text,
       "How outputs are named: base (drive), path (as given: monday/drive), hash (drive-1f0c5a2e); "
       "default: base; with --inputs-from: path",
       "HOW"},
      {"inputs-from", 0, 0, G_OPTION_ARG_FILENAME, &given.inputs_from.text,
       "Inputs from a file or - for standard input: one a line, or ended by NUL (find -print0)", "FILE"},
      {"shard", 0, 0, G_OPTION_ARG_STRING, &given.shard.text,
       "Only the I-th of N shares of the inputs; auto: from a Slurm array or a Kubernetes indexed Job",
       "I/N"},
      {"manifest", 0, 0, G_OPTION_ARG_FILENAME, &given.manifest.text,
       "Write the result of every input, with the outputs' SHA-256, as JSON Lines", "FILE"},
      {"check", 0, 0, G_OPTION_ARG_FILENAME, &given.check.text,
       "Process nothing; list what is missing or damaged according to a manifest (- for standard input)",
       "FILE"},
      {"preset", 'p', 0, G_OPTION_ARG_STRING, &given.preset.text,
       "Settings of terrainseg to start from: default or paper", "PRESET"},
      {"set", 's', 0, G_OPTION_ARG_STRING_ARRAY, &given.settings.list,
       "Any property of terrainseg (gst-inspect-1.0 terrainseg); may be repeated", "PROPERTY=VALUE"},
      {"camera-info", 0, 0, G_OPTION_ARG_FILENAME, &given.camera_info.text,
       "Calibration of the camera (ROS, Kalibr or OpenCV YAML); with --mount json, csv and mcap have metres",
       "FILE"},
      {"mount", 0, 0, G_OPTION_ARG_FILENAME, &given.mount.text,
       "Pose of the camera over the ground: a file, or height=0.5,pitch=10deg", "MOUNT"},
      {"json-mask", 0, 0, G_OPTION_ARG_NONE, &options.json_mask,
       "Add the mask to the JSON lines, as run lengths", nullptr},
      {"fps", 0, 0, G_OPTION_ARG_STRING, &given.fps.text, "Frame rate of image sequences (default: 30)",
       "N[/D]"},
      {"frames", 0, 0, G_OPTION_ARG_INT64, &given.frames,
       "Only the first N frames of each input (default: all)", "N"},
      {"quality", 0, 0, G_OPTION_ARG_INT, &options.quality,
       "Quality of the annotated video, from 1 = best to 50 = smallest file (default: 21)", "Q"},
      {"resume", 'r', 0, G_OPTION_ARG_NONE, &options.resume,
       "Skip inputs whose outputs are complete and were made with the same settings", nullptr},
      {"jobs", 'j', 0, G_OPTION_ARG_INT, &options.jobs,
       "Number of inputs processed at the same time (default: 1)", "N"},
      {"stall-timeout", 0, 0, G_OPTION_ARG_INT, &options.stall_seconds,
       "Give up an input after this time without a frame, in seconds (default: 60)", "SECONDS"},
      {"threads", 0, 0, G_OPTION_ARG_INT, &options.threads,
       "Threads of the decoder and of each encoder of an input (default: available processors / jobs)", "N"},
      {"quiet", 'q', 0, G_OPTION_ARG_NONE, &options.quiet, "No progress and no summary, only problems",
       nullptr},
      {"version", 0, 0, G_OPTION_ARG_NONE, &given.version, "Print the version", nullptr},
      {"worker", 0, G_OPTION_FLAG_HIDDEN, G_OPTION_ARG_INT, &options.worker_socket, nullptr, nullptr},
      {G_OPTION_REMAINING, 0, 0, G_OPTION_ARG_FILENAME_ARRAY, &given.inputs.list, nullptr, "INPUT..."},
      {}};
}

std::optional<int> read_number(const char* text) {
  guint64 value = 0;
  if (!text || !g_ascii_string_to_unsigned(text, 10, 0, G_MAXINT, &value, nullptr))
    return std::nullopt;
  return static_cast<int>(value);
}

Shard from_environment() {
  const auto variable = [](const char* name) { return read_number(g_getenv(name)); };
  const auto fixed = variable("TERRAINSEG_SHARD_COUNT");
  if (const auto id = variable("SLURM_ARRAY_TASK_ID")) {
    const auto first = variable("SLURM_ARRAY_TASK_MIN"), count = variable("SLURM_ARRAY_TASK_COUNT");
    const int step = std::max(variable("SLURM_ARRAY_TASK_STEP").value_or(1), 1);
    if (!first || !count)
      throw UsageError("--shard auto: SLURM_ARRAY_TASK_ID is set, but not SLURM_ARRAY_TASK_MIN and "
                       "SLURM_ARRAY_TASK_COUNT");
    return Shard{(*id - *first) / step + 1, fixed.value_or(*count)};
  }
  if (const auto index = variable("JOB_COMPLETION_INDEX")) {
    if (!fixed)
      throw UsageError(
          "--shard auto: JOB_COMPLETION_INDEX is set, but TERRAINSEG_SHARD_COUNT, the Job's completions, "
          "is not");
    return Shard{*index + 1, *fixed};
  }
  throw UsageError(
      "--shard auto: neither SLURM_ARRAY_TASK_ID nor JOB_COMPLETION_INDEX is set; is this an array task?");
}

void read_outputs(const std::string& list, Options& options) {
  std::fill(std::begin(options.wanted), std::end(options.wanted), false);
  std::istringstream words(list + ",");
  for (std::string word; std::getline(words, word, ',');) {
    const auto index = std::ranges::find(output_kinds, word, &OutputKind::name) - output_kinds;
    if (index >= static_cast<int>(Output::bag))
      throw UsageError("--outputs: '" + word + "' is not one of annotated, masks, json, csv, mcap");
    options.wanted[index] = true;
  }
  options.wanted[static_cast<int>(Output::bag)] = options.wants(Output::mcap);
}

/// Removes the byte order mark of a text; converts UTF-16 with a mark (Windows) to UTF-8.
std::string plain_text(std::string text) {
  if (text.starts_with("\xEF\xBB\xBF"))
    return text.substr(3);
  const bool little = text.starts_with("\xFF\xFE");
  if (!little && !text.starts_with("\xFE\xFF"))
    return text;
  gsize length = 0;
  const CharPointer converted(g_convert(text.data() + 2, static_cast<gssize>(text.size() - 2), "UTF-8",
                                        little ? "UTF-16LE" : "UTF-16BE", nullptr, &length, nullptr));
  if (!converted)
    throw UsageError("--inputs-from: the list starts with a UTF-16 mark but is not valid UTF-16");
  return {converted.get(), length};
}

/// Appends the inputs of a list file or standard input. An empty list is valid: a shard may have no input.
void read_list(const std::string& name, std::vector<std::string>& inputs) {
  std::ifstream file;
  if (name != "-")
    file.open(name, std::ios::binary);
  std::istream& stream = name == "-" ? std::cin : file;
  const std::string text = plain_text({std::istreambuf_iterator<char>(stream), {}});
  if ((name != "-" && !file.is_open()) || stream.bad())
    throw UsageError("--inputs-from: cannot read " + name);
  const char separator = text.find('\0') != std::string::npos ? '\0' : '\n';
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line, separator);) {
    if (separator == '\n' && line.ends_with('\r')) // line end of Windows
      line.pop_back();
    if (!line.empty())
      inputs.push_back(std::move(line));
  }
}

/// The processors available to this process, divided by the jobs. Slurm's number counts if Slurm sets no
/// affinity.
int threads_per_job(int jobs) {
  guint processors = g_get_num_processors();
  if (const char* text = g_getenv("SLURM_CPUS_PER_TASK"))
    if (const guint64 given = g_ascii_strtoull(text, nullptr, 10); given > 0 && given < processors)
      processors = static_cast<guint>(given);
  return std::max(static_cast<int>(processors) / jobs, 1);
}

void read_name(const std::string& name, Options& options) {
  if (name.find('/') != std::string::npos)
    throw UsageError("--name: '" + name + "' contains a '/'; set the folder with --output-dir");
  if (name == "." || name == "..")
    throw UsageError("--name: '" + name + "' is a folder's name; use '' for output names without a stem");
  options.name = name;
}

void read_names(const std::string& text, Options& options) {
  if (text != "base" && text != "path" && text != "hash")
    throw UsageError("--names: '" + text + "' is not one of base, path, hash");
  options.names = text == "base" ? Names::base : text == "path" ? Names::path : Names::hash;
}

void read_fps(const std::string& text, Options& options) {
  GValue value = G_VALUE_INIT;
  g_value_init(&value, GST_TYPE_FRACTION);
  if (!gst_value_deserialize(&value, text.c_str()) || gst_value_get_fraction_numerator(&value) <= 0)
    throw UsageError("--fps: '" + text + "' is not a frame rate above 0, such as 15 or 30000/1001");
  options.fps_numerator = gst_value_get_fraction_numerator(&value);
  options.fps_denominator = gst_value_get_fraction_denominator(&value);
  options.fps_given = true;
}

/// Calibration is set by properties of terrainseg; the recording uses the same.
void read_settings(const Given& given, Options& options) {
  for (const std::string& setting : given.settings.all()) {
    const std::size_t equals = setting.find('=');
    if (equals == std::string::npos || equals == 0)
      throw UsageError("--set: '" + setting + "' is not PROPERTY=VALUE");
    options.settings.emplace_back(setting.substr(0, equals), setting.substr(equals + 1));
  }
  for (const auto& [name, word] : {std::pair("camera-info", &given.camera_info), {"mount", &given.mount}})
    if (word->text)
      options.settings.emplace_back(name, word->text);
  if (options.setting("camera-info").empty() != options.setting("mount").empty())
    throw UsageError("metres need both --camera-info and --mount");
}

void read_inputs(const Given& given, Options& options) {
  options.inputs = given.inputs.all();
  if (given.inputs_from.text && options.worker_socket < 0) // standard input can be read only once
    read_list(given.inputs_from.text, options.inputs);
  if (given.inputs_from.text)
    options.names = Names::path;
  if (options.inputs.empty() && !given.inputs_from.text && !given.check.text)
    throw UsageError("no INPUT given");
}

void check_ranges(gint64 frames, const Options& options) {
  if (frames < 0)
    throw UsageError("--frames: must be 0 (all) or more");
  const struct {
    const char* name;
    int value, least, most;
    const char* unit;
  } ranges[] = {{"--quality", options.quality, 1, 50, ""},
                {"--jobs", options.jobs, 1, 64, ""},
                {"--threads", options.threads, 0, 256, ""},
                {"--stall-timeout", options.stall_seconds, 1, 86400, " seconds"}};
  for (const auto& range : ranges)
    if (range.value < range.least || range.value > range.most)
      throw UsageError(std::string(range.name) + ": must be in " + std::to_string(range.least) + ".." +
                       std::to_string(range.most) + range.unit);
}

/// Validates the options and stores them.
void apply(const Given& given, Options& options) {
  const auto read = [&options](const Word& word, auto reader) {
    if (word.text)
      reader(word.text, options);
  };
  read_inputs(given, options);
  options.check = given.check.value();
  options.manifest = given.manifest.value();
  if (given.check.text && given.manifest.text)
    throw UsageError("--check and --manifest exclude each other: --check does not process inputs");
  if (given.shard.text)
    options.shard = read_shard(given.shard.text);
  options.output_dir_given = given.output_dir.text != nullptr;
  options.output_dir = given.output_dir.value(".");
  if (options.output_dir.empty())
    throw UsageError("--output-dir: the name is empty");
  read(given.name, read_name);
  read(given.names, read_names);
  options.preset = given.preset.value();
  read(given.outputs, read_outputs);
  read(given.fps, read_fps);
  read_settings(given, options);
  check_ranges(given.frames, options);
  if (options.threads == 0)
    options.threads = threads_per_job(options.jobs);
  options.max_frames = static_cast<std::uint64_t>(given.frames);
}

} // namespace

std::vector<Output> Options::outputs() const {
  std::vector<Output> all;
  for (int i = 0; i < output_count; ++i)
    if (wanted[i])
      all.push_back(static_cast<Output>(i));
  return all;
}

Shard read_shard(const std::string& text) {
  const auto written = [&text] {
    const std::size_t slash = text.find('/');
    const auto index = read_number(text.substr(0, slash).c_str()),
               count = slash == text.npos ? std::nullopt : read_number(text.c_str() + slash + 1);
    if (!index || !count)
      throw UsageError("--shard: '" + text + "' is neither I/N, such as 1/4, nor auto");
    return Shard{*index, *count};
  };
  const Shard shard = text == "auto" ? from_environment() : written();
  if (shard.index < 1 || shard.index > shard.count || shard.count > most_shards)
    throw UsageError("--shard: " + std::to_string(shard.index) + "/" + std::to_string(shard.count) +
                     " is not one of 1/N to N/N with N up to 1000000");
  return shard;
}

Options parse_options(const std::vector<std::string>& arguments) {
  Options options;
  Given given;
  const std::vector<GOptionEntry> entries = entries_of(given, options);
  const OptionContext context(g_option_context_new(nullptr));
  g_option_context_set_summary(context.get(), summary_text);
  g_option_context_set_description(context.get(), description_text);
  g_option_context_add_main_entries(context.get(), entries.data(), nullptr);
  g_option_context_add_group(context.get(), gst_init_get_option_group());
  try {
    tools::parse(context.get(), {arguments.begin() + 1, arguments.end()}, arguments.front().c_str());
    if (given.version) {
      g_printf("terrainseg-process %s\n", TERRAINSEG_VERSION);
      throw EarlyExit{Exit::ok, {}};
    }
    apply(given, options);
  } catch (const UsageError& error) {
    throw EarlyExit{Exit::usage, error.what() + std::string("\nTry 'terrainseg-process --help'.")};
  }
  return options;
}

} // namespace terrainseg::process
