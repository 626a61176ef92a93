// SPDX-License-Identifier: LGPL-2.1-or-later
// terrainseg-calibrate: calibrates a camera's lens and mount, and checks a calibration.
#include <clocale>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <iostream>
#include <numbers>
#include <optional>
#include <string>
#include <vector>

#include "exchange/counted.hpp"
#include "metric/camera_info.hpp"
#include "tools/calibrate/files.hpp"
#include "tools/calibrate/horizon_check.hpp"
#include "tools/calibrate/mount_fit.hpp"
#include "tools/calibrate/pictures.hpp"
#include "tools/command_line.hpp"

namespace {

using namespace terrainseg;
using namespace terrainseg::calibrate;
using tools::OptionContext, tools::UsageError, tools::Word, tools::Words;
using Arguments = std::vector<std::string>;

constexpr const char* overview = R"(usage: terrainseg-calibrate COMMAND [OPTIONS]

  camera FOLDER   the lens, from pictures of a chessboard: writes a ROS camera_info file
  mount           height, pitch and roll of the camera, from points of flat ground: writes a mount file
  check [LINES]   whether a recording (JSON lines) and a picture agree with both

terrainseg-calibrate COMMAND --help lists the options; docs/tasks/calibration.md shows the way.
Exit code: 0 done and in agreement, 1 something could not be read, does not fit or does not agree, 2 wrong usage.
)";

constexpr int exit_usage = 2;
constexpr double most_degrees = 1; ///< maximum difference of the horizons, degrees

double degrees(double radians) {
  return radians * 180 / std::numbers::pi;
}

// Options that several commands have.

GOptionEntry file_option(const char* name, Word& target, const char* help, const char* value = "FILE") {
  return {name, 0, 0, G_OPTION_ARG_FILENAME, &target.text, help, value};
}
GOptionEntry text_option(const char* name, Word& target, const char* help, const char* value) {
  return {name, 0, 0, G_OPTION_ARG_STRING, &target.text, help, value};
}
GOptionEntry lens_option(Word& target) {
  return file_option("camera-info", target, "The lens: ROS camera_info, Kalibr or OpenCV YAML");
}
GOptionEntry picture_option(Word& target) {
  return file_option("picture", target, "Draws metres over the frame: a PNG or JPEG file");
}

/// Parses the arguments into the targets of the entries; returns the arguments that are not options.
Arguments parse(std::vector<GOptionEntry> entries, const char* usage, const char* summary,
                const Arguments& arguments, const char* name) {
  Words rest;
  entries.push_back({G_OPTION_REMAINING, 0, 0, G_OPTION_ARG_FILENAME_ARRAY, &rest.list, nullptr, nullptr});
  entries.push_back({});
  const OptionContext context(g_option_context_new(usage));
  g_option_context_add_main_entries(context.get(), entries.data(), nullptr);
  g_option_context_set_summary(context.get(), summary);
  tools::parse(context.get(), arguments, name);
  return rest.all();
}

std::string only_one(const Arguments& all, const char* what) {
  if (all.size() > 1)
    throw UsageError(std::string("more than one ") + what + ": " + all[1]);
  return all.empty() ? std::string() : all.front();
}

void need(const std::string& value, const char* option) {
  if (value.empty())
    throw UsageError(std::string(option) + " is missing");
}

void check_picture(const Word& frame, const Word& picture) {
  if (!picture.value().empty())
    need(frame.value(), "--frame FILE, over which --picture draws,");
}

std::optional<double> metres(const Word& word, const char* option) {
  return word.text ? std::optional(parse_number(word.value(), option)) : std::nullopt;
}

/// Degrees, or radians if the suffix is `rad`.
std::optional<double> angle(const Word& word, const char* option) {
  if (!word.text)
    return std::nullopt;
  std::string text = word.value();
  const bool radians = text.size() > 3 && text.ends_with("rad");
  if (radians || (text.size() > 3 && text.ends_with("deg")))
    text.resize(text.size() - 3);
  const double value = parse_number(text, option) * (radians ? 1 : std::numbers::pi / 180);
  if (std::abs(value) > std::numbers::pi)
    throw UsageError(std::string(option) + ": '" + word.value() + "' is more than half a turn");
  return value;
}

void draw(const std::string& frame, const metric::Camera& camera, const metric::Mount& mount,
          const std::vector<MeasuredPoint>& points, const std::string& picture) {
  draw_over(frame, camera, mount, points, picture);
  std::printf("%s: metres drawn over the frame; check that its lines lie where the metres are\n",
              picture.c_str());
}

void write(const std::string& path, const std::string& content) {
  write_file(path, content);
  std::printf("%s: written\n", path.c_str());
}

int run_camera(const Arguments& arguments) {
  Word board_text, out;
  gboolean fisheye = FALSE;
  const Arguments rest = parse(
      {text_option("board", board_text, "Inner corners of the board (default: 9x6, a board of 10x7 squares)",
                   "COLUMNSxROWS"),
       {"fisheye", 0, 0, G_OPTION_ARG_NONE, &fisheye,
        "For lenses of 120 degrees and more: the equidistant model instead of plumb_bob", nullptr},
       file_option("out", out, "Output file (default: camera.yaml)")},
      "FOLDER",
      "Calibrates a lens from pictures of a chessboard: 20 of them, in the size that the camera delivers to "
      "the\nfilter, the board tilted by up to 45 degrees in all directions, near the corners of the picture "
      "too.",
      arguments, "terrainseg-calibrate camera");
  const std::string folder = only_one(rest, "FOLDER");
  need(folder, "FOLDER");
  Board board;
  if (board_text.text)
    board = parse_board(board_text.value());
  const Calibration c = calibrate_from_folder(folder, board, fisheye);
  for (const View& view : c.views)
    std::printf("%s: %.3f px\n", view.name.c_str(), view.error);
  for (const std::string& name : c.without_board)
    std::printf("%s: no complete board found\n", name.c_str());
  std::printf("%s, residual %.3f px, corners cover %.0f %% of the picture\n",
              counted(c.views.size(), "view").c_str(), c.error, 100 * c.coverage);
  std::printf("fx %.2f, fy %.2f, cx %.2f, cy %.2f for pictures of %dx%d\n", c.camera.fx, c.camera.fy,
              c.camera.cx, c.camera.cy, c.camera.width, c.camera.height);
  if (c.error > 1)
    std::printf(
        "warning: more than 1 px: remove the views with the largest residuals (blurred, board bent)\n");
  if (c.coverage < 0.6)
    std::printf("warning: little of the picture is covered: add views with the board near its corners\n");
  write(out.value("camera.yaml"), metric::camera_info_file(c.camera, "camera"));
  return EXIT_SUCCESS;
}

void print_fit(const MountFit& fit, const std::vector<MeasuredPoint>& points) {
  std::printf("  column     row   measured  by mount  residual\n");
  for (std::size_t i = 0; i < points.size(); ++i) {
    std::printf("%8.1f %7.1f %8.3f m ", points[i].u, points[i].v, points[i].distance);
    if (fit.residuals[i].measured)
      std::printf("%7.3f m", *fit.residuals[i].measured);
    else
      std::printf("  horizon");
    std::printf(" %+6.2f rows\n", fit.residuals[i].rows);
  }
  const auto found = [](double error) { return error > 0 ? "found" : "given"; };
  std::printf("height %.3f m (+- %.3f, %s), pitch %.2f degrees (+- %.2f), roll %.2f degrees (+- %.2f, %s)\n",
              fit.mount.height, fit.height_error, found(fit.height_error), degrees(fit.mount.pitch),
              degrees(fit.pitch_error), degrees(fit.mount.roll), degrees(fit.roll_error),
              fit.roll_found ? "found" : "not found: as given, or 0");
  if (fit.other_height)
    std::printf(
        "note: a height of %.2f m would fit as well; if that is the right one, state --height, or add a "
        "point at a third distance\n",
        *fit.other_height);
  if (fit.root_mean_square > 5)
    std::printf(
        "warning: the points miss the mount by %.1f rows: is the ground flat, are the metres right?\n",
        fit.root_mean_square);
}

int run_mount(const Arguments& arguments) {
  Words point_texts;
  Word lens, file, height, roll, yaw, x, y, out, frame, picture;
  const Arguments rest = parse(
      {lens_option(lens),
       {"point", 'p', 0, G_OPTION_ARG_STRING_ARRAY, &point_texts.list,
        "A point of flat ground, at least twice: its pixel, and its distance over ground from the point "
        "below the lens",
        "COLUMN,ROW,METRES"},
       file_option("points", file, "Points from a file, one a line"),
       text_option("height", height, "Measured height of the lens over the ground", "METRES"),
       text_option("roll", roll,
                   "Known roll, positive = right side down (default: fitted to four or more points, with "
                   "--height to two or more, if they determine it; otherwise 0)",
                   "DEGREES"),
       text_option("yaw", yaw, "Copied to the file, positive = the camera looks to the left", "DEGREES"),
       text_option("x", x, "Copied to the file: distance of the lens ahead of the origin", "METRES"),
       text_option("y", y, "Copied to the file: distance of the lens to the left of the origin", "METRES"),
       file_option(
           "frame", frame,
           "The picture in which the pixels were read: needed for --picture, and if its size is not the "
           "calibration's"),
       picture_option(picture),
       file_option("out", out, "Output file (default: mount.yaml)")},
      nullptr,
      "Fits the pose of the camera to points of flat ground at measured distances: two or more, one near the "
      "lower\nedge, one at least twice as far. Four points on both sides also give the roll.",
      arguments, "terrainseg-calibrate mount");
  if (!rest.empty())
    throw UsageError(rest.front() + ": not an option");
  need(lens.value(), "--camera-info FILE");
  std::vector<MeasuredPoint> points;
  for (const std::string& text : point_texts.all())
    points.push_back(parse_point(text));
  if (file.text)
    try {
      const auto more = parse_points(read_file(file.value()));
      points.insert(points.end(), more.begin(), more.end());
    } catch (const std::runtime_error& error) {
      throw std::runtime_error(file.value() + ": " + error.what());
    }
  if (points.empty())
    throw UsageError("no --point is given");
  const Known known{.height = metres(height, "--height"),
                    .roll = angle(roll, "--roll"),
                    .yaw = angle(yaw, "--yaw").value_or(0),
                    .x = metres(x, "--x").value_or(0),
                    .y = metres(y, "--y").value_or(0)};
  check_picture(frame, picture);

  metric::Camera camera = read_camera(lens.value());
  if (!frame.value().empty())
    camera = fitted_to_picture(camera, frame.value());
  const MountFit fit = fit_mount(camera, points, known);
  print_fit(fit, points);
  write(out.value("mount.yaml"), metric::mount_file(fit.mount));
  if (!picture.value().empty())
    draw(frame.value(), camera, fit.mount, points, picture.value());
  return EXIT_SUCCESS;
}

/// Returns true if the recording agrees with the mount.
bool check_recording(const std::string& lines, const metric::Camera& camera, const metric::Mount& mount) {
  std::ifstream file(lines);
  if (!file)
    throw std::runtime_error(lines + ": cannot be opened");
  HorizonCheck check;
  Horizons horizons;
  try {
    horizons = read_horizons(file);
    check = check_horizon(horizons, camera, mount);
  } catch (const std::runtime_error& error) {
    throw std::runtime_error(lines + ": " + error.what());
  }
  std::printf(
      "horizon of the recording: row %.1f (median of %zu confident of %zu frames, middle half %.1f..%.1f)\n",
      check.row, horizons.rows.size(), horizons.frames, check.lower_quartile, check.upper_quartile);
  std::printf("horizon of the mount:     row %.1f\n", check.expected);
  const bool agrees = std::abs(check.degrees) <= most_degrees;
  std::printf("the recording's lies %.2f degrees %s: %s\n", std::abs(check.degrees),
              check.degrees > 0 ? "lower" : "higher", agrees ? "they agree" : "they do not agree");
  if (!agrees)
    std::printf("On open flat ground that is an error of the mount's pitch: it may have been moved; repeat "
                "terrainseg-calibrate mount.\nBetween walls or trees the recording's horizon is none: record "
                "where the ground reaches far.\n");
  return agrees;
}

int run_check(const Arguments& arguments) {
  Word lens, mount_text, frame, picture;
  const Arguments rest = parse(
      {lens_option(lens),
       file_option("mount", mount_text, "The mount: a file, or its text (height=0.5,pitch=10deg)",
                   "FILE|TEXT"),
       file_option("frame", frame, "A picture of the camera, for --picture"), picture_option(picture)},
      "[LINES]",
      "Compares the horizon that terrainseg found in a recording with the mount's, and draws metres over a "
      "picture.\nLINES are JSON lines of terrainextract, or of terrainseg-process.",
      arguments, "terrainseg-calibrate check");
  const std::string lines = only_one(rest, "LINES");
  need(lens.value(), "--camera-info FILE");
  need(mount_text.value(), "--mount FILE");
  check_picture(frame, picture);
  if (lines.empty() && picture.value().empty())
    throw UsageError("nothing to check: name LINES of a recording, or --frame and --picture");
  const metric::Camera camera = read_camera(lens.value());
  const metric::Mount mount = read_mount_argument(mount_text.value());
  const bool agrees = lines.empty() || check_recording(lines, camera, mount);
  if (!picture.value().empty())
    draw(frame.value(), fitted_to_picture(camera, frame.value()), mount, {}, picture.value());
  return agrees ? EXIT_SUCCESS : EXIT_FAILURE;
}

int run(const Arguments& words) {
  const std::string& command = words[0];
  const Arguments rest(words.begin() + 1, words.end());
  if (command == "camera")
    return run_camera(rest);
  if (command == "mount")
    return run_mount(rest);
  if (command == "check")
    return run_check(rest);
  if (command == "--help" || command == "-h") {
    std::cout << overview;
    return EXIT_SUCCESS;
  }
  throw tools::UsageError("'" + command + "' is not a command: use camera, mount or check");
}

} // namespace

int main(int argc, char** argv) {
  std::setlocale(LC_CTYPE, ""); // for GLib's help; numbers keep decimal points
  const Arguments words(argv + 1, argv + argc);
  try {
    if (words.empty()) {
      std::cerr << overview;
      return exit_usage;
    }
    return run(words);
  } catch (const tools::UsageError& error) {
    std::cerr << "terrainseg-calibrate: " << error.what() << "; --help shows how\n";
    return exit_usage;
  } catch (const std::exception& error) {
    std::cerr << "terrainseg-calibrate: " << error.what() << '\n';
    return EXIT_FAILURE;
  }
}
