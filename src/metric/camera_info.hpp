// SPDX-License-Identifier: LGPL-2.1-or-later
// Calibration files: YAML in, plain values out.
#pragma once

#include <optional>
#include <string>

#include "metric/camera.hpp"
#include "metric/mount.hpp"

namespace terrainseg::metric {

/// Reads a camera's calibration from text in one of three forms that calibration programs write. Names of
/// keys may be written in upper or lower case, with or without '_':
/// - ROS `camera_info`, as a calibration file or as `ros2 topic echo` prints it (image_width or width,
///   image_height or height, camera_matrix or k, distortion_model [plumb_bob when absent],
///   distortion_coefficients or d; roi and binning_x, binning_y are applied): plumb_bob, rational_polynomial,
///   equidistant, fisheye;
/// - Kalibr's camchain (the first camera: intrinsics, resolution, distortion_model radtan or equidistant,
///   distortion_coeffs; camera_model pinhole);
/// - OpenCV's FileStorage (image_width, image_height or imageSize, camera_matrix or cameraMatrix,
///   distortion_coefficients or distCoeffs as opencv-matrix, fisheye_model).
/// The pictures are the raw ones: rectification_matrix (r) and projection_matrix (p) belong to rectified
/// pictures and change nothing. Skew, and coefficients that a model does not have, are refused.
/// On an error nothing, and `error` says what is wrong and what to do; it does not name the file.
std::optional<Camera> read_camera_info(const std::string& text, std::string& error);

/// Reads a mount from YAML: height, pitch, roll, yaw, x, y, pitch_error as numbers (metres, radians) at the
/// top or under `mount:`; angles may be written `10deg`.
std::optional<Mount> read_mount(const std::string& text, std::string& error);

/// A mount as such a file.
std::string mount_file(const Mount& mount);

/// A calibration as ROS `camera_info` YAML; `name` becomes camera_name.
std::string camera_info_file(const Camera& camera, const std::string& name);

} // namespace terrainseg::metric
