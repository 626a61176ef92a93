// SPDX-License-Identifier: LGPL-2.1-or-later
#include "recording/ros_messages.hpp"

#include <algorithm>
#include <sstream>

namespace terrainseg::recording {
namespace {

/// A type, package/Name, its members, and the hash of its description as ROS 2 announces it since Iron
/// (REP 2011, REP 2016): the test of the names computes it from the members. Parts have no hash.
struct Definition {
  std::string_view name;
  const char* members;
  const char* hash = "";
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
     "float32[] ranges\nfloat32[] intensities\n",
     "64c191398013af96509d518dac71d5164f9382553fce5c1f8cca5be7924bd828"},
    {"sensor_msgs/PointCloud2",
     "std_msgs/Header header\nuint32 height\nuint32 width\nsensor_msgs/PointField[] fields\n"
     "bool is_bigendian\nuint32 point_step\nuint32 row_step\nuint8[] data\nbool is_dense\n",
     "9198cabf7da3796ae6fe19c4cb3bdd3525492988c70522628af5daa124bae2b5"},
    {"nav_msgs/OccupancyGrid", "std_msgs/Header header\nnav_msgs/MapMetaData info\nint8[] data\n",
     "8d348150c12913a31ee0ec170fbf25089e4745d17035792a1ba94d6f0bc0cfc7"},
    {"sensor_msgs/CameraInfo",
     "std_msgs/Header header\nuint32 height\nuint32 width\nstring distortion_model\nfloat64[] d\n"
     "float64[9] k\nfloat64[9] r\nfloat64[12] p\nuint32 binning_x\nuint32 binning_y\n"
     "sensor_msgs/RegionOfInterest roi\n",
     "b3dfd68ff46c9d56c80fd3bd4ed22c7a4ddce8c8348f2f59c299e73118e7e275"},
    {"sensor_msgs/Image",
     "std_msgs/Header header\nuint32 height\nuint32 width\nstring encoding\nuint8 is_bigendian\n"
     "uint32 step\nuint8[] data\n",
     "d31d41a9a4c4bc8eae9be757b0beed306564f7526c88ea6a4588fb9582527d47"},
    {"sensor_msgs/CompressedImage", "std_msgs/Header header\nstring format\nuint8[] data\n",
     "15640771531571185e2efc8a100baf923961a4d15d5569652e6cb6691e8e371a"},
    {"foxglove_msgs/CompressedVideo",
     "builtin_interfaces/Time timestamp\nstring frame_id\nuint8[] data\nstring format\n",
     "32039eafc3770e589c86c4dabff9c392ce9955ebffd43f5f60763011d43d8d1d"},
    {"tf2_msgs/TFMessage", "geometry_msgs/TransformStamped[] transforms\n",
     "e369d0f05a23ae52508854b66f6aa0437f3449d652e8cbf22d5abe85d020f087"},
    {"diagnostic_msgs/DiagnosticArray", "std_msgs/Header header\ndiagnostic_msgs/DiagnosticStatus[] status\n",
     "5a8a36efb05fb25070fa0fb3810290c0e6cd4862b54a8fb975a1ee8dc55a333e"},
    // Messages that are received.
    {"nav_msgs/Odometry",
     "std_msgs/Header header\nstring child_frame_id\ngeometry_msgs/PoseWithCovariance pose\n"
     "geometry_msgs/TwistWithCovariance twist\n",
     "3cc97dc7fb7502f8714462c526d369e35b603cfc34d946e3f2eda2766dfec6e0"},
    {"geometry_msgs/PoseStamped", "std_msgs/Header header\ngeometry_msgs/Pose pose\n",
     "10f3786d7d40fd2b54367835614bff85d4ad3b5dab62bf8bca0cc232d73b4cd8"},
    {"sensor_msgs/Imu",
     "std_msgs/Header header\ngeometry_msgs/Quaternion orientation\n"
     "float64[9] orientation_covariance\ngeometry_msgs/Vector3 angular_velocity\n"
     "float64[9] angular_velocity_covariance\ngeometry_msgs/Vector3 linear_acceleration\n"
     "float64[9] linear_acceleration_covariance\n",
     "7d9a00ff131080897a5ec7e26e315954b8eae3353c3f995c55faf71574000b5b"},
    {"std_msgs/Bool", "bool data\n", "feb91e995ff9ebd09c0cb3d2aed18b11077585839fb5db80193b62d74528f6c9"},
    {"sensor_msgs/Range", // as of Jazzy
     "std_msgs/Header header\nuint8 ULTRASOUND=0\nuint8 INFRARED=1\nuint8 radiation_type\n"
     "float32 field_of_view\nfloat32 min_range\nfloat32 max_range\nfloat32 range\n"
     "float32 variance\n",
     "b42b62562e93cbfe9d42b82fe5994dfa3d63d7d5c90a317981703f7388adff3a"},
};

/// Returns nullptr for types that are not in the table, such as uint32.
const Definition* definition_of(std::string_view name) {
  const auto* known = std::ranges::find(definitions, name, &Definition::name);
  return known == std::end(definitions) ? nullptr : known;
}

/// Appends each type that `members` use and `text` does not have yet: a line of 80 equals signs, its name,
/// and its members, then the types that it uses.
void append_parts(std::string& text, const std::string& members) {
  std::istringstream lines(members);
  for (std::string line; std::getline(lines, line);) {
    const std::string name = line.substr(0, line.find_first_of("[ ")), title = "MSG: " + name + "\n";
    const Definition* part = definition_of(name);
    if (!part || text.find(title) != std::string::npos)
      continue;
    text.append(80, '=').append("\n").append(title).append(part->members);
    append_parts(text, part->members);
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
  const Definition& known = *definition_of(name);
  const std::size_t slash = name.find('/');
  MessageType type{std::string(name.substr(0, slash)).append("/msg").append(name.substr(slash)),
                   known.members, std::string("RIHS01_") + known.hash};
  append_parts(type.text, known.members);
  return type;
}

void encode(Bytes& bytes, const Header& header, const LaserScan& scan) {
  CdrWriter out = begun(bytes, header);
  const ScanFan& fan = scan.fan;
  for (const double value :
       {fan.angle_min, fan.angle_max(), fan.increment, 0.0, scan.scan_time, fan.range_min, scan.range_max})
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
