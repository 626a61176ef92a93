// SPDX-License-Identifier: LGPL-2.1-or-later
// terrainseg-calibrate: calibrates a camera's lens and mount, and checks a calibration.
#include <algorithm>
#include <clocale>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <iostream>
#include <numbers>
#include <string>
#include <vector>

#include "exchange/counted.hpp"
#include "metric/camera_info.hpp"
#include "tools/calibrate/chessboard.hpp"
#include "tools/calibrate/files.hpp"
#include "tools/calibrate/horizon_check.hpp"
#include "tools/calibrate/options.hpp"
#include "tools/calibrate/pictures.hpp"
#include "tools/command_line.hpp"

namespace {

using namespace terrainseg;
using namespace terrainseg::calibrate;
using Words = std::vector<std::string>;

constexpr int exit_usage = 2;
constexpr double most_degrees = 1; ///< maximum difference of the horizons, degrees

double degrees(double radians) {
  return radians * 180 / std::numbers::pi;
}

void draw(const std::string& frame, const metric::Camera& camera, const metric::Mount& mount,
          const std::vector<MeasuredPoint>& points, const std::string& picture) {
  draw_over(frame, camera, mount, points, picture);
  std::printf("%s: metres drawn over the frame; check that its lines lie where the metres are\n",
              picture.c_str());
}

metric::Camera fitted_to(const metric::Camera& camera, const std::string& frame) {
  const PictureSize size = size_of_picture(frame);
  return fitted(camera, size.width, size.height);
}

int run_camera(const Words& words) {
  const CameraOptions o = parse_camera(words);
  const Calibration c = calibrate_from_folder(o.folder, o.board, o.fisheye);
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
  write_file(o.out, metric::camera_info_file(c.camera, "camera"));
  std::printf("%s: written\n", o.out.c_str());
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

int run_mount(const Words& words) {
  const MountOptions o = parse_mount(words);
  metric::Camera camera = read_camera(o.camera_info);
  if (!o.frame.empty())
    camera = fitted_to(camera, o.frame);
  const MountFit fit = fit_mount(camera, o.points, o.known);
  print_fit(fit, o.points);
  write_file(o.out, metric::mount_file(fit.mount));
  std::printf("%s: written\n", o.out.c_str());
  if (!o.picture.empty())
    draw(o.frame, camera, fit.mount, o.points, o.picture);
  return EXIT_SUCCESS;
}

/// Returns true if the recording agrees with the mount.
bool check_recording(const CheckOptions& o, const metric::Camera& camera, const metric::Mount& mount) {
  std::ifstream file(o.lines);
  if (!file)
    throw std::runtime_error(o.lines + ": cannot be opened");
  HorizonCheck check;
  Horizons horizons;
  try {
    horizons = read_horizons(file);
    check = check_horizon(horizons, camera, mount);
  } catch (const std::runtime_error& error) {
    throw std::runtime_error(o.lines + ": " + error.what());
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

int run_check(const Words& words) {
  const CheckOptions o = parse_check(words);
  const metric::Camera camera = read_camera(o.camera_info);
  const metric::Mount mount = read_mount_argument(o.mount);
  const bool agrees = o.lines.empty() || check_recording(o, camera, mount);
  if (!o.picture.empty())
    draw(o.frame, fitted_to(camera, o.frame), mount, {}, o.picture);
  return agrees ? EXIT_SUCCESS : EXIT_FAILURE;
}

int run(const Words& words) {
  const std::string& command = words[0];
  const Words rest(words.begin() + 1, words.end());
  if (command == "camera")
    return run_camera(rest);
  if (command == "mount")
    return run_mount(rest);
  if (command == "check")
    return run_check(rest);
  if (command == "--help" || command == "-h") {
    std::cout << help();
    return EXIT_SUCCESS;
  }
  throw tools::UsageError("'" + command + "' is not a command: use camera, mount or check");
}

} // namespace

int main(int argc, char** argv) {
  std::setlocale(LC_CTYPE, ""); // for GLib's help; numbers keep decimal points
  const Words words(argv + 1, argv + argc);
  try {
    if (words.empty()) {
      std::cerr << help();
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
