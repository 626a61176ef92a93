// SPDX-License-Identifier: LGPL-2.1-or-later
#include "tools/calibrate/options.hpp"

#include <numbers>

#include "tools/calibrate/files.hpp"
#include "tools/command_line.hpp"

namespace terrainseg::calibrate {
namespace {

using tools::OptionContext, tools::UsageError, tools::Word, tools::Words;

constexpr const char* overview =
    "usage: terrainseg-calibrate COMMAND [OPTIONS]\n\n"
    "  camera FOLDER   the lens, from pictures of a chessboard: writes a ROS camera_info file\n"
    "  mount           height, pitch and roll of the camera, from points of flat ground: writes a mount "
    "file\n"
    "  check [LINES]   whether a recording (JSON lines) and a picture agree with both\n\n"
    "terrainseg-calibrate COMMAND --help lists the options; docs/tasks/calibration.md shows the way.\n"
    "Exit code: 0 done and in agreement, 1 something could not be read, does not fit or does not agree, 2 "
    "wrong "
    "usage.\n";

constexpr GOptionEntry end{nullptr, 0, 0, G_OPTION_ARG_NONE, nullptr, nullptr, nullptr};

/// Parses the arguments into the targets of the entries.
void parse(const std::vector<GOptionEntry>& entries, const char* arguments, const char* summary,
           const std::vector<std::string>& words, const char* name) {
  const OptionContext context(g_option_context_new(arguments));
  g_option_context_add_main_entries(context.get(), entries.data(), nullptr);
  g_option_context_set_summary(context.get(), summary);
  tools::parse(context.get(), words, name);
}

/// The arguments that are not options.
std::string only_one(const Words& words, const char* what) {
  const auto all = words.all();
  if (all.size() > 1)
    throw UsageError(std::string("more than one ") + what + ": " + all[1]);
  return all.empty() ? std::string() : all.front();
}

void need(const std::string& value, const char* option) {
  if (value.empty())
    throw UsageError(std::string(option) + " is missing");
}

/// Parses numbers of the command line; errors are usage errors.
template <class Read> auto used(Read read) -> decltype(read()) {
  try {
    return read();
  } catch (const std::runtime_error& error) {
    throw UsageError(error.what());
  }
}

std::optional<double> metres(const Word& word, const char* option) {
  if (!word.text)
    return std::nullopt;
  return used([&] { return parse_number(word.value(), option); });
}

/// Degrees, or radians if the suffix is `rad`.
std::optional<double> angle(const Word& word, const char* option) {
  if (!word.text)
    return std::nullopt;
  std::string text = word.value();
  const auto ends = [&](const char* suffix) {
    const std::string s(suffix);
    return text.size() > s.size() && text.compare(text.size() - s.size(), s.size(), s) == 0;
  };
  double unit = std::numbers::pi / 180;
  if (ends("rad"))
    unit = 1;
  if (ends("rad") || ends("deg"))
    text.resize(text.size() - 3);
  const double value = used([&] { return parse_number(text, option); }) * unit;
  if (std::abs(value) > std::numbers::pi)
    throw UsageError(std::string(option) + ": '" + word.value() + "' is more than half a turn");
  return value;
}

void check_picture(const std::string& frame, const std::string& picture) {
  if (!picture.empty())
    need(frame, "--frame FILE, over which --picture draws,");
}

} // namespace

std::string help() {
  return overview;
}

CameraOptions parse_camera(const std::vector<std::string>& words) {
  Words rest;
  Word board, square, out;
  gboolean fisheye = FALSE;
  parse(
      {{"board", 0, 0, G_OPTION_ARG_STRING, &board.text,
        "Inner corners of the board (default: 9x6, a board of 10x7 squares)", "COLUMNSxROWS"},
       {"fisheye", 0, 0, G_OPTION_ARG_NONE, &fisheye,
        "For lenses of 120 degrees and more: the equidistant model instead of plumb_bob", nullptr},
       {"out", 0, 0, G_OPTION_ARG_FILENAME, &out.text, "Output file (default: camera.yaml)", "FILE"},
       {G_OPTION_REMAINING, 0, 0, G_OPTION_ARG_FILENAME_ARRAY, &rest.list, nullptr, nullptr},
       end},
      "FOLDER",
      "Calibrates a lens from pictures of a chessboard: 20 of them, in the size that the camera delivers to "
      "the\nfilter, the board tilted by up to 45 degrees in all directions, near the corners of the picture "
      "too.",
      words, "terrainseg-calibrate camera");
  CameraOptions o;
  o.folder = only_one(rest, "FOLDER");
  need(o.folder, "FOLDER");
  if (board.text)
    o.board = used([&] { return parse_board(board.value()); });
  o.fisheye = fisheye;
  o.out = out.value("camera.yaml");
  return o;
}

MountOptions parse_mount(const std::vector<std::string>& words) {
  Words points, rest;
  Word camera, file, height, roll, yaw, x, y, out, frame, picture;
  parse(
      {{"camera-info", 0, 0, G_OPTION_ARG_FILENAME, &camera.text,
        "The lens: ROS camera_info, Kalibr or OpenCV YAML", "FILE"},
       {"point", 'p', 0, G_OPTION_ARG_STRING_ARRAY, &points.list,
        "A point of flat ground, at least twice: its pixel, and its distance over ground from the point "
        "below "
        "the lens",
        "COLUMN,ROW,METRES"},
       {"points", 0, 0, G_OPTION_ARG_FILENAME, &file.text, "Points from a file, one a line", "FILE"},
       {"height", 0, 0, G_OPTION_ARG_STRING, &height.text, "Measured height of the lens over the ground",
        "METRES"},
       {"roll", 0, 0, G_OPTION_ARG_STRING, &roll.text,
        "Known roll, positive = right side down (default: fitted to four or more points, with --height to "
        "two "
        "or more, if they determine it; otherwise 0)",
        "DEGREES"},
       {"yaw", 0, 0, G_OPTION_ARG_STRING, &yaw.text,
        "Copied to the file, positive = the camera looks to the left", "DEGREES"},
       {"x", 0, 0, G_OPTION_ARG_STRING, &x.text,
        "Copied to the file: distance of the lens ahead of the origin", "METRES"},
       {"y", 0, 0, G_OPTION_ARG_STRING, &y.text,
        "Copied to the file: distance of the lens to the left of the origin", "METRES"},
       {"frame", 0, 0, G_OPTION_ARG_FILENAME, &frame.text,
        "The picture in which the pixels were read: needed for --picture, and if its size is not the "
        "calibration's",
        "FILE"},
       {"picture", 0, 0, G_OPTION_ARG_FILENAME, &picture.text,
        "Draws metres over the frame: a PNG or JPEG file", "FILE"},
       {"out", 0, 0, G_OPTION_ARG_FILENAME, &out.text, "Output file (default: mount.yaml)", "FILE"},
       {G_OPTION_REMAINING, 0, 0, G_OPTION_ARG_FILENAME_ARRAY, &rest.list, nullptr, nullptr},
       end},
      nullptr,
      "Fits the pose of the camera to points of flat ground at measured distances: two or more, one near the "
      "lower\nedge, one at least twice as far. Four points on both sides also give the roll.",
      words, "terrainseg-calibrate mount");
  if (const auto more = rest.all(); !more.empty())
    throw UsageError(more.front() + ": not an option");
  MountOptions o;
  o.camera_info = camera.value();
  need(o.camera_info, "--camera-info FILE");
  for (const std::string& point : points.all())
    o.points.push_back(used([&] { return parse_point(point); }));
  if (file.text)
    try {
      for (const MeasuredPoint& point : parse_points(read_file(file.value())))
        o.points.push_back(point);
    } catch (const std::runtime_error& error) {
      throw std::runtime_error(file.value() + ": " + error.what());
    }
  if (o.points.empty())
    throw UsageError("no --point is given");
  o.known.height = metres(height, "--height");
  o.known.roll = angle(roll, "--roll");
  o.known.yaw = angle(yaw, "--yaw").value_or(0);
  o.known.x = metres(x, "--x").value_or(0);
  o.known.y = metres(y, "--y").value_or(0);
  o.frame = frame.value();
  o.picture = picture.value();
  check_picture(o.frame, o.picture);
  o.out = out.value("mount.yaml");
  return o;
}

CheckOptions parse_check(const std::vector<std::string>& words) {
  Words rest;
  Word camera, mount, frame, picture;
  parse(
      {{"camera-info", 0, 0, G_OPTION_ARG_FILENAME, &camera.text,
        "The lens: ROS camera_info, Kalibr or OpenCV YAML", "FILE"},
       {"mount", 0, 0, G_OPTION_ARG_FILENAME, &mount.text,
        "The mount: a file, or its text (height=0.5,pitch=10deg)", "FILE|TEXT"},
       {"frame", 0, 0, G_OPTION_ARG_FILENAME, &frame.text, "A picture of the camera, for --picture", "FILE"},
       {"picture", 0, 0, G_OPTION_ARG_FILENAME, &picture.text,
        "Draws metres over the frame: a PNG or JPEG file", "FILE"},
       {G_OPTION_REMAINING, 0, 0, G_OPTION_ARG_FILENAME_ARRAY, &rest.list, nullptr, nullptr},
       end},
      "[LINES]",
      "Compares the horizon that terrainseg found in a recording with the mount's, and draws metres over a "
      "picture.\nLINES are JSON lines of terrainextract, or of terrainseg-process.",
      words, "terrainseg-calibrate check");
  CheckOptions o;
  o.lines = only_one(rest, "LINES");
  o.camera_info = camera.value();
  o.mount = mount.value();
  o.frame = frame.value();
  o.picture = picture.value();
  need(o.camera_info, "--camera-info FILE");
  need(o.mount, "--mount FILE");
  check_picture(o.frame, o.picture);
  if (o.lines.empty() && o.picture.empty())
    throw UsageError("nothing to check: name LINES of a recording, or --frame and --picture");
  return o;
}

} // namespace terrainseg::calibrate
