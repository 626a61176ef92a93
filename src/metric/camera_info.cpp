// SPDX-License-Identifier: LGPL-2.1-or-later
#include "metric/camera_info.hpp"

#include <yaml-cpp/yaml.h>

#include <charconv>
#include <initializer_list>
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
                 " deep: this is no calibration"};
  }
  // Blocks nest by their indent, or by dashes in one line.
  for (std::size_t at = 0; at < text.size();) {
    const std::size_t end = std::min(text.find('\n', at), text.size());
    std::size_t indent = at;
    while (indent < end &&
           (text[indent] == ' ' || text[indent] == '-' || text[indent] == '?' || text[indent] == ':'))
      ++indent;
    if (indent - at > 4 * deepest_nesting)
      throw Flaw{"lines are indented too deeply: this is no calibration"};
    at = end + 1;
  }
}

YAML::Node parsed(const std::string& text) {
  if (text.size() > longest_file)
    throw Flaw{"it is larger than 1 MiB: this is no calibration"};
  check_nesting(text);
  // OpenCV's first line is no directive of YAML 1.2.
  const std::size_t start = text.rfind("%YAML:", 0) == 0 ? std::min(text.find('\n'), text.size()) : 0;
  YAML::Node node;
  try {
    node = YAML::Load(text.substr(start));
  } catch (const YAML::Exception& e) {
    throw Flaw{std::string("it is no YAML: ") + e.what()};
  }
  if (!node.IsMap())
    throw Flaw{
        "it holds no keys: expected are a ROS camera_info, a Kalibr camchain or an OpenCV FileStorage"};
  return node;
}

/// The first of several names that is there.
YAML::Node at(const YAML::Node& node, std::initializer_list<const char*> names) {
  for (const char* name : names)
    if (const YAML::Node found = node[name]; found.IsDefined() && !found.IsNull())
      return found;
  return YAML::Node(YAML::NodeType::Undefined);
}

YAML::Node need(const YAML::Node& node, std::initializer_list<const char*> names) {
  const YAML::Node found = at(node, names);
  if (!found.IsDefined())
    throw Flaw{std::string(*names.begin()) + " is missing: export the calibration again"};
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

int size(const YAML::Node& node, const char* what) {
  const double value = number(node, what);
  if (!(value >= 1 && value <= 32767) || value != static_cast<int>(value))
    throw Flaw{std::string(what) + " is not a whole number within 1..32767"};
  return static_cast<int>(value);
}

/// A list of numbers, or the `data` of a matrix.
std::vector<double> numbers(const YAML::Node& node, const char* what) {
  const YAML::Node list = node.IsMap() ? need(node, {"data"}) : node;
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

void set_coefficients(Camera& camera, const std::vector<double>& values) {
  const std::size_t most = camera.distortion == Distortion::equidistant ? 4 : 8;
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
  camera.fx = m[0];
  camera.cx = m[2];
  camera.fy = m[4];
  camera.cy = m[5];
}

std::string text_of(const YAML::Node& node) {
  return node.IsDefined() && node.IsScalar() ? node.Scalar() : std::string();
}

Camera kalibr(const YAML::Node& node) {
  if (const std::string model = text_of(node["camera_model"]); !model.empty() && model != "pinhole")
    throw Flaw{"the camera model '" + model + "' is not supported: calibrate as pinhole"};
  Camera camera;
  const std::vector<double> intrinsics = numbers(need(node, {"intrinsics"}), "intrinsics");
  const YAML::Node resolution = need(node, {"resolution"});
  if (intrinsics.size() != 4 || !resolution.IsSequence() || resolution.size() != 2)
    throw Flaw{"intrinsics are not four numbers or resolution is not two"};
  camera.fx = intrinsics[0];
  camera.fy = intrinsics[1];
  camera.cx = intrinsics[2];
  camera.cy = intrinsics[3];
  camera.width = size(resolution[0], "resolution");
  camera.height = size(resolution[1], "resolution");
  const std::string model = text_of(node["distortion_model"]);
  if (model != "none") {
    camera.distortion = distortion_named(model);
    set_coefficients(camera, numbers(need(node, {"distortion_coeffs"}), "distortion_coeffs"));
  }
  return camera;
}

Camera ros_or_opencv(const YAML::Node& node) {
  Camera camera;
  if (const YAML::Node both = at(node, {"imageSize", "image_size"});
      both.IsDefined() && both.IsSequence() && both.size() == 2) {
    camera.width = size(both[0], "imageSize");
    camera.height = size(both[1], "imageSize");
  } else {
    camera.width = size(need(node, {"image_width", "image_Width", "width"}), "image_width");
    camera.height = size(need(node, {"image_height", "image_Height", "height"}), "image_height");
  }
  set_matrix(camera,
             numbers(need(node, {"camera_matrix", "cameraMatrix", "Camera_Matrix", "K"}), "camera_matrix"));
  camera.distortion = distortion_named(text_of(node["distortion_model"]));
  if (const YAML::Node list =
          at(node, {"distortion_coefficients", "distCoeffs", "Distortion_Coefficients", "D"});
      list.IsDefined())
    set_coefficients(camera, numbers(list, "distortion_coefficients"));
  return camera;
}

/// All digits that it takes to read the same number again, whatever the locale.
std::string text(double value) {
  char digits[32];
  return std::string(digits, std::to_chars(digits, digits + sizeof digits, value).ptr);
}

std::string matrix(const char* name, int rows, std::initializer_list<double> values) {
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
    const Camera camera = first.IsDefined() && first.IsMap() ? kalibr(first)
                          : node["intrinsics"].IsDefined()   ? kalibr(node)
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
      std::string name = item.first.Scalar();
      if (name == "frame_id" || name == "child_frame_id")
        continue;
      for (char& c : name)
        c = c == '_' ? '-' : c;
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
  const auto& k = camera.coefficients;
  const bool fisheye = camera.distortion == Distortion::equidistant;
  const bool rational = !fisheye && (k[5] != 0 || k[6] != 0 || k[7] != 0);
  return "image_width: " + std::to_string(camera.width) + "\nimage_height: " + std::to_string(camera.height) +
         "\ncamera_name: " + name + "\n" +
         matrix("camera_matrix", 3, {camera.fx, 0, camera.cx, 0, camera.fy, camera.cy, 0, 0, 1}) +
         "distortion_model: " +
         (fisheye    ? "equidistant"
          : rational ? "rational_polynomial"
                     : "plumb_bob") +
         "\n" +
         (fisheye    ? matrix("distortion_coefficients", 1, {k[0], k[1], k[2], k[3]})
          : rational ? matrix("distortion_coefficients", 1, {k[0], k[1], k[2], k[3], k[4], k[5], k[6], k[7]})
                     : matrix("distortion_coefficients", 1, {k[0], k[1], k[2], k[3], k[4]})) +
         matrix("rectification_matrix", 3, {1, 0, 0, 0, 1, 0, 0, 0, 1}) +
         matrix("projection_matrix", 3, {camera.fx, 0, camera.cx, 0, 0, camera.fy, camera.cy, 0, 0, 0, 1, 0});
}

} // namespace terrainseg::metric
