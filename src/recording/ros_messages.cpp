// SPDX-License-Identifier: LGPL-2.1-or-later
#include "recording/ros_messages.hpp"

#include <algorithm>
#include <sstream>

namespace terrainseg::recording {
namespace {

/// A type, package/Name, and its members.
struct Definition {
  std::string_view name;
  const char* members;
};

constexpr Definition definitions[] = {
    // Parts of messages.
    {"builtin_interfaces/Time", "int32 sec\nuint32 nanosec\n"},
    {"std_msgs/Header", "builtin_interfaces/Time stamp\nstring frame_id\n"},
    {"geometry_msgs/Vector3", "float64 x\nfloat64 y\nfloat64 z\n"},
    {"geometry_msgs/Quaternion", "float64 x\nfloat64 y\nfloat64 z\nfloat64 w\n"},
    {"geometry_msgs/Point", "float64 x\nfloat64 y\nfloat64 z\n"},
    {"geometry_msgs/Pose", "geometry_msgs/Point position\ngeometry_msgs/Quaternion orientation\n"},
    {"geometry_msgs/PoseWithCovariance", "geometry_msgs/Pose pose\nfloat64[36] covariance\n"},
    {"geometry_msgs/Twist", "geometry_msgs/Vector3 linear\ngeometry_msgs/Vector3 angular\n"},
    {"geometry_msgs/TwistWithCovariance", "geometry_msgs/Twist twist\nfloat64[36] covariance\n"},
    {"geometry_msgs/Transform", "geometry_msgs/Vector3 translation\ngeometry_msgs/Quaternion rotation\n"},
    {"geometry_msgs/TransformStamped",
     "std_msgs/Header header\nstring child_frame_id\ngeometry_msgs/Transform transform\n"},
    {"sensor_msgs/PointField", "uint8 INT8=1\nuint8 UINT8=2\nuint8 INT16=3\nuint8 UINT16=4\nuint8 INT32=5\n"
                               "uint8 UINT32=6\nuint8 FLOAT32=7\nuint8 FLOAT64=8\n"
                               "string name\nuint32 offset\nuint8 datatype\nuint32 count\n"},
    {"sensor_msgs/RegionOfInterest",
     "uint32 x_offset\nuint32 y_offset\nuint32 height\nuint32 width\nbool do_rectify\n"},
    {"nav_msgs/MapMetaData", "builtin_interfaces/Time map_load_time\nfloat32 resolution\n"
                             "uint32 width\nuint32 height\ngeometry_msgs/Pose origin\n"},
    {"diagnostic_msgs/DiagnosticStatus",
     "byte OK=0\nbyte WARN=1\nbyte ERROR=2\nbyte STALE=3\nbyte level\nstring name\n"
     "string message\nstring hardware_id\ndiagnostic_msgs/KeyValue[] values\n"},
    {"diagnostic_msgs/KeyValue", "string key\nstring value\n"},
    // Messages that are sent.
    {"sensor_msgs/LaserScan",
     "std_msgs/Header header\nfloat32 angle_min\nfloat32 angle_max\nfloat32 angle_increment\n"
     "float32 time_increment\nfloat32 scan_time\nfloat32 range_min\nfloat32 range_max\n"
     "float32[] ranges\nfloat32[] intensities\n"},
    {"sensor_msgs/PointCloud2",
     "std_msgs/Header header\nuint32 height\nuint32 width\nsensor_msgs/PointField[] fields\n"
     "bool is_bigendian\nuint32 point_step\nuint32 row_step\nuint8[] data\nbool is_dense\n"},
    {"nav_msgs/OccupancyGrid", "std_msgs/Header header\nnav_msgs/MapMetaData info\nint8[] data\n"},
    {"sensor_msgs/CameraInfo",
     "std_msgs/Header header\nuint32 height\nuint32 width\nstring distortion_model\nfloat64[] d\n"
     "float64[9] k\nfloat64[9] r\nfloat64[12] p\nuint32 binning_x\nuint32 binning_y\n"
     "sensor_msgs/RegionOfInterest roi\n"},
    {"sensor_msgs/Image",
     "std_msgs/Header header\nuint32 height\nuint32 width\nstring encoding\nuint8 is_bigendian\n"
     "uint32 step\nuint8[] data\n"},
    {"sensor_msgs/CompressedImage", "std_msgs/Header header\nstring format\nuint8[] data\n"},
    {"foxglove_msgs/CompressedVideo",
     "builtin_interfaces/Time timestamp\nstring frame_id\nuint8[] data\nstring format\n"},
    {"tf2_msgs/TFMessage", "geometry_msgs/TransformStamped[] transforms\n"},
    {"diagnostic_msgs/DiagnosticArray",
     "std_msgs/Header header\ndiagnostic_msgs/DiagnosticStatus[] status\n"},
    // Messages that are received.
    {"nav_msgs/Odometry",
     "std_msgs/Header header\nstring child_frame_id\ngeometry_msgs/PoseWithCovariance pose\n"
     "geometry_msgs/TwistWithCovariance twist\n"},
    {"geometry_msgs/PoseStamped", "std_msgs/Header header\ngeometry_msgs/Pose pose\n"},
    {"sensor_msgs/Imu", "std_msgs/Header header\ngeometry_msgs/Quaternion orientation\n"
                        "float64[9] orientation_covariance\ngeometry_msgs/Vector3 angular_velocity\n"
                        "float64[9] angular_velocity_covariance\ngeometry_msgs/Vector3 linear_acceleration\n"
                        "float64[9] linear_acceleration_covariance\n"},
    {"std_msgs/Bool", "bool data\n"},
    {"sensor_msgs/Range", // as of Jazzy
     "std_msgs/Header header\nuint8 ULTRASOUND=0\nuint8 INFRARED=1\nuint8 radiation_type\n"
     "float32 field_of_view\nfloat32 min_range\nfloat32 max_range\nfloat32 range\n"
     "float32 variance\n"},
};

/// Returns nullptr for types that are not in the table, such as uint32.
const char* members_of(std::string_view name) {
  const auto* known = std::ranges::find(definitions, name, &Definition::name);
  return known == std::end(definitions) ? nullptr : known->members;
}

/// Appends each type that `members` use and `text` does not have yet: a line of 80 equals signs, its name,
/// and its members, then the types that it uses.
void append_parts(std::string& text, const std::string& members) {
  std::istringstream lines(members);
  for (std::string line; std::getline(lines, line);) {
    const std::string name = line.substr(0, line.find_first_of("[ ")), title = "MSG: " + name + "\n";
    const char* parts = members_of(name);
    if (!parts || text.find(title) != std::string::npos)
      continue;
    text.append(80, '=').append("\n").append(title).append(parts);
    append_parts(text, parts);
  }
}

void put_time(CdrWriter& out, std::uint64_t time) {
  out.put(static_cast<std::int32_t>(time / second), static_cast<std::uint32_t>(time % second));
}

void put_header(CdrWriter& out, const Header& header) {
  put_time(out, header.time);
  out.put(header.frame);
}

/// A message that begins with its header.
CdrWriter begun(Bytes& bytes, const Header& header) {
  CdrWriter out(bytes);
  put_header(out, header);
  return out;
}

} // namespace

MessageType message_type(std::string_view name) {
  const char* members = members_of(name);
  const std::size_t slash = name.find('/');
  MessageType type{std::string(name.substr(0, slash)).append("/msg").append(name.substr(slash)), members};
  append_parts(type.text, members);
  return type;
}

void encode(Bytes& bytes, const Header& header, const LaserScan& scan) {
  CdrWriter out = begun(bytes, header);
  const double steps = scan.ranges.empty() ? 0 : static_cast<double>(scan.ranges.size() - 1);
  for (const double value : {scan.angle_min, scan.angle_min + steps * scan.angle_increment,
                             scan.angle_increment, 0.0, scan.scan_time, scan.range_min, scan.range_max})
    out.put(static_cast<float>(value));
  out.put(scan.ranges);
  out.count(0); // intensities
}

void encode(Bytes& bytes, const Header& header, std::span<const BoundaryPoint> points) {
  constexpr const char* names[] = {"x", "y", "z", "low", "high"};
  constexpr std::uint8_t float32 = 7;
  constexpr std::uint32_t step = 4 * std::size(names), one = 1;
  const auto width = static_cast<std::uint32_t>(points.size());
  CdrWriter out = begun(bytes, header);
  out.put(one, width); // the points are one row
  out.count(std::size(names));
  std::uint32_t offset = 0;
  for (const char* name : names) {
    out.put(name, offset, float32, one);
    offset += 4;
  }
  constexpr bool big_endian = false, dense = true; // dense: no point is NaN
  out.put(big_endian, step, step * width);
  out.count(std::size_t{step} * width);
  for (const BoundaryPoint& point : points)
    out.put(point.x, point.y, point.z, point.low, point.high);
  out.put(dense);
}

void encode(Bytes& bytes, const Header& header, const OccupancyGrid& grid) {
  CdrWriter out = begun(bytes, header);
  put_time(out, header.time); // map_load_time
  out.put(static_cast<float>(grid.resolution), grid.width, grid.height, std::array{grid.x, grid.y, 0.0},
          Transform().rotation, grid.cells);
}

void encode(Bytes& bytes, const Header& header, const metric::Camera& camera) {
  CdrWriter out = begun(bytes, header);
  const auto [lens, coefficients] = metric::lens_of(camera);
  out.put(static_cast<std::uint32_t>(camera.height), static_cast<std::uint32_t>(camera.width), lens,
          std::span<const double>(camera.coefficients).first(coefficients));
  const double fx = camera.fx, fy = camera.fy, cx = camera.cx, cy = camera.cy;
  out.put(std::array{fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0});
  out.put(std::array{1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0});
  out.put(std::array{fx, 0.0, cx, 0.0, 0.0, fy, cy, 0.0, 0.0, 0.0, 1.0, 0.0});
  // binning_x, binning_y; roi's offsets, height and width: all of the picture; roi.do_rectify
  out.put(std::array<std::uint32_t, 6>{}, false);
}

void encode(Bytes& bytes, const Header& header, const GrayView& picture) {
  const auto width = static_cast<std::uint32_t>(picture.width),
             height = static_cast<std::uint32_t>(picture.height);
  constexpr std::uint8_t big_endian = 0;
  CdrWriter out = begun(bytes, header);
  out.put(height, width, "mono8", big_endian, width); // the last: bytes of a row
  out.count(std::size_t{width} * height);
  for (int y = 0; y < picture.height; ++y)
    out.raw({picture.plane.row(y), width});
}

void encode(Bytes& bytes, const Header& header, const Transform& transform) {
  CdrWriter out(bytes);
  out.count(1);
  put_header(out, header);
  out.put(transform.child, transform.translation, transform.rotation);
}

void encode(Bytes& bytes, const Header& header, const DiagnosticStatus& status) {
  CdrWriter out = begun(bytes, header);
  out.count(1);
  out.put(status.level, status.name, status.message, ""); // the last: hardware_id
  out.count(status.values.size());
  for (const auto& [key, value] : status.values)
    out.put(key, value);
}

void encode(Bytes& bytes, const Header& header, const JpegFile& picture) {
  begun(bytes, header).put("jpeg", picture.bytes);
}

void encode(Bytes& bytes, const Header& header, const H264Picture& picture) {
  begun(bytes, header).put(picture.bytes, "h264");
}

} // namespace terrainseg::recording
