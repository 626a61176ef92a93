// SPDX-License-Identifier: LGPL-2.1-or-later
#include "metric/camera_info.hpp"

#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <initializer_list>
#include <span>
#include <string_view>
#include <vector>

namespace terrainseg::metric {
namespace {

/// What is wrong, on its way out of the readers below.
struct Flaw {
  std::string text;
};

/// Files hold one camera: larger ones are something else, and deeper ones an attack on the parser's stack.
constexpr std::size_t longest_file = 1 << 20;
constexpr int deepest_nesting = 32;

void check_nesting(const std::string& text) {
  int flow = 0;
  for (char c : text) {
    flow += c == '[' || c == '{' ? 1 : c == ']' || c == '}' ? -1 : 0;
    if (flow > deepest_nesting)
      throw Flaw{"brackets are nested more than " + std::to_string(deepest_nesting) +
                 " deep: this is not a calibration"};
  }
  // Blocks nest by their indent, or by dashes in one line.
  for (std::size_t at = 0; at < text.size();) {
    const std::size_t end = std::min(text.find('\n', at), text.size());
    if (std::min(text.find_first_not_of(" -?:", at), end) - at > 4 * deepest_nesting)
      throw Flaw{"lines are indented too deeply: this is not a calibration"};
    at = end + 1;
  }
}

YAML::Node parsed(const std::string& text) {
  if (text.size() > longest_file)
    throw Flaw{"it is larger than 1 MiB: this is not a calibration"};
  check_nesting(text);
  // OpenCV's first line is no directive of YAML 1.2.
  const std::size_t start = text.rfind("%YAML:", 0) == 0 ? std::min(text.find('\n'), text.size()) : 0;
  YAML::Node node;
  try {
    node = YAML::Load(text.substr(start));
  } catch (const YAML::Exception& e) {
    throw Flaw{std::string("it is not YAML: ") + e.what()};
  }
  if (!node.IsMap())
    throw Flaw{
        "it holds no keys: expected are a ROS camera_info, a Kalibr camchain or an OpenCV FileStorage"};
  return node;
}

/// Lower case, without '_' and '-': camera_matrix, cameraMatrix and Camera_Matrix, k and K are one name.
std::string plain(std::string_view name) {
  std::string result;
  for (const char c : name)
    if (c != '_' && c != '-')
      result += c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
  return result;
}

/// The value of the key that has one of several plain() names. Undefined when there is none.
YAML::Node at(const YAML::Node& node, std::initializer_list<std::string_view> names) {
  YAML::Node found(YAML::NodeType::Undefined);
  std::string its_name;
  for (const auto& item : node) {
    if (!item.first.IsScalar() || item.second.IsNull() ||
        std::find(names.begin(), names.end(), plain(item.first.Scalar())) == names.end())
      continue;
    if (found.IsDefined())
      throw Flaw{its_name + " and " + item.first.Scalar() + " state the same: remove one of them"};
    found.reset(item.second);
    its_name = item.first.Scalar();
  }
  return found;
}

/// `what` is the name in messages.
YAML::Node need(const YAML::Node& node, const char* what, std::initializer_list<std::string_view> names) {
  const YAML::Node found = at(node, names);
  if (!found.IsDefined())
    throw Flaw{std::string(what) + " is missing: export the calibration again"};
  return found;
}

/// Not by the locale of the process, as a stream would read it.
double number(const YAML::Node& node, const char* what) {
  if (node.IsScalar()) {
    const std::string& text = node.Scalar();
    const char* first = text.data() + (!text.empty() && text[0] == '+');
    double value = 0;
    const auto [end, status] = std::from_chars(first, text.data() + text.size(), value);
    if (status == std::errc{} && end == text.data() + text.size())
      return value;
    throw Flaw{std::string(what) + " holds '" + text + "', which is not a number"};
  }
  throw Flaw{std::string(what) + " is not a number"};
}

int size(const YAML::Node& node, const char* what, int least = 1) {
  const double value = number(node, what);
  if (!(value >= least && value <= 32767) || value != static_cast<int>(value))
    throw Flaw{std::string(what) + " is not a whole number within " + std::to_string(least) + "..32767"};
  return static_cast<int>(value);
}

/// A list of numbers, or the `data` of a matrix.
std::vector<double> numbers(const YAML::Node& node, const char* what) {
  const YAML::Node list = node.IsMap() ? need(node, "data", {"data"}) : node;
  if (!list.IsSequence() || list.size() > 64)
    throw Flaw{std::string(what) + " is not a list of numbers"};
  std::vector<double> values;
  for (const YAML::Node& item : list) {
    if (item.IsSequence()) // a matrix written row by row
      for (double value : numbers(item, what))
        values.push_back(value);
    else
      values.push_back(number(item, what));
  }
  return values;
}

Distortion distortion_named(const std::string& name) {
  if (name == "plumb_bob" || name == "rational_polynomial" || name == "radtan" || name.empty())
    return Distortion::brown_conrady;
  if (name == "equidistant" || name == "fisheye" || name == "kannala_brandt")
    return Distortion::equidistant;
  throw Flaw{"the distortion model '" + name +
             "' is not supported: calibrate with plumb_bob, rational_polynomial, radtan or equidistant"};
}

/// `rational`: a model of its own name has the last three of eight.
void set_coefficients(Camera& camera, const std::vector<double>& values, bool rational) {
  const bool fisheye = camera.distortion == Distortion::equidistant;
  if (!values.empty() && values.size() < 4)
    throw Flaw{"the distortion has " + std::to_string(values.size()) +
               " coefficients, and every supported model has four or more: export the calibration again"};
  const std::size_t most = fisheye ? 4 : rational ? 8 : 5;
  for (std::size_t i = 0; i < values.size(); ++i)
    if (i < most)
      camera.coefficients[i] = values[i];
    else if (values[i] != 0) // OpenCV's thin prism and tilt
      throw Flaw{"the distortion has " + std::to_string(values.size()) +
                 " coefficients that are not 0, at most " + std::to_string(most) +
                 " are supported: calibrate without thin prism and tilt"};
}

void set_matrix(Camera& camera, const std::vector<double>& m) {
  if (m.size() != 9)
    throw Flaw{"camera_matrix has " + std::to_string(m.size()) + " numbers, not 9"};
  if (m[3] != 0 || m[6] != 0 || m[7] != 0 || m[8] != 1)
    throw Flaw{"camera_matrix is not fx 0 cx, 0 fy cy, 0 0 1: is it written column by column?"};
  if (m[1] != 0)
    throw Flaw{"camera_matrix has skew, which is not supported: calibrate without skew"};
  camera.fx = m[0];
  camera.cx = m[2];
  camera.fy = m[4];
  camera.cy = m[5];
}

/// The picture that the camera delivers: a region of the one that was calibrated on, in super-pixels.
Camera delivered(Camera camera, const YAML::Node& node) {
  const auto size_at = [](const YAML::Node& map, const char* name, std::string_view key) {
    const YAML::Node value = at(map, {key});
    return value.IsDefined() ? size(value, name, 0) : 0;
  };
  const YAML::Node roi = at(node, {"roi"});
  if (roi.IsDefined() && !roi.IsMap())
    throw Flaw{"roi is not x_offset, y_offset, width and height"};
  const int x = size_at(roi, "roi: x_offset", "xoffset"), y = size_at(roi, "roi: y_offset", "yoffset"),
            width = size_at(roi, "roi: width", "width"), height = size_at(roi, "roi: height", "height");
  if (x != 0 || y != 0 || width != 0 || height != 0) { // all 0 = the whole picture
    if (width < 1 || height < 1 || x + width > camera.width || y + height > camera.height)
      throw Flaw{"roi is not a part of the picture of " + std::to_string(camera.width) + "x" +
                 std::to_string(camera.height)};
    if (width < camera.width || height < camera.height) {
      camera.whole_width = camera.width;
      camera.whole_height = camera.height;
    }
    camera.width = width;
    camera.height = height;
    camera.cx -= x;
    camera.cy -= y;
  }
  const int by_x = std::max(size_at(node, "binning_x", "binningx"), 1), // 0 = 1
      by_y = std::max(size_at(node, "binning_y", "binningy"), 1);
  if (camera.width / by_x < 1 || camera.height / by_y < 1)
    throw Flaw{"binning leaves no picture"};
  return by_x == 1 && by_y == 1 ? camera : scaled(camera, camera.width / by_x, camera.height / by_y);
}

std::string text_of(const YAML::Node& node) {
  return node.IsDefined() && node.IsScalar() ? node.Scalar() : std::string();
}

Camera kalibr(const YAML::Node& node) {
  if (const std::string model = text_of(at(node, {"cameramodel"})); !model.empty() && model != "pinhole")
    throw Flaw{"the camera model '" + model + "' is not supported: calibrate as pinhole"};
  Camera camera;
  const std::vector<double> intrinsics = numbers(need(node, "intrinsics", {"intrinsics"}), "intrinsics");
  const YAML::Node resolution = need(node, "resolution", {"resolution"});
  if (intrinsics.size() != 4 || !resolution.IsSequence() || resolution.size() != 2)
    throw Flaw{"intrinsics are not four numbers or resolution is not two"};
  camera.fx = intrinsics[0];
  camera.fy = intrinsics[1];
  camera.cx = intrinsics[2];
  camera.cy = intrinsics[3];
  camera.width = size(resolution[0], "resolution");
  camera.height = size(resolution[1], "resolution");
  const std::string model = text_of(at(node, {"distortionmodel"}));
  const YAML::Node list = model == "none" ? at(node, {"distortioncoeffs"})
                                          : need(node, "distortion_coeffs", {"distortioncoeffs"});
  if (model != "none")
    camera.distortion = distortion_named(model);
  if (list.IsDefined())
    set_coefficients(camera, numbers(list, "distortion_coeffs"), false);
  if (model == "none" && !camera.undistorted())
    throw Flaw{"distortion_model is none and distortion_coeffs are not 0: remove one of them"};
  return delivered(camera, node);
}

/// OpenCV's sample writes `fisheye_model: 1` and no name.
std::string model_of(const YAML::Node& node) {
  std::string name = text_of(at(node, {"distortionmodel"}));
  if (const YAML::Node fisheye = at(node, {"fisheyemodel"}); fisheye.IsDefined()) {
    const std::string value = text_of(fisheye);
    if (value != "0" && value != "1" && value != "false" && value != "true")
      throw Flaw{"fisheye_model is not 0 or 1"};
    if (value == "1" || value == "true") {
      if (!name.empty() && distortion_named(name) != Distortion::equidistant)
        throw Flaw{"fisheye_model and distortion_model '" + name + "' contradict each other"};
      name = "fisheye";
    }
  }
  return name;
}

Camera ros_or_opencv(const YAML::Node& node) {
  Camera camera;
  if (const YAML::Node both = at(node, {"imagesize"});
      both.IsDefined() && both.IsSequence() && both.size() == 2) {
    camera.width = size(both[0], "imageSize");
    camera.height = size(both[1], "imageSize");
  } else {
    camera.width = size(need(node, "image_width", {"imagewidth", "width"}), "image_width");
    camera.height = size(need(node, "image_height", {"imageheight", "height"}), "image_height");
  }
  set_matrix(camera, numbers(need(node, "camera_matrix", {"cameramatrix", "k"}), "camera_matrix"));
  const std::string model = model_of(node);
  camera.distortion = distortion_named(model);
  if (const YAML::Node list = at(node, {"distortioncoefficients", "distcoeffs", "d"}); list.IsDefined())
    set_coefficients(camera, numbers(list, "distortion_coefficients"),
                     model.empty() || model == "rational_polynomial");
  return delivered(camera, node);
}

/// All digits that it takes to read the same number again, whatever the locale.
std::string text(double value) {
  char digits[32];
  return std::string(digits, std::to_chars(digits, digits + sizeof digits, value).ptr);
}

std::string matrix(const char* name, int rows, std::span<const double> values) {
  std::string data;
  for (double value : values)
    data += (data.empty() ? "" : ", ") + text(value);
  return std::string(name) + ":\n  rows: " + std::to_string(rows) +
         "\n  cols: " + std::to_string(values.size() / static_cast<std::size_t>(rows)) + "\n  data: [" +
         data + "]\n";
}

template <class Read> auto reported(std::string& error, Read read) -> std::optional<decltype(read())> {
  try {
    return read();
  } catch (const Flaw& flaw) {
    error = flaw.text;
  } catch (const YAML::Exception& e) {
    error = std::string("it cannot be read: ") + e.what();
  }
  return std::nullopt;
}

} // namespace

std::optional<Camera> read_camera_info(const std::string& text, std::string& error) {
  return reported(error, [&] {
    const YAML::Node node = parsed(text);
    const YAML::Node first = node["cam0"];
    const Camera camera = first.IsDefined() && first.IsMap()     ? kalibr(first)
                          : at(node, {"intrinsics"}).IsDefined() ? kalibr(node)
                                                                 : ros_or_opencv(node);
    if (std::string flaw = flaw_of(camera); !flaw.empty())
      throw Flaw{std::move(flaw)};
    return camera;
  });
}

std::optional<Mount> read_mount(const std::string& text, std::string& error) {
  return reported(error, [&] {
    const YAML::Node node = parsed(text);
    const YAML::Node keys = node["mount"].IsDefined() ? node["mount"] : node;
    if (!keys.IsMap())
      throw Flaw{"mount: holds no keys"};
    // One reader for the file's keys and the property's text.
    std::string items;
    for (const auto& item : keys) {
      if (!item.first.IsScalar() || !item.second.IsScalar())
        throw Flaw{"a key of the mount is not a name with a number"};
      const std::string& name = item.first.Scalar();
      if (name == "frame_id" || name == "child_frame_id")
        continue;
      items += (items.empty() ? "" : ",") + name + "=" + item.second.Scalar();
    }
    std::string flaw;
    const auto mount = parse_mount(items, flaw);
    if (!mount)
      throw Flaw{flaw};
    return *mount;
  });
}

std::string mount_file(const Mount& mount) {
  return "# How the camera stands over the ground: metres and radians, x forward, y left, z up.\nmount:\n  "
         "height: " +
         text(mount.height) + "\n  pitch: " + text(mount.pitch) + "\n  roll: " + text(mount.roll) +
         "\n  yaw: " + text(mount.yaw) + "\n  x: " + text(mount.x) + "\n  y: " + text(mount.y) +
         "\n  pitch_error: " + text(mount.pitch_error) + "\n";
}

std::string camera_info_file(const Camera& camera, const std::string& name) {
  const auto [lens, coefficients] = lens_of(camera);
  const double fx = camera.fx, fy = camera.fy, cx = camera.cx, cy = camera.cy;
  return "image_width: " + std::to_string(camera.width) + "\nimage_height: " + std::to_string(camera.height) +
         "\ncamera_name: " + name + "\n" +
         matrix("camera_matrix", 3, std::array{fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0}) +
         "distortion_model: " + lens + "\n" +
         matrix("distortion_coefficients", 1, std::span(camera.coefficients).first(coefficients)) +
         matrix("rectification_matrix", 3, std::array{1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0}) +
         matrix("projection_matrix", 3, std::array{fx, 0.0, cx, 0.0, 0.0, fy, cy, 0.0, 0.0, 0.0, 1.0, 0.0});
}

} // namespace terrainseg::metric
