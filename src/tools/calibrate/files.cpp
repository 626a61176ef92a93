// SPDX-License-Identifier: LGPL-2.1-or-later
#include "tools/calibrate/files.hpp"

#include <glib.h>

#include <cmath>
#include <stdexcept>

#include "metric/camera_info.hpp"

namespace terrainseg::calibrate {
namespace {

[[noreturn]] void raise(GError* error) {
  const std::string text = error->message;
  g_error_free(error);
  throw std::runtime_error(text);
}

} // namespace

std::string read_file(const std::string& path) {
  gchar* bytes = nullptr;
  gsize size = 0;
  GError* error = nullptr;
  if (!g_file_get_contents(path.c_str(), &bytes, &size, &error))
    raise(error);
  const std::string text(bytes, size);
  g_free(bytes);
  // NOLINTNEXTLINE(performance-no-automatic-move)
  return text;
}

void write_file(const std::string& path, const std::string& bytes) {
  GError* error = nullptr;
  if (!g_file_set_contents(path.c_str(), bytes.data(), static_cast<gssize>(bytes.size()), &error))
    raise(error);
}

metric::Camera read_camera(const std::string& path) {
  std::string error;
  const auto camera = metric::read_camera_info(read_file(path), error);
  if (!camera)
    throw std::runtime_error(path + ": " + error);
  return *camera;
}

metric::Mount read_mount_argument(const std::string& argument) {
  const bool is_text = argument.find('=') != argument.npos;
  std::string error;
  const auto mount =
      is_text ? metric::parse_mount(argument, error) : metric::read_mount(read_file(argument), error);
  if (!mount)
    throw std::runtime_error((is_text ? "--mount: " : argument + ": ") + error);
  return *mount;
}

metric::Camera fitted(const metric::Camera& camera, int width, int height) {
  const double across = static_cast<double>(width) / camera.width,
               down = static_cast<double>(height) / camera.height;
  if (std::abs(across / down - 1) > 0.02)
    throw std::runtime_error("the pictures are " + std::to_string(width) + "x" + std::to_string(height) +
                             ", the calibration is for " + std::to_string(camera.width) + "x" +
                             std::to_string(camera.height) +
                             " and has other proportions: a cut-out needs a calibration of its own");
  return metric::scaled(camera, width, height);
}

} // namespace terrainseg::calibrate
